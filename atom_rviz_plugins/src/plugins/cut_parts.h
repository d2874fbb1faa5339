// What of a panel is cut or hidden.
#pragma once

#include <QWidget>
#include <string>
#include <vector>

namespace atom_rviz {

/// A sentence for each part of a panel that is not whole on the screen: a widget that is smaller
/// than it must be, or beyond its window or the screen; a heading or a text that is cut; a row of a
/// table that shall show all of them.
std::vector<std::string> cut_parts(const QWidget& panel);

}  // namespace atom_rviz
