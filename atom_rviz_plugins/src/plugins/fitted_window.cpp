#include "plugins/fitted_window.h"

#include <QScreen>
#include <QTimer>
#include <QWidget>
#include <QWindow>

namespace atom_rviz {
namespace {

// The window manager puts a frame around a window that is seen: soon, but not at once. On a busy
// machine it may answer seconds later, with the size that the layout asked for.
constexpr int kLook_ms = 500;
constexpr int kLooks = 40;

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
  QObject::connect(timer, &QTimer::timeout, window, [window, timer, looks = 0]() mutable {
    if (!window->isVisible()) return;
    fit(window);
    if (++looks == kLooks) timer->deleteLater();
  });
  timer->start(kLook_ms);
}

}  // namespace atom_rviz
