// A widget that shows an image and takes clicks and polygons in its pixels.
#pragma once

#include <QImage>
#include <QTimer>
#include <QWidget>
#include <optional>

#include "logic/image_view.h"
#include "logic/polygon_drawing.h"

namespace atom_rviz {

/// The wheel zooms at the mouse, the middle button moves, F shows all of the image.
///
/// Clicking: the left and the right button. Border: the left button, and the keys of the annotation
/// tool, which the node that draws the border understands. Polygons: left adds a corner, right or
/// Enter closes (so does the first corner), Backspace takes one back, Escape forgets all.
class ImageCanvas : public QWidget {
  Q_OBJECT
 public:
  enum class Mode { kClick, kPolygon, kBorder };

  explicit ImageCanvas(QWidget* parent = nullptr);

  /// Show an image; a null image shows `text` instead.
  void show_image(const QImage& image, const QString& text = "");

  void set_mode(Mode mode);

  /// Letters typed over the image are for the border that is drawn.
  bool draws_border() const { return mode_ == Mode::kBorder; }

  QSize sizeHint() const override { return {480, 360}; }
  QSize minimumSizeHint() const override { return {120, 90}; }

 public Q_SLOTS:
  void fit();

  /// Forget clicks and polygons: they were of another picture.
  void forget();

  /// Show a frame around the image for a moment: what is seen now is taken.
  void flash();

 Q_SIGNALS:
  /// A click, or a closed polygon, in px; (0, 0) is the centre of the top-left pixel.
  void clicked(double x_px, double y_px);
  void right_clicked(double x_px, double y_px);
  void polygon_closed(const QVector<QPointF>& corners_px);
  void border_clicked(double x_px, double y_px);

  /// A key of the annotation tool, one letter, while a border is drawn: "h" at first, which asks
  /// for the keys, "q" at last.
  void border_key(const QString& key);

  /// The mouse is over a pixel, or (with column -1) over none.
  void hovered(int column, int row);

  /// Something to tell the user.
  void message_changed(const QString& text);

 protected:
  void paintEvent(QPaintEvent* event) override;
  void resizeEvent(QResizeEvent* event) override;
  void mousePressEvent(QMouseEvent* event) override;
  void mouseMoveEvent(QMouseEvent* event) override;
  void wheelEvent(QWheelEvent* event) override;
  void keyPressEvent(QKeyEvent* event) override;
  void enterEvent(QEvent* event) override;
  void leaveEvent(QEvent* event) override;

 private:
  void press_left(Point2 pixel);
  void say(PolygonDrawing::Outcome outcome);
  void draw_marks(QPainter& painter) const;

  ImageView view_;
  PolygonDrawing drawing_;
  Mode mode_ = Mode::kClick;
  QImage image_;
  QString text_;
  std::optional<Point2> last_click_px_;
  QTimer flash_timer_;  // runs while the frame is shown
  QPointF mouse_;
};

}  // namespace atom_rviz
