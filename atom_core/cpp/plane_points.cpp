#include "plane_points.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "disjoint_sets.h"
#include "median.h"

namespace atom_core {
namespace {

constexpr std::size_t kSamples = 64;  // at which the spacing is measured
constexpr double kPointsOfCell = 3.0;
constexpr double kMedianGap = 1.25;         // of the fourth of eight gaps, in spacings
constexpr double kSteepest = 1.4;           // of the logarithm of the spacing, over the reach
constexpr std::size_t kLeastForSlope = 30;  // samples
constexpr double kPixelShare = 0.02;        // of the board's diagonal
constexpr double kLinkSpacings = 2.0;       // points as near hang together
constexpr double kLinkCell = 0.25;          // of the longest link
constexpr double kLinkShare = 0.05;         // of the board's shorter side: so do these
constexpr double kTrimmed = 0.01;           // of the points at each end of a box
constexpr std::size_t kMostMeasured = 500;  // points of a box
constexpr std::size_t kBoxAngles = 45;

// Squares that points of a plane lie in, numbered row by row over their extent.
class Squares {
 public:
  Squares(const PlanePoints& points, double side) : side_(side) {
    if (points.empty()) return;
    Eigen::Vector2d low = points.front(), high = low;
    for (const Eigen::Vector2d& point : points) {
      low = low.cwiseMin(point), high = high.cwiseMax(point);
    }
    low_ = (low / side).array().floor();
    const Eigen::Array2d count = (high / side).array().floor() - low_ + 1.0;
    columns_ = static_cast<std::size_t>(count.x());
    count_ = columns_ * static_cast<std::size_t>(count.y());
  }

  std::size_t count() const { return count_; }
  std::size_t columns() const { return columns_; }
  std::size_t Of(const Eigen::Vector2d& point) const {
    const Eigen::Array2d place = (point / side_).array().floor() - low_;
    return static_cast<std::size_t>(place.y()) * columns_ + static_cast<std::size_t>(place.x());
  }

 private:
  double side_;
  Eigen::Array2d low_ = Eigen::Array2d::Zero();
  std::size_t columns_ = 0, count_ = 0;
};

int Octant(const Eigen::Vector2d& v) {
  const int quadrant = (v.x() < 0 ? 1 : 0) + (v.y() < 0 ? 2 : 0);
  return 2 * quadrant + (std::abs(v.x()) > std::abs(v.y()) ? 1 : 0);
}

// Points of a plane in square cells, row by row.
class PlaneGrid {
 public:
  PlaneGrid(const PlanePoints& points, double reach, double side = 0.0) : points_(points) {
    Eigen::Vector2d high = points.front();
    low_ = high;
    for (const Eigen::Vector2d& point : points) {
      low_ = low_.cwiseMin(point), high = high.cwiseMax(point);
    }
    const Eigen::Vector2d size = (high - low_).array() + 1e-6;
    if (side == 0.0) side = std::sqrt(kPointsOfCell * size.prod() / points.size());
    cell_ = std::max(side, size.maxCoeff() / 500);
    cell_ = std::min(cell_, reach);
    columns_ = static_cast<int>(size.x() / cell_) + 1;
    rows_ = static_cast<int>(size.y() / cell_) + 1;
    first_.assign(static_cast<std::size_t>(columns_) * rows_ + 1, 0);
    std::vector<int> cell(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) ++first_[1 + (cell[i] = CellOf(points[i]))];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<int> next(first_.begin(), first_.end() - 1);
    order_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) order_[next[cell[i]]++] = static_cast<int>(i);
  }

  double cell() const { return cell_; }
  // Calls with each point in the cells that are `ring` cells away from that of a place.
  template <typename Call>
  void OnRing(const Eigen::Vector2d& at, int ring, const Call& call) const {
    const int column = Column(at), row = Row(at);
    for (int y = std::max(row - ring, 0); y <= std::min(row + ring, rows_ - 1); ++y) {
      const bool whole = std::abs(y - row) == ring;
      for (int x = column - ring; x <= column + ring; x += whole ? 1 : std::max(2 * ring, 1)) {
        if (x < 0 || x >= columns_) continue;
        const std::size_t cell = static_cast<std::size_t>(y) * columns_ + x;
        for (int k = first_[cell]; k < first_[cell + 1]; ++k) call(points_[order_[k]]);
      }
    }
  }
  // Calls with the number of each point in the cells that are nearer to a place than a reach.
  template <typename Call>
  void Around(const Eigen::Vector2d& at, double reach, const Call& call) const {
    const Eigen::Vector2d wide = Eigen::Vector2d::Constant(reach);
    const Eigen::Vector2d from = (at - wide).cwiseMax(low_), to = at + wide;
    for (int y = Row(from); y <= std::min(Row(to), rows_ - 1); ++y) {
      const std::size_t row = static_cast<std::size_t>(y) * columns_;
      const int end = first_[row + std::min(Column(to), columns_ - 1) + 1];
      for (int k = first_[row + Column(from)]; k < end; ++k) call(order_[k]);
    }
  }

 private:
  int Column(const Eigen::Vector2d& p) const {
    return static_cast<int>((p.x() - low_.x()) / cell_);
  }
  int Row(const Eigen::Vector2d& p) const { return static_cast<int>((p.y() - low_.y()) / cell_); }
  int CellOf(const Eigen::Vector2d& p) const { return Row(p) * columns_ + Column(p); }

  const PlanePoints& points_;
  Eigen::Vector2d low_;
  double cell_;
  int columns_, rows_;
  std::vector<int> first_, order_;
};

// The fourth shortest of the gaps to the nearest points in eight directions: along lines of points
// two are short, at an edge of the plane four are open.
double GapAt(const PlaneGrid& grid, const Eigen::Vector2d& at, double reach) {
  std::array<double, 8> gap, sorted;
  gap.fill(reach * reach);
  sorted.fill(reach * reach);
  for (int ring = 0; (ring - 1) * grid.cell() < reach; ++ring) {
    grid.OnRing(at, ring, [&](const Eigen::Vector2d& point) {
      const Eigen::Vector2d away = point - at;
      const double squared = away.squaredNorm();
      double& nearest = gap[Octant(away)];
      if (squared > 1e-12 && squared < nearest) nearest = squared;
    });
    sorted = gap;
    std::nth_element(sorted.begin(), sorted.begin() + 3, sorted.end());
    if (std::sqrt(sorted[3]) <= ring * grid.cell()) break;
  }
  return std::sqrt(sorted[3]);
}

// The slope of log gaps over the plane, from samples that are not far from the median.
void FitSlope(const PlanePoints& places, const std::vector<double>& logs, double reach,
              Spacing* spacing) {
  const double middle = Median(logs);
  Eigen::Matrix3d normal = 1e-6 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (std::abs(logs[i] - middle) > 0.7) continue;
    const Eigen::Vector3d row(1.0, places[i].x(), places[i].y());
    normal += row * row.transpose();
    right += row * logs[i];
  }
  const Eigen::Vector3d solution = normal.ldlt().solve(right);
  const double steepness = solution.tail<2>().norm() * reach;
  if (steepness > kSteepest) return;
  spacing->level = solution[0];
  spacing->slope = solution.tail<2>();
}

// The number of the piece of each point: roots of a forest of points that are linked.
std::vector<int> Linked(const PlanePoints& points, const Spacing& spacing, double least) {
  std::vector<double> link(points.size());
  double longest = least;
  for (std::size_t i = 0; i < points.size(); ++i) {
    link[i] = std::max(kLinkSpacings * spacing.At(points[i]), least);
    longest = std::max(longest, link[i]);
  }
  const PlaneGrid grid(points, longest, kLinkCell * longest);
  std::vector<int> parent(points.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double squared = link[i] * link[i];
    grid.Around(points[i], link[i], [&](int k) {
      if (k < static_cast<int>(i) && (points[k] - points[i]).squaredNorm() < squared) {
        Unite(&parent, i, k);
      }
    });
  }
  for (std::size_t i = 0; i < points.size(); ++i) parent[i] = FindRoot(&parent, i);
  return parent;
}

double Extent(std::vector<double> values) {
  const std::size_t cut = static_cast<std::size_t>(kTrimmed * values.size());
  std::nth_element(values.begin(), values.begin() + cut, values.end());
  const double low = values[cut];
  std::nth_element(values.begin(), values.end() - 1 - cut, values.end());
  return *(values.end() - 1 - cut) - low;
}

}  // namespace

PlaneAxes::PlaneAxes(const Plane& of, const Eigen::Vector3d& near) : plane(of) {
  origin = near - plane.normal * plane.Residual(near);
  axes.col(0) = plane.normal.unitOrthogonal();
  axes.col(1) = plane.normal.cross(axes.col(0));
  axes.col(2) = plane.normal;
}

Spacing EstimateSpacing(const PlanePoints& points, double reach) {
  const std::size_t step = std::max<std::size_t>(points.size() / kSamples, 1);
  PlanePoints places;
  std::vector<double> logs;
  const PlaneGrid grid(points, reach);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const double gap = GapAt(grid, points[i], reach);
    places.push_back(points[i]);
    logs.push_back(std::log(std::max(gap, 1e-3) / kMedianGap));
  }
  Spacing spacing;
  spacing.level = logs.empty() ? std::log(reach) : Median(logs);
  if (logs.size() >= kLeastForSlope) FitSlope(places, logs, reach, &spacing);
  return spacing;
}

std::vector<int> Thinned(const PlanePoints& points, double pixel) {
  const Squares squares(points, pixel);
  std::vector<bool> taken(squares.count(), false);
  std::vector<int> kept;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t square = squares.Of(points[i]);
    if (taken[square]) continue;
    taken[square] = true;
    kept.push_back(static_cast<int>(i));
  }
  return kept;
}

double CoreArea(const PlanePoints& points, double pixel) {
  const Squares squares(points, pixel);
  std::vector<bool> filled(squares.count(), false);
  for (const Eigen::Vector2d& point : points) filled[squares.Of(point)] = true;
  const std::size_t row = squares.columns();
  std::size_t core = 0;
  for (std::size_t i = row; i + row < filled.size(); ++i) {
    const std::size_t column = i % row;
    if (column == 0 || column + 1 == row) continue;
    core += filled[i] && filled[i - 1] && filled[i + 1] && filled[i - row] && filled[i + row];
  }
  return core * pixel * pixel;
}

std::vector<int> InliersOf(const Window& window, const PlaneAxes& axes, double threshold,
                           double cell) {
  std::vector<int> inliers;
  PlanePoints beside;                  // of inliers and of what is right behind them
  std::vector<std::size_t> of_behind;  // of these
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    const double off = axes.plane.Residual(window.At(i).position);
    if (off <= -threshold || off >= threshold + kRightBehind) continue;
    if (off < threshold) {
      inliers.push_back(static_cast<int>(i));
    } else {
      of_behind.push_back(beside.size());
    }
    beside.push_back(axes.InPlane(window.At(i).position));
  }
  if (of_behind.empty()) return inliers;
  const Squares squares(beside, cell);
  std::vector<int> excess(squares.count(), 0);  // of returns behind the plane, by square
  std::vector<std::size_t> square;              // of the inliers
  auto behind = of_behind.begin();
  for (std::size_t i = 0; i < beside.size(); ++i) {
    const std::size_t here = squares.Of(beside[i]);
    if (behind != of_behind.end() && *behind == i) {
      ++excess[here], ++behind;
    } else {
      --excess[here], square.push_back(here);
    }
  }
  std::vector<int> kept;
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    if (excess[square[i]] <= 0) kept.push_back(inliers[i]);
  }
  return kept;
}

std::vector<std::vector<int>> ConnectedPieces(const Window& window, const std::vector<int>& inliers,
                                              const PlaneAxes& axes, const Eigen::Vector2d& size) {
  const double pixel = kPixelShare * size.norm();
  PlanePoints points, thin;
  for (const int i : inliers) points.push_back(axes.InPlane(window.At(i).position));
  const Squares squares(points, pixel);
  std::vector<int> place(squares.count(), -1);  // of each square among the thinned points
  std::vector<int> of(inliers.size());
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    int& here = place[squares.Of(points[i])];
    if (here < 0) here = static_cast<int>(thin.size()), thin.push_back(points[i]);
    of[i] = here;
  }
  std::vector<std::vector<int>> pieces;
  if (thin.size() < 3) return pieces;
  const Spacing spacing = EstimateSpacing(thin, 0.5 * size.minCoeff());
  const std::vector<int> root = Linked(thin, spacing, kLinkShare * size.minCoeff());
  std::vector<int> number(thin.size(), -1);  // of the piece of each root
  for (std::size_t i = 0; i < inliers.size(); ++i) {
    int& piece = number[root[of[i]]];
    if (piece < 0) piece = static_cast<int>(pieces.size()), pieces.emplace_back();
    pieces[piece].push_back(inliers[i]);
  }
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return pieces;
}

Eigen::Vector2d MeasurePiece(const PlanePoints& points, double spacing, double* turn) {
  const std::size_t step = std::max<std::size_t>(points.size() / kMostMeasured, 1);
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> x, y;
  for (std::size_t k = 0; k < kBoxAngles; ++k) {
    const double angle = M_PI / 2.0 * k / kBoxAngles, c = std::cos(angle), s = std::sin(angle);
    x.clear(), y.clear();
    for (std::size_t i = 0; i < points.size(); i += step) {
      x.push_back(c * points[i].x() + s * points[i].y());
      y.push_back(-s * points[i].x() + c * points[i].y());
    }
    const Eigen::Vector2d box(Extent(x), Extent(y));
    if (box.prod() < least) {
      least = box.prod(), best = box;
      if (turn != nullptr) *turn = angle;
    }
  }
  // What was trimmed at both ends, and half a spacing beyond the outermost points.
  best = best / (1.0 - 2.0 * kTrimmed) + Eigen::Vector2d::Constant(spacing);
  return {best.maxCoeff(), best.minCoeff()};
}

}  // namespace atom_core
