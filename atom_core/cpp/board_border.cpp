#include "board_border.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "board_judgement.h"

namespace atom_core {
namespace {

constexpr double kBorderShare = 0.7;  // of the layers' ends that must lie on the border
constexpr int kLeastOnBorder = 4;     // ends

// Half the way from one layer to the other beside each of a surface's layers, over their mean.
std::vector<double> WeightsOfLayers(const Surface& surface) {
  std::vector<double> weights;
  for (const auto& end : surface.ends()) weights.push_back(surface.LayerSpacing(end.first));
  const double mean = std::accumulate(weights.begin(), weights.end(), 0.0) / weights.size();
  if (!(mean > 0.0)) return std::vector<double>(weights.size(), 1.0);
  for (double& weight : weights) weight /= mean;
  return weights;
}

}  // namespace

LayerBorders FindBorders(const Surface& surface) {
  LayerBorders borders;
  const std::vector<double> weights = WeightsOfLayers(surface);
  const auto add = [&](int i, int side, double weight) {
    if (surface.GoesOn(i, side)) {
      borders.open += weight;
    } else {
      surface.AddEnd(i, side, &borders.outline);
      borders.weights.resize(borders.outline.limits.size(), weight);
    }
  };
  for (std::size_t k = 0; k < weights.size(); ++k) {
    add(surface.ends()[k].first, -1, weights[k]);
    add(surface.ends()[k].second, 1, weights[k]);
  }
  surface.AddLayersAround(&borders.outline.outside);
  return borders;
}

bool BorderFits(const Surface& surface, const RectanglePose& pose, const LayerBorders& borders,
                BoardSegment* segment) {
  const PlanePoints& limits = borders.outline.limits;
  double sum = 0.0, near = 0.0, all = borders.open;
  int count = 0;
  for (std::size_t k = 0; k < limits.size(); ++k) {
    const double weight = borders.weights[k];
    all += weight;
    const double distance = SignedDistance(pose.ToBoard(limits[k]), surface.seen_half());
    if (std::abs(distance) > 3.0 * surface.Tolerance()) continue;
    sum += weight * distance * distance;
    near += weight;
    ++count;
  }
  segment->border_rms = near > 0.0 ? std::sqrt(sum / near) : 0.0;
  if (near >= kBorderShare * all && count >= kLeastOnBorder &&
      segment->border_rms < surface.Tolerance()) {
    return true;
  }
  Reject(5,
         Text("the outline is not the board's (%.0f of %.0f ends of layers on it, %.0f mm RMS)",
              near, all, 1e3 * segment->border_rms),
         segment);
  return false;
}

}  // namespace atom_core
