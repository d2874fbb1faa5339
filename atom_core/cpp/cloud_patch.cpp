#include "cloud_patch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "median.h"

namespace atom_core {
namespace {

constexpr std::size_t kNeighbourSamples = 60;
constexpr double kNeighbourhood = 3.0;  // spacings
constexpr int kLeastNeighbours = 8;
constexpr double kCorePixel = 0.15;  // of the diagonal: sparse points fill it

}  // namespace

Patch MakePatch(const BoardSearch& search, const Plane& plane, std::vector<int> piece) {
  Patch patch;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int i : piece) mean += search.At(i).position / piece.size();
  patch.axes = PlaneAxes(plane, mean);
  for (const int i : piece) patch.points.push_back(patch.axes.InPlane(search.At(i).position));
  patch.piece = std::move(piece);
  patch.spacing = EstimateSpacing(patch.points, 0.5 * search.options.size.minCoeff());
  const double away = std::max(mean.norm(), 1e-9);
  patch.incidence = std::acos(std::min(1.0, plane.distance / away));
  patch.half = search.HalfSize().array() + search.options.beam_width / 2.0 * away;
  return patch;
}

Eigen::Vector2d SizeOfPiece(const Patch& patch, const BoardOptions& options) {
  const Eigen::Vector2d size = MeasurePiece(patch.points, patch.spacing.At({0.0, 0.0}));
  return options.size.x() >= options.size.y() ? size : size.reverse().eval();
}

double ScatterAmongNeighbours(const BoardSearch& search, const Patch& patch) {
  const std::size_t step = std::max<std::size_t>(patch.points.size() / kNeighbourSamples, 1);
  std::vector<double> scatters;
  for (std::size_t i = 0; i < patch.points.size(); i += step) {
    const double reach = kNeighbourhood * patch.spacing.At(patch.points[i]);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double squares = 0.0;
    int count = 0;
    for (std::size_t k = 0; k < patch.points.size(); ++k) {
      const Eigen::Vector2d away = patch.points[k] - patch.points[i];
      if (away.squaredNorm() > reach * reach) continue;
      const double off = patch.axes.plane.Residual(search.At(patch.piece[k]).position);
      const Eigen::Vector3d row(1.0, away.x() / reach, away.y() / reach);
      normal += row * row.transpose(), right += row * off, squares += off * off, ++count;
    }
    if (count < kLeastNeighbours) continue;
    const double left = squares - right.dot(normal.ldlt().solve(right));
    scatters.push_back(std::sqrt(std::max(left, 0.0) / (count - 3)));
  }
  if (scatters.empty()) return patch.axes.plane.sigma;
  return Median(std::move(scatters));
}

Eigen::Vector2d RoughSize(const BoardSearch& search, const std::vector<int>& piece) {
  Eigen::Vector3d from = search.At(piece.front()).position, to = from;
  double longest = 0.0, least = 0.0, most = 0.0;
  for (int round = 0; round < 2; ++round) {
    std::swap(from, to);
    for (const int i : piece) {
      const double away = (search.At(i).position - from).norm();
      if (away > longest) longest = away, to = search.At(i).position;
    }
  }
  const Eigen::Vector3d along = (to - from).normalized();
  Eigen::Vector3d across = Eigen::Vector3d::Zero();
  for (const int i : piece) {
    const Eigen::Vector3d offset = search.At(i).position - from;
    const Eigen::Vector3d beside = offset - along * along.dot(offset);
    if (across.isZero() && beside.norm() > 0.05 * longest) across = beside.normalized();
    least = std::min(least, across.dot(beside)), most = std::max(most, across.dot(beside));
  }
  return {longest, most - least};
}

double CoreOfPiece(const BoardSearch& search, const std::vector<int>& piece) {
  const PlaneAxes axes(FitPlane(search.window, piece), search.At(piece.front()).position);
  PlanePoints points;
  for (const int i : piece) points.push_back(axes.InPlane(search.At(i).position));
  return CoreArea(points, kCorePixel * search.options.size.norm());
}

}  // namespace atom_core
