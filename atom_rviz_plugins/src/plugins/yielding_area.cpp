#include "plugins/yielding_area.h"

#include <QEvent>
#include <QScrollBar>

namespace atom_rviz {

YieldingArea::YieldingArea(QWidget* content, const QSize& least) : least_(least) {
  setWidget(content);
  setWidgetResizable(true);
  setFrameShape(QFrame::NoFrame);
  viewport()->setAutoFillBackground(false);
  content->setAutoFillBackground(false);
}

QSize YieldingArea::sizeHint() const { return widget()->minimumSizeHint(); }

QSize YieldingArea::minimumSizeHint() const {
  const QSize all = widget()->minimumSizeHint();
  QSize least = all.boundedTo(least_);
  if (least.height() < all.height()) least.rwidth() += verticalScrollBar()->sizeHint().width();
  if (least.width() < all.width()) least.rheight() += horizontalScrollBar()->sizeHint().height();
  return least;
}

// The content has another size now: this asks its own layout for another one.
bool YieldingArea::event(QEvent* event) {
  if (event->type() == QEvent::LayoutRequest) updateGeometry();
  return QScrollArea::event(event);
}

}  // namespace atom_rviz
