#include "cloud_label.h"

#include <algorithm>
#include <cstdint>
#include <set>

namespace atom_core {
namespace {

constexpr double kMostInset = 0.9;  // spacings that a limit point may lie inside

// The bin of each side that a point in the rectangle's axes belongs to; 0: none.
const SideBin* BinAt(const Sides& sides, int k, const Eigen::Vector2d& point,
                     const Eigen::Vector2d& half) {
  const double length = 2.0 * half[1 - k / 2], place = point[1 - k / 2] / length + 0.5;
  if (place < 0.0 || place >= 1.0) return nullptr;
  return &sides[k][static_cast<std::size_t>(place * sides[k].size())];
}

bool IsBoards(const Sides& sides, const Eigen::Vector2d& point, const Eigen::Vector2d& half,
              double sigma) {
  for (int k = 0; k < 4; ++k) {
    const SideBin* bin = BinAt(sides, k, point, half);
    if (bin == nullptr) continue;
    const double beyond = (k % 2 == 0 ? 1.0 : -1.0) * point[k / 2] - half[k / 2];
    const bool is_open = bin->GoesOn() || bin->touching > 0 || bin->behind > 0;
    if (beyond > (is_open ? 0.0 : 0.5 * bin->spacing + 0.005)) return false;
    const double margin = TouchMargin(*bin, sigma);
    if (margin > 0.0 && beyond > -margin) return false;
  }
  return SignedDistance(point, half) < 0.01 + 0.02 * half.minCoeff();
}

}  // namespace

void LabelCloudBoard(const BoardSearch& search, const Patch& patch, const RectanglePose& pose,
                     const std::vector<PlaneReturn>& returns, const Sides& sides,
                     BoardSegment* segment) {
  const double sigma = patch.axes.plane.sigma;
  std::set<std::int64_t> labeled;
  for (const PlaneReturn& item : returns) {
    if (std::abs(item.off) > kThreshold * sigma) continue;
    if (!IsBoards(sides, pose.ToBoard(item.position), patch.half, sigma)) continue;
    segment->indices.push_back(search.At(item.near).index);
  }
  std::sort(segment->indices.begin(), segment->indices.end());
  labeled.insert(segment->indices.begin(), segment->indices.end());
  std::set<std::int64_t> limits;
  for (const auto& side : sides) {
    for (const SideBin& bin : side) {
      if (!bin.OnBorder() || bin.beyond < -kMostInset * bin.spacing) continue;
      const std::int64_t index = search.At(returns[bin.outermost].near).index;
      if (labeled.count(index) != 0) limits.insert(index);
    }
  }
  segment->limit_indices.assign(limits.begin(), limits.end());
  segment->expected_points =
      static_cast<int>(segment->indices.size() / std::max(segment->visible, 0.1));
}

}  // namespace atom_core
