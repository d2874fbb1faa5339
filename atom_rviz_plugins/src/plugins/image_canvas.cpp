#include "plugins/image_canvas.h"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <cmath>

namespace atom_rviz {
namespace {

constexpr double kClosingRadius = 10.0;  // of the first corner, in screen pixels
constexpr double kZoomPerNotch = 1.2;
constexpr double kEighthsPerNotch = 120.0;  // Qt's unit of a wheel
const QString kBorderKeys("nprxcu.,+-h");   // those of the annotation tool
const QColor kMark(255, 220, 0);
const QColor kTaken(60, 220, 60);  // that of labels on the board
constexpr double kFrame = 6.0;     // of a picture that is taken, in screen pixels
constexpr int kFlash_ms = 500;

/// Mouse positions are whole screen pixels; the pixel's centre is meant.
Point2 centre_of(const QPointF& position) {
  return {std::floor(position.x()) + 0.5, std::floor(position.y()) + 0.5};
}

QPointF from(Point2 point) { return {point.x, point.y}; }

}  // namespace

ImageCanvas::ImageCanvas(QWidget* parent) : QWidget(parent) {
  setMouseTracking(true);
  setFocusPolicy(Qt::StrongFocus);
  setCursor(Qt::CrossCursor);
  flash_timer_.setSingleShot(true);
  connect(&flash_timer_, &QTimer::timeout, this, [this] { update(); });
}

void ImageCanvas::show_image(const QImage& image, const QString& text) {
  image_ = image;
  text_ = text;
  view_.set_image({static_cast<double>(image.width()), static_cast<double>(image.height())});
  update();
}

void ImageCanvas::set_mode(Mode mode) {
  const bool drew_border = draws_border();
  mode_ = mode;
  if (draws_border() != drew_border) Q_EMIT border_key(drew_border ? "q" : "h");
  Q_EMIT message_changed(draws_border() ? "Left: a point. n: the next side. h: all keys" : "");
  drawing_.cancel();
  last_click_px_.reset();
  update();
}

void ImageCanvas::fit() {
  view_.fit();
  update();
}

void ImageCanvas::forget() {
  drawing_ = PolygonDrawing();
  last_click_px_.reset();
  Q_EMIT message_changed("");
  update();
}

void ImageCanvas::flash() {
  flash_timer_.start(kFlash_ms);
  update();
}

void ImageCanvas::paintEvent(QPaintEvent* /*event*/) {
  QPainter painter(this);
  painter.fillRect(rect(), QColor(40, 40, 40));
  if (image_.isNull()) {
    painter.setPen(Qt::lightGray);
    painter.drawText(rect().adjusted(8, 8, -8, -8), Qt::AlignCenter | Qt::TextWordWrap, text_);
    return;
  }
  painter.setRenderHint(QPainter::SmoothPixmapTransform, view_.scale() < 1.0);
  const QSizeF size = QSizeF(image_.size()) * view_.scale();
  painter.drawImage(QRectF(from(view_.corner()), size), image_);
  painter.setRenderHint(QPainter::Antialiasing);
  draw_marks(painter);
  if (!flash_timer_.isActive()) return;
  painter.setBrush(Qt::NoBrush);
  painter.setPen(QPen(kTaken, 2.0 * kFrame));
  painter.drawRect(rect());
}

void ImageCanvas::draw_marks(QPainter& painter) const {
  painter.setPen(QPen(kMark, 1.5));
  if (last_click_px_) {
    const QPointF place = from(view_.widget_from_pixel(*last_click_px_));
    painter.drawLine(place - QPointF(7, 0), place + QPointF(7, 0));
    painter.drawLine(place - QPointF(0, 7), place + QPointF(0, 7));
  }
  QPolygonF open;
  for (const Point2& corner : drawing_.corners()) open << from(view_.widget_from_pixel(corner));
  for (const QPointF& corner : open) painter.drawEllipse(corner, 3, 3);
  if (!open.isEmpty()) painter.drawPolyline(open << mouse_);
  QPolygonF closed;
  for (const Point2& corner : drawing_.closed()) closed << from(view_.widget_from_pixel(corner));
  if (!open.isEmpty() || closed.isEmpty() || mode_ != Mode::kPolygon) return;
  painter.drawPolygon(closed);
}

void ImageCanvas::resizeEvent(QResizeEvent* /*event*/) {
  view_.resize({static_cast<double>(width()), static_cast<double>(height())});
}

void ImageCanvas::mousePressEvent(QMouseEvent* event) {
  setFocus();
  const Point2 pixel = view_.pixel_from_widget(centre_of(event->localPos()));
  mouse_ = event->localPos();
  if (event->button() == Qt::LeftButton && view_.contains(pixel)) {
    press_left(pixel);
  } else if (event->button() == Qt::RightButton && mode_ == Mode::kPolygon) {
    say(drawing_.close());
  } else if (event->button() == Qt::RightButton && mode_ == Mode::kClick && view_.contains(pixel)) {
    Q_EMIT right_clicked(pixel.x, pixel.y);
  }
  update();
}

void ImageCanvas::press_left(Point2 pixel) {
  if (mode_ == Mode::kPolygon) {
    say(drawing_.add(pixel, kClosingRadius / view_.scale()));
    return;
  }
  if (mode_ == Mode::kBorder) {
    Q_EMIT border_clicked(pixel.x, pixel.y);
    return;
  }
  last_click_px_ = pixel;
  Q_EMIT clicked(pixel.x, pixel.y);
  Q_EMIT message_changed(QString("Clicked %1, %2").arg(pixel.x, 0, 'f', 2).arg(pixel.y, 0, 'f', 2));
}

void ImageCanvas::say(PolygonDrawing::Outcome outcome) {
  using Outcome = PolygonDrawing::Outcome;
  if (outcome == Outcome::kClosed) {
    QVector<QPointF> corners;
    for (const Point2& corner : drawing_.closed()) corners << from(corner);
    Q_EMIT polygon_closed(corners);
    Q_EMIT message_changed(QString("Polygon of %1 corners").arg(corners.size()));
  } else if (outcome == Outcome::kTooSmall) {
    Q_EMIT message_changed("A polygon needs three corners, not on one line");
  } else if (outcome == Outcome::kCancelled) {
    Q_EMIT message_changed("Polygon forgotten");
  } else if (outcome != Outcome::kNothing) {
    Q_EMIT message_changed("Right or Enter: close. Backspace: one back. Escape: forget");
  }
}

void ImageCanvas::mouseMoveEvent(QMouseEvent* event) {
  if (event->buttons() & Qt::MiddleButton) {
    const QPointF by = event->localPos() - mouse_;
    view_.move({by.x(), by.y()});
  }
  mouse_ = event->localPos();
  const Point2 pixel = view_.pixel_from_widget(centre_of(mouse_));
  if (view_.contains(pixel)) {
    Q_EMIT hovered(qBound(0, static_cast<int>(std::lround(pixel.x)), image_.width() - 1),
                   qBound(0, static_cast<int>(std::lround(pixel.y)), image_.height() - 1));
  } else {
    Q_EMIT hovered(-1, -1);
  }
  if (event->buttons() || !drawing_.corners().empty()) update();
}

void ImageCanvas::wheelEvent(QWheelEvent* event) {
  const double notches = event->angleDelta().y() / kEighthsPerNotch;
  view_.zoom(centre_of(mouse_), std::pow(kZoomPerNotch, notches));
  update();
}

void ImageCanvas::keyPressEvent(QKeyEvent* event) {
  const bool polygon = mode_ == Mode::kPolygon;
  if (event->key() == Qt::Key_F) {
    fit();
  } else if (draws_border() && event->text().size() == 1 && kBorderKeys.contains(event->text())) {
    Q_EMIT border_key(event->text());
  } else if (polygon && (event->key() == Qt::Key_Return || event->key() == Qt::Key_Enter)) {
    say(drawing_.close());
  } else if (polygon && event->key() == Qt::Key_Escape) {
    say(drawing_.cancel());
  } else if (polygon && event->key() == Qt::Key_Backspace) {
    say(drawing_.take_back());
  } else {
    QWidget::keyPressEvent(event);
  }
  update();
}

void ImageCanvas::enterEvent(QEvent* /*event*/) { setFocus(); }

void ImageCanvas::leaveEvent(QEvent* /*event*/) { Q_EMIT hovered(-1, -1); }

}  // namespace atom_rviz
