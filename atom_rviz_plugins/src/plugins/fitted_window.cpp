#include "plugins/fitted_window.h"

#include <QScreen>
#include <QTimer>
#include <QWidget>
#include <QWindow>

namespace atom_rviz {
namespace {

// The window manager puts a frame around a window that is seen, on a busy machine seconds later,
// and then gives it the size that the layout asked for. Some managers put none.
constexpr int kLook_ms = 500;
constexpr int kLooks = 6;
constexpr int kLooksWithoutFrame = 40;

void fit(QWidget* window) {
  const QScreen* screen = window->windowHandle() ? window->windowHandle()->screen() : nullptr;
  if (!screen) return;
  const QRect room = screen->availableGeometry();
  const QRect whole = window->frameGeometry();
  if (whole.width() > room.width() || whole.height() > room.height()) {
    const QSize frame = whole.size() - window->size();
    window->move(room.topLeft());
    window->resize(window->size().boundedTo(room.size() - frame));
  }
}

}  // namespace

void fit_into_screen(QWidget* window) {
  auto* timer = new QTimer(window);
  const auto look = [window, timer, looks = 0, framed = 0]() mutable {
    if (!window->isVisible()) return;
    fit(window);
    framed += window->frameGeometry() != window->geometry();
    if (++looks == kLooksWithoutFrame || framed == kLooks) timer->deleteLater();
  };
  QObject::connect(timer, &QTimer::timeout, window, look);
  timer->start(kLook_ms);
}

}  // namespace atom_rviz
