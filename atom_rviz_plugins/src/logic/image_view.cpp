#include "logic/image_view.h"

#include <algorithm>

namespace atom_rviz {

void ImageView::resize(Size2 widget) {
  if (fitted_ || widget_.empty() || widget.empty()) {
    widget_ = widget;
    fit();
    return;
  }
  move({(widget.width - widget_.width) / 2, (widget.height - widget_.height) / 2});
  widget_ = widget;
  zoom({widget.width / 2, widget.height / 2}, 1.0);  // the fitted scale is another one now
}

void ImageView::set_image(Size2 image) {
  if (image.width == image_.width && image.height == image_.height) return;
  image_ = image;
  fit();
}

void ImageView::fit() {
  fitted_ = true;
  scale_ = fitted_scale();
  corner_ = {(widget_.width - scale_ * image_.width) / 2,
             (widget_.height - scale_ * image_.height) / 2};
}

void ImageView::zoom(Point2 widget_point, double factor) {
  if (scale_ <= 0.0 || factor <= 0.0) return;
  const double least = fitted_scale();
  const double scale = std::min(scale_ * factor, std::max(least, kLargestScale));
  if (scale <= least) {
    fit();
    return;
  }
  const Point2 pixel = pixel_from_widget(widget_point);
  fitted_ = false;
  scale_ = scale;
  corner_ = {widget_point.x - scale * (pixel.x + 0.5), widget_point.y - scale * (pixel.y + 0.5)};
  keep_in_sight();
}

void ImageView::move(Point2 by) {
  if (fitted_) return;
  corner_ = {corner_.x + by.x, corner_.y + by.y};
  keep_in_sight();
}

Point2 ImageView::pixel_from_widget(Point2 widget_point) const {
  if (scale_ <= 0.0) return {-1.0, -1.0};
  return {(widget_point.x - corner_.x) / scale_ - 0.5, (widget_point.y - corner_.y) / scale_ - 0.5};
}

Point2 ImageView::widget_from_pixel(Point2 pixel) const {
  return {corner_.x + scale_ * (pixel.x + 0.5), corner_.y + scale_ * (pixel.y + 0.5)};
}

bool ImageView::contains(Point2 pixel) const {
  return pixel.x >= -0.5 && pixel.y >= -0.5 && pixel.x <= image_.width - 0.5 &&
         pixel.y <= image_.height - 0.5 && !image_.empty();
}

double ImageView::fitted_scale() const {
  if (widget_.empty() || image_.empty()) return 0.0;
  return std::min(widget_.width / image_.width, widget_.height / image_.height);
}

void ImageView::keep_in_sight() {
  const double middle_x = widget_.width / 2;
  const double middle_y = widget_.height / 2;
  corner_.x = std::clamp(corner_.x, middle_x - scale_ * image_.width, middle_x);
  corner_.y = std::clamp(corner_.y, middle_y - scale_ * image_.height, middle_y);
}

}  // namespace atom_rviz
