#include "board_beside.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace atom_core {
namespace {

constexpr int kBins = 8;            // of a side
constexpr double kStrip = 0.12;     // of the shorter side: width of the strip that is looked at
constexpr double kOpenShare = 0.5;  // of the bins
constexpr int kProgress = 6;

}  // namespace

bool GoesOnBesideSide(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                      BoardSegment* segment) {
  const Eigen::Vector2d half = surface.seen_half();
  const double from = surface.Tolerance(), to = from + kStrip * search.options.size.minCoeff();
  std::array<std::array<int, kBins>, 4> more = {};  // returns on the plane than behind it, of each
                                                    // bin beside -x, +x, -y, +y
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint& point = search.At(i);
    const bool holds = surface.plane().Holds(point) && !search.IsOfLarger(i, surface.plane());
    if (!holds && surface.plane().Residual(point.position) < 0.0) continue;
    const Eigen::Vector2d place = pose.ToBoard(surface.InPlane(point.position));
    for (int axis = 0; axis < 2; ++axis) {
      const double beyond = std::abs(place[axis]) - half[axis];
      const double along = (place[1 - axis] / half[1 - axis] + 1.0) / 2.0;
      if (beyond < from || beyond > to || along <= 0.0 || along >= 1.0) continue;
      const int side = 2 * axis + (place[axis] > 0.0 ? 1 : 0);
      more[side][static_cast<int>(along * kBins)] += holds ? 1 : -1;
    }
  }
  for (const auto& side : more) {
    // Of a wall right behind some returns lie on the plane, but most do not.
    const auto open = std::count_if(side.begin(), side.end(), [](int bin) { return bin > 0; });
    if (open <= kOpenShare * kBins) continue;
    segment->progress = kProgress;
    segment->reason = "the surface goes on beyond the board's outline";
    return true;
  }
  return false;
}

}  // namespace atom_core
