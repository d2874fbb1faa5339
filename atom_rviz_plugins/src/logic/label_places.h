// Where labels stand on the screen so that none covers another.
#pragma once

#include <string>
#include <vector>

namespace atom_rviz {

/// A label: where it would stand, and its size, in screen pixels; y down.
struct ScreenLabel {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// How far each label is moved down, in screen pixels, so that none covers another. The upper ones
/// stay; labels apart from others do not move, nor do those whose place is not finite.
std::vector<double> shifts_down(const std::vector<ScreenLabel>& labels);

}  // namespace atom_rviz
