// The window of RViz on a screen that is smaller than the one it was made for.
#pragma once

class QWidget;

namespace atom_rviz {

/// Make a window no larger than its screen, once the window manager has put a frame around it. A
/// layout that was made for a larger screen would hide a part of it beyond the edge.
void fit_into_screen(QWidget* window);

}  // namespace atom_rviz
