#include "rectangle_sides.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace atom_core {
namespace {

constexpr int kRounds = 8;
constexpr double kBinSpacings = 2.0;    // width of a bin
constexpr double kShortSpacings = 2.5;  // and
constexpr double kShort = 0.02;         // [m] inside: the bin does not reach the side
constexpr double kOpenSpacings = 1.0;   // and
constexpr double kOpen = 0.012;         // [m] outside: the surface goes on
constexpr double kReachSpacings = 3.0;  // and
constexpr double kReach = 0.05;         // [m] outside: as far as is looked
constexpr double kSure = 1.5;           // standard deviations, before a wall
constexpr int kTouching = 2;            // returns
constexpr int kLeastBins = 3;           // of a side that is measured
constexpr std::size_t kMostBins = 200;
constexpr int kLines = 6;             // drawn through the board on each side of its middle
constexpr double kLinesApart = 0.13;  // of half a side
constexpr int kLeastInsets = 10;      // that are averaged
constexpr int kSamplingRounds = 3;
constexpr double kMuchWider = 1.15;  // gaps than the spacing
constexpr double kScattered = 3.0;   // variances of bins that are not alike, in squared insets
constexpr double kSettled = 1e-5;    // [m]

struct Side {
  int axis;
  double sign;
};
constexpr Side kSides[4] = {{0, 1.0}, {0, -1.0}, {1, 1.0}, {1, -1.0}};

Eigen::Vector2d OnSide(const Side& side, double along, double half) {
  Eigen::Vector2d point;
  point[side.axis] = side.sign * half;
  point[1 - side.axis] = along;
  return point;
}

Eigen::Vector2d ToPlane(const RectanglePose& pose, const Eigen::Vector2d& point) {
  return pose.centre + Eigen::Rotation2Dd(pose.angle) * point;
}

std::vector<SideBin> EmptyBins(const Side& side, const RectanglePose& pose,
                               const Eigen::Vector2d& half, const Sampling& sampling) {
  const Spacing& spacing = sampling.spacing;
  const double length = 2.0 * half[1 - side.axis];
  const double middle = spacing.At(ToPlane(pose, OnSide(side, 0.0, half[side.axis])));
  const auto wanted = static_cast<std::size_t>(length / (kBinSpacings * middle));
  std::vector<SideBin> bins(std::min(std::max<std::size_t>(wanted, kLeastBins), kMostBins));
  const double width = length / bins.size();
  for (std::size_t k = 0; k < bins.size(); ++k) {
    SideBin& bin = bins[k];
    bin.along = -length / 2.0 + (k + 0.5) * width;
    const Eigen::Vector2d place = ToPlane(pose, OnSide(side, bin.along, half[side.axis]));
    bin.spacing = spacing.At(place);
    bin.in_view = sampling.view.Sees(place);
    bin.inset = sampling.inset[side.axis] * bin.spacing;
  }
  return bins;
}

// The outermost point that a wall right behind does not scatter into the plane.
struct Sure {
  double beyond = -1e9;
  int outermost = -1;
};

void Add(int i, double beyond, double off, double sigma, SideBin* bin, Sure* sure) {
  const double s = bin->spacing;
  if (beyond < -kShortSpacings * s - kShort || beyond > kReachSpacings * s + kReach) return;
  if (std::abs(off) > kThreshold * sigma) {
    const bool near = std::abs(off) < kThreshold * sigma + 2.0 * s + 0.02;
    if (near && beyond > -s && beyond < 2.0 * s) ++(off < 0.0 ? bin->touching : bin->behind);
    return;
  }
  if (off < kSure * sigma && beyond > sure->beyond && beyond < kOpenSpacings * s + kOpen) {
    sure->beyond = beyond, sure->outermost = i;
  }
  if (beyond > kOpenSpacings * s + kOpen) {
    ++bin->open;
  } else if (beyond > bin->beyond) {
    bin->beyond = beyond;
    bin->outermost = i;
  }
}

// The mean distance of outermost points from a line along a side, drawn so far inside [spacings];
// adds to sum and count.
void AddInsets(const std::vector<PlaneReturn>& inside, const Side& side, double level,
               std::vector<SideBin> bins, double length, double* sum, int* count) {
  for (const PlaneReturn& item : inside) {
    const double place = item.position[1 - side.axis] / length + 0.5;
    const double beyond = side.sign * item.position[side.axis] - level;
    if (place < 0.0 || place >= 1.0 || beyond > 0.0) continue;
    SideBin& bin = bins[static_cast<std::size_t>(place * bins.size())];
    bin.beyond = std::max(bin.beyond, beyond);
  }
  for (const SideBin& bin : bins) {
    if (bin.beyond < -kShortSpacings * bin.spacing - kShort / 2.0) continue;
    *sum -= bin.beyond / bin.spacing;
    ++*count;
  }
}

Eigen::Vector2d MeanInsets(const std::vector<PlaneReturn>& inside, const RectanglePose& pose,
                           const Eigen::Vector2d& half, const Sampling& sampling) {
  Eigen::Vector2d inset = sampling.inset;
  for (int axis = 0; axis < 2; ++axis) {
    double sum = 0.0;
    int count = 0;
    for (const int k : {2 * axis, 2 * axis + 1}) {
      const std::vector<SideBin> bins = EmptyBins(kSides[k], pose, half, sampling);
      for (int line = 1; line <= kLines; ++line) {
        const double level = half[axis] * (1.0 - line * kLinesApart);
        AddInsets(inside, kSides[k], level, bins, 2.0 * half[1 - axis], &sum, &count);
      }
    }
    if (count >= kLeastInsets) inset[axis] = std::min(std::max(sum / count, 0.1), 1.2);
  }
  return inset;
}

// One step of robust least squares; its size [m].
double Step(const Sides& sides, const Eigen::Vector2d& half, RectanglePose* pose) {
  Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (int k = 0; k < 4; ++k) {
    const Side& side = kSides[k];
    for (const SideBin& bin : sides[k]) {
      if (!bin.OnBorder()) continue;
      const double error = bin.beyond + bin.inset, scale = 0.5 * bin.spacing + 0.002;
      const double weight = 1.0 / (1.0 + error * error / (scale * scale)) / (scale * scale);
      Eigen::Vector3d row = Eigen::Vector3d::Zero();
      row[side.axis] = -side.sign;
      row[2] = side.axis == 0 ? side.sign * bin.along : -side.sign * bin.along;
      normal += weight * row * row.transpose();
      right -= weight * row * error;
    }
  }
  const Eigen::Vector3d step = normal.ldlt().solve(right);
  if (!step.allFinite()) return 0.0;
  pose->centre += Eigen::Rotation2Dd(pose->angle) * step.head<2>().eval();
  pose->angle += step[2];
  return step.head<2>().norm() + std::abs(step[2]) * half.maxCoeff();
}

}  // namespace

bool SideBin::OnBorder() const {
  return outermost >= 0 && in_view && !GoesOn() && touching < kTouching && !hidden;
}

Sampling MeasureSampling(const std::vector<PlaneReturn>& returns, const RectanglePose& pose,
                         const Eigen::Vector2d& half, const Spacing& spacing, double sigma,
                         const View& view) {
  std::vector<PlaneReturn> inside;
  for (const PlaneReturn& item : returns) {
    const Eigen::Vector2d point = pose.ToBoard(item.position);
    if (std::abs(item.off) < kThreshold * sigma && SignedDistance(point, half) < 0.0) {
      inside.push_back({point, item.off, item.near});
    }
  }
  Sampling sampling;
  sampling.spacing = spacing;
  sampling.sigma = sigma;
  sampling.view = view;
  for (int round = 0; round < kSamplingRounds; ++round) {
    sampling.inset = MeanInsets(inside, pose, half, sampling);
    const double wider = 2.0 * sampling.inset.maxCoeff();
    if (wider < kMuchWider) break;
    sampling.spacing.level += std::log(wider);
    sampling.inset /= wider;
  }
  return sampling;
}

Sides LookAlongSides(const std::vector<PlaneReturn>& returns, const RectanglePose& pose,
                     const Eigen::Vector2d& half, const Sampling& sampling) {
  Sides sides;
  std::array<std::vector<Sure>, 4> sure;
  for (int k = 0; k < 4; ++k) {
    sides[k] = EmptyBins(kSides[k], pose, half, sampling);
    sure[k].resize(sides[k].size());
  }
  for (std::size_t i = 0; i < returns.size(); ++i) {
    const Eigen::Vector2d point = pose.ToBoard(returns[i].position);
    for (int k = 0; k < 4; ++k) {
      const Side& side = kSides[k];
      const double length = 2.0 * half[1 - side.axis];
      const double place = (point[1 - side.axis] + length / 2.0) / length;
      if (place < 0.0 || place >= 1.0) continue;
      const auto at = static_cast<std::size_t>(place * sides[k].size());
      const double beyond = side.sign * point[side.axis] - half[side.axis];
      Add(static_cast<int>(i), beyond, returns[i].off, sampling.sigma, &sides[k][at], &sure[k][at]);
    }
  }
  for (int k = 0; k < 4; ++k) {
    for (std::size_t at = 0; at < sides[k].size(); ++at) {
      SideBin& bin = sides[k][at];
      if (bin.behind < kTouching) continue;
      bin.beyond = sure[k][at].beyond, bin.outermost = sure[k][at].outermost;
    }
  }
  return sides;
}

RectanglePose RefineBySides(const std::vector<PlaneReturn>& returns, RectanglePose pose,
                            const Eigen::Vector2d& half, const Sampling& sampling) {
  for (int round = 0; round < kRounds; ++round) {
    const Sides sides = LookAlongSides(returns, pose, half, sampling);
    if (Step(sides, half, &pose) < kSettled) break;
  }
  return pose;
}

MeasuredSize MeasureSides(const Sides& sides, const Eigen::Vector2d& half) {
  MeasuredSize measured;
  for (int axis = 0; axis < 2; ++axis) {
    measured.size[axis] = 2.0 * half[axis];
    double variance = 0.0;
    for (int k = 2 * axis; k < 2 * axis + 2; ++k) {
      std::vector<double> edges;
      double mean = 0.0, squares = 0.0;
      for (const SideBin& bin : sides[k]) {
        if (bin.OnBorder()) edges.push_back(bin.beyond + bin.inset);
      }
      if (static_cast<int>(edges.size()) < kLeastBins) {
        variance = measured.size[axis] = std::numeric_limits<double>::quiet_NaN();
        break;
      }
      for (const double edge : edges) mean += edge / edges.size();
      for (const double edge : edges) squares += (edge - mean) * (edge - mean);
      measured.size[axis] += mean;
      // Rows along a side are as far inside in all bins: their phase counts once.
      const double phase = sides[k].front().inset, own = squares / edges.size();
      const double alike = std::max(0.0, 1.0 - kScattered * own / (phase * phase));
      variance += own / edges.size() + alike * phase * phase / 3.0;
    }
    measured.sigma[axis] = std::sqrt(variance);
  }
  return measured;
}

double TouchMargin(const SideBin& bin, double sigma) {
  return bin.touching >= kTouching ? kThreshold * sigma + 0.5 * bin.spacing : 0.0;
}

}  // namespace atom_core
