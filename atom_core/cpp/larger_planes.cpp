#include "larger_planes.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace atom_core {
namespace {

constexpr int kMeanOf = 10;                 // returns on each side are averaged,
constexpr double kMeanOver = 0.12;          // [m] on each side
constexpr double kInDoubt = 0.002;          // [m] by which a board must be nearer
constexpr double kNearlyParallel = 0.9986;  // of 3 degrees: planes nearly parallel do not meet here

}  // namespace

bool LargerPlanes::Have(int i, const Plane &board) const {
  for (const Plane &larger : planes_) {
    if (std::abs(larger.normal.dot(board.normal)) > kNearlyParallel) continue;
    if (!larger.Holds(window_.At(i))) continue;
    const Eigen::Vector3d mean = Smoothed(i);
    if (std::abs(larger.Residual(mean)) < std::abs(board.Residual(mean)) + kInDoubt) return true;
  }
  return false;
}

std::vector<int> LargerPlanes::Without(const std::vector<int> &inliers, const Plane &board) const {
  if (planes_.empty()) return inliers;
  std::vector<int> left;
  std::copy_if(inliers.begin(), inliers.end(), std::back_inserter(left),
               [&](int i) { return !Have(i, board); });
  return left;
}

// The mean with as many neighbours in the layer on both sides.
Eigen::Vector3d LargerPlanes::Smoothed(int i) const {
  const ScanPoint &here = window_.At(i);
  const int count = static_cast<int>(window_.points.size());
  Eigen::Vector3d sum = here.position;
  int k = 1;
  for (; k <= kMeanOf && i >= k && i + k < count; ++k) {
    const ScanPoint &before = window_.At(i - k), &after = window_.At(i + k);
    if (before.layer != here.layer || after.layer != here.layer) break;
    const double apart =
        std::max((before.position - here.position).norm(), (after.position - here.position).norm());
    if (k > 1 && apart > kMeanOver) break;
    sum += before.position + after.position;
  }
  return sum / (2 * k - 1);
}

}  // namespace atom_core
