#include "plane_pieces.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "disjoint_sets.h"

namespace atom_core {
namespace {

constexpr double kDropoutSteps = 4.5;  // of azimuth without a return that a run bridges

// Tells whether the plane may go on between two inliers of a layer.
bool Continues(const Scan& scan, const Window& window, int i, int j, const Plane& plane,
               double reach, double dark) {
  const Near &a = window.points[i], &b = window.points[j];
  const double apart = (a.point->position - b.point->position).norm();
  if (apart > reach) return false;
  bool hidden = false;
  for (int k = i + 1; k < j; ++k) {
    const int side = plane.Side(*window.points[k].point);
    if (side > 0) return false;
    hidden = hidden || side < 0;
  }
  return hidden || apart < dark || b.azimuth - a.azimuth <= kDropoutSteps * scan.azimuth_step;
}

}  // namespace

std::vector<Run> FindRuns(const Scan& scan, const Window& window, const std::vector<int>& inliers,
                          const Plane& plane, double reach, double dark) {
  std::vector<Run> runs;
  for (const int i : inliers) {
    const Near& near = window.points[i];
    if (!runs.empty() && runs.back().layer == near.point->layer &&
        Continues(scan, window, runs.back().last, i, plane, reach, dark)) {
      runs.back().last = i;
      runs.back().to = near.azimuth;
    } else {
      runs.push_back({near.point->layer, i, i, near.azimuth, near.azimuth});
    }
  }
  return runs;
}

std::vector<std::vector<int>> FindPieces(const Scan& scan, const Window& window,
                                         const std::vector<int>& inliers, const Plane& plane,
                                         double reach, double dark) {
  const std::vector<Run> runs = FindRuns(scan, window, inliers, plane, reach, dark);
  std::vector<int> parent(runs.size());
  std::iota(parent.begin(), parent.end(), 0);
  const double slack = 2.0 * scan.azimuth_step;
  std::size_t low = 0;  // first run of the layer below
  for (std::size_t i = 0; i < runs.size(); ++i) {
    while (runs[low].layer < runs[i].layer - 1) ++low;
    for (std::size_t k = low; k < i && runs[k].layer < runs[i].layer; ++k) {
      if (runs[k].from <= runs[i].to + slack && runs[i].from <= runs[k].to + slack) {
        Unite(&parent, i, k);
      }
    }
  }
  std::map<int, std::vector<int>> pieces;
  std::size_t next = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    std::vector<int>& piece = pieces[FindRoot(&parent, i)];
    for (; next < inliers.size() && inliers[next] <= runs[i].last; ++next) {
      piece.push_back(inliers[next]);
    }
  }
  std::vector<std::vector<int>> sorted;
  for (auto& item : pieces) sorted.push_back(std::move(item.second));
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return sorted;
}

}  // namespace atom_core
