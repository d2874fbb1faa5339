#include "plugins/image_pane.h"

#include <QHBoxLayout>
#include <QVBoxLayout>

namespace atom_rviz {

ImagePane::ImagePane(QWidget* parent)
    : QWidget(parent),
      click_(button("Click", "Left and right clicks are published")),
      polygon_(button("Polygon",
                      "Left: a corner. Right or Enter: close. Backspace: one back. "
                      "Escape: forget")),
      border_(
          button("Border",
                 "Draws the board's border for evaluations. Left: a point. n, p: next, previous "
                 "side. r, x, c: removes the last point, the side, all. u: a step back. Dot, "
                 "comma: next, previous collection. h: all keys")) {
  QToolButton* fit = button("Fit",
                            "Show all of the image (F). The wheel zooms, the middle button "
                            "moves");
  click_->setObjectName("click_mode");
  polygon_->setObjectName("polygon_mode");
  border_->setObjectName("border_mode");
  for (QToolButton* mode : {click_, polygon_, border_}) mode->setCheckable(true);
  message_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
  auto* bar = new QHBoxLayout;
  bar->setSpacing(6);
  for (QWidget* widget : {static_cast<QWidget*>(click_), static_cast<QWidget*>(polygon_),
                          static_cast<QWidget*>(border_), static_cast<QWidget*>(fit),
                          static_cast<QWidget*>(value_)}) {
    bar->addWidget(widget);
  }
  bar->addWidget(message_, 1);
  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->setSpacing(1);
  layout->addWidget(canvas_, 1);
  layout->addLayout(bar);
  const auto choose = [this](ImageCanvas::Mode mode) {
    set_mode(mode);
    Q_EMIT mode_chosen(static_cast<int>(mode));
  };
  connect(click_, &QToolButton::clicked, this, [choose] { choose(ImageCanvas::Mode::kClick); });
  connect(polygon_, &QToolButton::clicked, this, [choose] { choose(ImageCanvas::Mode::kPolygon); });
  connect(border_, &QToolButton::clicked, this, [choose] { choose(ImageCanvas::Mode::kBorder); });
  connect(fit, &QToolButton::clicked, canvas_, &ImageCanvas::fit);
  connect(canvas_, &ImageCanvas::message_changed, message_, &QLabel::setText);
  set_mode(ImageCanvas::Mode::kClick);
}

QToolButton* ImagePane::button(const QString& text, const QString& hint) {
  auto* made = new QToolButton;
  made->setText(text);
  made->setToolTip(hint);
  made->setFocusPolicy(Qt::NoFocus);
  return made;
}

void ImagePane::set_mode(ImageCanvas::Mode mode) {
  click_->setChecked(mode == ImageCanvas::Mode::kClick);
  polygon_->setChecked(mode == ImageCanvas::Mode::kPolygon);
  border_->setChecked(mode == ImageCanvas::Mode::kBorder);
  canvas_->set_mode(mode);
}

}  // namespace atom_rviz
