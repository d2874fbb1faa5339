// A widget that is scrolled where the screen has no room for all of it.
#pragma once

#include <QScrollArea>

namespace atom_rviz {

/// As large as its content wants to be, down to a least size; then the content is scrolled, so that
/// what stands beside it stays on the screen.
class YieldingArea : public QScrollArea {
 public:
  /// The content gives room up down to `least`, in screen pixels.
  YieldingArea(QWidget* content, const QSize& least);

  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 protected:
  bool event(QEvent* event) override;

 private:
  QSize least_;
};

}  // namespace atom_rviz
