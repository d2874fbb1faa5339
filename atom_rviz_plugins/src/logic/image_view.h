// How an image lies in a widget, and which pixel is under the mouse.
#pragma once

namespace atom_rviz {

/// A position: in an image in px, (0, 0) the centre of the top-left pixel; in a widget in screen
/// pixels, (0, 0) its top-left corner.
struct Point2 {
  double x = 0.0;
  double y = 0.0;
};

/// Width and height, in the pixels of an image or of a widget.
struct Size2 {
  double width = 0.0;
  double height = 0.0;

  bool empty() const { return width <= 0.0 || height <= 0.0; }
};

/// The similarity between image and widget: fitted with margins at first, then zoomed and moved.
///
/// While it is fitted it follows the size of the widget. The middle of the widget always shows a
/// piece of the image, so that the image cannot be lost.
class ImageView {
 public:
  /// The widget has another size; a zoomed view keeps what is in the middle.
  void resize(Size2 widget);

  /// The image has another size; a view of the same size is kept, another one is fitted.
  void set_image(Size2 image);

  /// Show the whole image, as large as it can be.
  void fit();

  /// Zoom by `factor`; what is at `widget_point` stays there. Not below the fitted scale, and not
  /// above `kLargestScale` screen pixels for a pixel.
  void zoom(Point2 widget_point, double factor);

  /// Move the image by screen pixels.
  void move(Point2 by);

  /// Screen pixels for a pixel of the image; 0 while there is no image or no widget.
  double scale() const { return scale_; }

  /// Widget coordinates of the image's top-left corner, which is pixel (-0.5, -0.5).
  Point2 corner() const { return corner_; }

  Size2 image() const { return image_; }
  bool fitted() const { return fitted_; }

  Point2 pixel_from_widget(Point2 widget_point) const;
  Point2 widget_from_pixel(Point2 pixel) const;

  /// Whether a pixel position lies in the image, -0.5 ... size - 0.5. False without an image.
  bool contains(Point2 pixel) const;

  static constexpr double kLargestScale = 64.0;

 private:
  double fitted_scale() const;
  void keep_in_sight();

  Size2 widget_;
  Size2 image_;
  Point2 corner_;
  double scale_ = 0.0;
  bool fitted_ = true;
};

}  // namespace atom_rviz
