#include "logic/label_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace atom_rviz {

std::vector<double> shifts_down(const std::vector<ScreenLabel>& labels) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (std::isfinite(labels[i].x) && std::isfinite(labels[i].y)) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return labels[a].y < labels[b].y; });
  std::vector<double> shifts(labels.size(), 0.0);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const ScreenLabel& mine = labels[order[i]];
    double y = mine.y;
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t k = 0; k < i; ++k) {
        const ScreenLabel& other = labels[order[k]];
        const double other_y = other.y + shifts[order[k]];
        const bool beside = mine.x + mine.width <= other.x || other.x + other.width <= mine.x;
        if (beside || y + mine.height <= other_y || other_y + other.height <= y) continue;
        y = other_y + other.height;
        moved = true;
      }
    }
    shifts[order[i]] = y - mine.y;
  }
  return shifts;
}

}  // namespace atom_rviz
