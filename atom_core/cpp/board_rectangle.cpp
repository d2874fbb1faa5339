#include "atom_core/board_rectangle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace atom_core {
namespace {

constexpr int kAngles = 45;           // tried over half a turn
constexpr std::size_t kStarts = 4;    // refined
constexpr double kStartsApart = 0.2;  // [rad]
constexpr double kCapShare = 0.15;    // of the shorter half side: a larger misfit is gross
constexpr double kOpenStep = 0.002;   // [m] in which a rectangle is moved, as long as its cost is
constexpr double kMostOpenSteps = 1000.0;  // to the middle of the board
constexpr double kOpenMisfit = 0.004;      // [m] squared more, or
constexpr double kOpenMeans = 2.0;         // mean squares: nothing tells it from the best
constexpr double kCornerShare = 0.08;      // limits as near to a corner say little about a side

Eigen::Vector2d Turned(const Eigen::Vector2d& point, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * point.x() + s * point.y(), -s * point.x() + c * point.y()};
}

// What a pose costs; where that is no less than `enough`, something that is no less.
double Cost(const Outline& outline, const Eigen::Vector2d& half, const RectanglePose& pose,
            double enough) {
  const double cap = kCapShare * half.minCoeff(), most = cap * cap;
  const double c = std::cos(pose.angle), s = std::sin(pose.angle);
  const auto beyond = [&](const Eigen::Vector2d& point) {
    const Eigen::Vector2d p = point - pose.centre;
    return Eigen::Array2d(std::abs(c * p.x() + s * p.y()) - half.x(),
                          std::abs(c * p.y() - s * p.x()) - half.y());
  };
  double cost = 0.0;
  for (const auto& point : outline.limits) {
    const Eigen::Array2d off = beyond(point);
    const double inside = std::min(off.maxCoeff(), 0.0);
    cost += std::min(inside * inside + off.max(0.0).square().sum(), most);
    if (cost >= enough) return cost;
  }
  for (const auto& point : outline.inside) {
    cost += std::min(beyond(point).max(0.0).square().sum(), most);
    if (cost >= enough) return cost;
  }
  for (const auto& point : outline.outside) {
    const double inside = std::min(beyond(point).maxCoeff(), 0.0);
    cost += std::min(inside * inside, most);
    if (cost >= enough) return cost;
  }
  return cost;
}

// The middle, or flush with either end where a part is hidden.
std::array<double, 3> PossibleCentres(std::vector<double> values, double half) {
  std::sort(values.begin(), values.end());
  const std::size_t cut = values.size() / 50;
  const double low = values[cut], high = values[values.size() - 1 - cut];
  return {(low + high) / 2.0, low + half, high - half};
}

std::vector<RectanglePose> Starts(const Outline& outline, const Eigen::Vector2d& half) {
  const PlanePoints& points = outline.inside.empty() ? outline.limits : outline.inside;
  std::vector<RectanglePose> starts;
  for (int i = 0; i < kAngles; ++i) {
    const double angle = M_PI * i / kAngles;
    std::vector<double> x, y;
    for (const auto& point : points) {
      const Eigen::Vector2d turned = Turned(point, angle);
      x.push_back(turned.x());
      y.push_back(turned.y());
    }
    RectanglePose best;
    best.cost = std::numeric_limits<double>::infinity();
    for (const double centre_x : PossibleCentres(x, half.x())) {
      for (const double centre_y : PossibleCentres(y, half.y())) {
        RectanglePose pose{angle, Turned({centre_x, centre_y}, -angle), 0.0};
        pose.cost = Cost(outline, half, pose, best.cost);
        if (pose.cost < best.cost) best = pose;
      }
    }
    starts.push_back(best);
  }
  std::sort(starts.begin(), starts.end(),
            [](const RectanglePose& a, const RectanglePose& b) { return a.cost < b.cost; });
  std::vector<RectanglePose> apart;  // neighbouring angles end in the same minimum
  for (const RectanglePose& start : starts) {
    const bool is_new = std::none_of(apart.begin(), apart.end(), [&](const RectanglePose& other) {
      return std::abs(std::remainder(start.angle - other.angle, M_PI)) < kStartsApart;
    });
    if (is_new) apart.push_back(start);
    if (apart.size() == kStarts) break;
  }
  return apart;
}

// Compass search: a step that lowers the cost is taken, else the steps become shorter.
RectanglePose Refined(const Outline& outline, const Eigen::Vector2d& half, RectanglePose pose) {
  double step = 0.05 * half.minCoeff();
  while (step > 2e-4) {
    bool better = false;
    for (int k = 0; k < 6; ++k) {
      RectanglePose tried = pose;
      const double signed_step = k % 2 == 0 ? step : -step;
      if (k / 2 == 0) {
        tried.angle += signed_step / half.maxCoeff();
      } else {
        const double along = k / 2 == 1 ? 0.0 : M_PI / 2.0;
        tried.centre += Turned({signed_step, 0.0}, -(pose.angle + along));
      }
      tried.cost = Cost(outline, half, tried, pose.cost);
      if (tried.cost < pose.cost) pose = tried, better = true;
    }
    if (!better) step /= 2.0;
  }
  return pose;
}

// How far the rectangle can be moved along a direction of the plane before that costs anything [m].
double OpenTo(const Outline& outline, const Eigen::Vector2d& half, const RectanglePose& pose,
              const Eigen::Vector2d& direction) {
  const double mean = pose.cost / std::max<std::size_t>(outline.limits.size(), 1);
  const double most = pose.cost + std::max(kOpenMisfit * kOpenMisfit, kOpenMeans * mean);
  const double step = std::max(kOpenStep, half.minCoeff() / kMostOpenSteps);
  double moved = 0.0;
  for (; moved < half.minCoeff(); moved += step) {
    RectanglePose tried = pose;
    tried.centre += (moved + step) * direction;
    if (Cost(outline, half, tried, most) >= most) break;
  }
  return moved;
}

}  // namespace

RectanglePose InMiddle(const Outline& outline, const Eigen::Vector2d& half_size,
                       RectanglePose pose) {
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d along = Turned(Eigen::Vector2d::Unit(axis), -pose.angle);
    const double ahead = OpenTo(outline, half_size, pose, along);
    const double back = OpenTo(outline, half_size, pose, -along);
    pose.centre += 0.5 * (ahead - back) * along;
  }
  pose.cost = Cost(outline, half_size, pose, std::numeric_limits<double>::infinity());
  return pose;
}

Eigen::Vector2d RectanglePose::ToBoard(const Eigen::Vector2d& point) const {
  return Turned(point - centre, angle);
}

double SignedDistance(const Eigen::Vector2d& point, const Eigen::Vector2d& half_size) {
  const Eigen::Vector2d beyond = point.cwiseAbs() - half_size;
  if (beyond.maxCoeff() <= 0.0) return beyond.maxCoeff();
  return beyond.cwiseMax(0.0).norm();
}

RectanglePose FitRectangle(const Outline& outline, const Eigen::Vector2d& half_size) {
  RectanglePose best;
  best.cost = std::numeric_limits<double>::infinity();
  if (outline.limits.empty() && outline.inside.empty()) return best;
  for (const RectanglePose& start : Starts(outline, half_size)) {
    const RectanglePose pose = Refined(outline, half_size, start);
    if (pose.cost < best.cost) best = pose;
  }
  return best;
}

Eigen::Vector2d MeasureSize(const PlanePoints& limits, const RectanglePose& pose,
                            const Eigen::Vector2d& half_size, Eigen::Vector2d* sigma, int least) {
  std::array<std::vector<double>, 4> beyond;  // of the sides -x, +x, -y, +y
  for (const auto& point : limits) {
    const Eigen::Vector2d p = pose.ToBoard(point), away = p.cwiseAbs() - half_size;
    const int axis = away.x() > away.y() ? 0 : 1;
    const bool at_corner = away[1 - axis] > -2.0 * kCornerShare * half_size[1 - axis];
    if (std::abs(away[axis]) > 0.25 * half_size.minCoeff() || at_corner) continue;
    beyond[2 * axis + (p[axis] > 0 ? 1 : 0)].push_back(away[axis]);
  }
  Eigen::Vector2d size = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (sigma != nullptr) *sigma = size;
  for (int axis = 0; axis < 2; ++axis) {
    auto &low = beyond[2 * axis], &high = beyond[2 * axis + 1];
    if (static_cast<int>(std::min(low.size(), high.size())) < least) continue;
    size[axis] = 2.0 * half_size[axis];
    double variance = 0.0;  // of the means of both sides
    for (auto* side : {&low, &high}) {
      double mean = 0.0, squares = 0.0;
      for (const double value : *side) mean += value / side->size();
      for (const double value : *side) squares += (value - mean) * (value - mean);
      size[axis] += mean;
      variance += squares / ((side->size() - 1.0) * side->size());
    }
    if (sigma != nullptr) (*sigma)[axis] = std::sqrt(variance);
  }
  return size;
}

}  // namespace atom_core
