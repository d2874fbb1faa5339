#include "atom_core/scan_layers.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "median.h"

namespace atom_core {
namespace {

// What is nearer is the sensor's own housing or invalid [m].
constexpr double kNearestReturn = 0.05;
constexpr double kDegree = M_PI / 180.0;         // [rad]
constexpr double kLeastGap = 0.08 * kDegree;     // between two layers
constexpr double kWidestLayer = 0.35 * kDegree;  // standard deviation of elevations within a layer
constexpr double kWidestShare = 0.2;  // of the distance between layers that were searched
constexpr int kLeastOfLayer = 8;      // points, of these; a few beams at random look like layers
constexpr std::size_t kSearchPoints = 1500;
constexpr std::size_t kMostLayers = 512;
constexpr double kLongestStep = 2.0 * kDegree;  // between neighbours in a layer
constexpr double kSameAzimuth = 1e-6;           // [rad]; two returns of one beam
constexpr std::size_t kStepsOfRun = 12;         // over which an azimuth step is averaged
constexpr double kStrayShare = 0.02;            // of the fullest layer
constexpr double kStrayGaps = 0.6;              // of the gap between layers

using Labels = std::vector<int>;

struct Grouping {
  Labels layer;                                                // of each point
  int count = 0;                                               // number of layers
  Eigen::Vector3d axis;                                        // spin axis
  double deviation = std::numeric_limits<double>::infinity();  // within the layers [rad]
  double apart = std::numeric_limits<double>::infinity();      // layers, where they were searched

  bool Distinct() const {
    const bool full = static_cast<int>(layer.size()) >= kLeastOfLayer * count;
    return count > 1 && deviation < std::min(kWidestLayer, kWidestShare * apart) &&
           (full || std::isinf(apart));
  }
};

std::vector<ScanPoint> ValidPoints(const Eigen::Ref<const PointRows>& cloud) {
  std::vector<ScanPoint> points;
  points.reserve(cloud.rows());
  for (Eigen::Index i = 0; i < cloud.rows(); ++i) {
    ScanPoint point{};
    point.index = i;
    point.position = cloud.row(i).transpose();
    point.range = point.position.norm();
    point.layer = 0;
    if (std::isfinite(point.range) && point.range > kNearestReturn) points.push_back(point);
  }
  return points;
}

// Numbers any labels from 0 on, in their order.
int Renumber(const std::vector<std::int64_t>& names, Labels* layer) {
  std::map<std::int64_t, int> numbers;
  for (const std::int64_t name : names) numbers.emplace(name, 0);
  int next = 0;
  for (auto& item : numbers) item.second = next++;
  layer->resize(names.size());
  std::transform(names.begin(), names.end(), layer->begin(),
                 [&](std::int64_t name) { return numbers[name]; });
  return next;
}

// The axis that keeps a . d most constant within the layers, and how constant.
void FitAxis(const std::vector<ScanPoint>& points, Grouping* grouping) {
  const int count = grouping->count;
  std::vector<Eigen::Vector3d> sum(count, Eigen::Vector3d::Zero());
  std::vector<double> number(count, 0.0);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d direction = points[i].position / points[i].range;
    sum[grouping->layer[i]] += direction;
    number[grouping->layer[i]] += 1.0;
    scatter += direction * direction.transpose();
  }
  for (int k = 0; k < count; ++k) {
    if (number[k] > 0) scatter -= sum[k] * sum[k].transpose() / number[k];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  grouping->axis = solver.eigenvectors().col(0);
  if (grouping->axis.z() < 0) grouping->axis = -grouping->axis;
  grouping->deviation = std::sqrt(std::max(solver.eigenvalues()[0], 0.0) / points.size());
}

Grouping FromNames(const std::vector<ScanPoint>& points, const std::vector<std::int64_t>& names) {
  Grouping grouping;
  grouping.count = Renumber(names, &grouping.layer);
  if (grouping.count > 1 && grouping.count <= static_cast<int>(kMostLayers)) {
    FitAxis(points, &grouping);
  }
  return grouping;
}

std::vector<double> Elevations(const std::vector<ScanPoint>& points, const Eigen::Vector3d& axis) {
  std::vector<double> elevation(points.size());
  std::transform(points.begin(), points.end(), elevation.begin(), [&](const ScanPoint& point) {
    return std::asin(std::max(-1.0, std::min(1.0, axis.dot(point.position) / point.range)));
  });
  return elevation;
}

// A run of elevations without a gap.
struct Run {
  double mean = 0.0;
  int size = 0;
  int layer = 0;
};

// Numbers runs as layers. A few points that stray (noise across the beam shows near the sensor) are
// no layer of their own: they belong to the full layer that is nearer than layers are apart.
int NumberRuns(std::vector<Run>* runs, double* apart) {
  std::vector<double> sizes, gaps;
  for (const Run& run : *runs) sizes.push_back(run.size);
  const double most = kStrayShare * *std::max_element(sizes.begin(), sizes.end());
  std::vector<const Run*> full;
  for (const Run& run : *runs) {
    if (run.size <= most) continue;
    if (!full.empty()) gaps.push_back(run.mean - full.back()->mean);
    full.push_back(&run);
  }
  const double near = gaps.empty() ? 0.0 : kStrayGaps * Median(gaps);
  *apart = gaps.empty() ? 0.0 : Median(gaps);
  int count = 0;
  for (Run& run : *runs) {
    if (run.size > most) run.layer = count++;
  }
  for (Run& run : *runs) {
    if (run.size > most) continue;
    const Run* home = *std::min_element(full.begin(), full.end(), [&](const Run* a, const Run* b) {
      return std::abs(a->mean - run.mean) < std::abs(b->mean - run.mean);
    });
    run.layer = std::abs(home->mean - run.mean) < near ? home->layer : count++;
  }
  return count;
}

// Elevations in narrow bins, lowest first. A gap is wider than a bin, so it never lies within one.
class ElevationBins {
 public:
  explicit ElevationBins(const std::vector<double>& elevation) : bin_(elevation.size()) {
    const auto ends = std::minmax_element(elevation.begin(), elevation.end());
    lowest_ = *ends.first;
    bins_.resize(static_cast<std::size_t>((*ends.second - lowest_) / kLeastGap) + 1);
    for (std::size_t i = 0; i < elevation.size(); ++i) {
      bin_[i] = static_cast<int>((elevation[i] - lowest_) / kLeastGap);
      bins_[bin_[i]].Add(elevation[i]);
    }
  }

  // Returns the runs without a gap, and tells which each elevation belongs to.
  std::vector<Run> Runs(Labels* run) const {
    std::vector<Run> runs;
    std::vector<int> of_bin(bins_.size(), 0);
    double last = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < bins_.size(); ++k) {
      const Bin& bin = bins_[k];
      if (bin.size == 0) continue;
      if (bin.low - last > kLeastGap) runs.emplace_back();
      Run& here = runs.back();
      here.size += bin.size;
      here.mean += (bin.sum - bin.size * here.mean) / here.size;
      of_bin[k] = static_cast<int>(runs.size()) - 1;
      last = bin.high;
    }
    run->resize(bin_.size());
    std::transform(bin_.begin(), bin_.end(), run->begin(), [&](int bin) { return of_bin[bin]; });
    return runs;
  }

 private:
  struct Bin {
    double low = std::numeric_limits<double>::infinity(), high = -low, sum = 0.0;
    int size = 0;
    void Add(double elevation) {
      low = std::min(low, elevation), high = std::max(high, elevation);
      sum += elevation, ++size;
    }
  };

  double lowest_ = 0.0;
  std::vector<int> bin_;  // of each elevation
  std::vector<Bin> bins_;
};

// Groups of elevations with gaps between them.
Grouping FromElevations(const std::vector<ScanPoint>& points, const Eigen::Vector3d& axis) {
  Grouping grouping;
  std::vector<Run> runs = ElevationBins(Elevations(points, axis)).Runs(&grouping.layer);
  grouping.count = NumberRuns(&runs, &grouping.apart);
  for (int& layer : grouping.layer) layer = runs[layer].layer;
  if (grouping.count > 1 && grouping.count <= static_cast<int>(kMostLayers)) {
    FitAxis(points, &grouping);
  }
  return grouping;
}

// How much elevations about an axis pile up: the sum of the squared shares of narrow bins.
double Peakedness(const Eigen::Matrix3Xd& directions, const Eigen::Vector3d& axis, double bin) {
  std::vector<int> histogram(static_cast<std::size_t>(2.0 / bin) + 2, 0);
  const Eigen::RowVectorXd height = axis.transpose() * directions;
  for (Eigen::Index i = 0; i < height.size(); ++i) {
    ++histogram[static_cast<std::size_t>((std::min(std::max(height[i], -1.0), 1.0) + 1.0) / bin)];
  }
  double sum = 0.0;
  for (const int number : histogram) sum += static_cast<double>(number) * number;
  return sum / (static_cast<double>(height.size()) * height.size());
}

Eigen::Matrix3Xd SomeDirections(const std::vector<ScanPoint>& points) {
  const std::size_t step = std::max<std::size_t>(points.size() / kSearchPoints, 1);
  Eigen::Matrix3Xd directions(3, (points.size() + step - 1) / step);
  for (std::size_t i = 0, k = 0; i < points.size(); i += step, ++k) {
    directions.col(k) = points[i].position / points[i].range;
  }
  return directions;
}

// Looks around an axis on a grid that becomes finer, for the most peaked elevations.
Eigen::Vector3d ClimbToPeak(const Eigen::Matrix3Xd& directions, Eigen::Vector3d axis,
                            double reach) {
  for (double step = 0.4 * kDegree; step > 0.02 * kDegree; reach = 2.0 * step, step /= 3.0) {
    const Eigen::Vector3d first = axis.unitOrthogonal(), second = axis.cross(first);
    const int half = static_cast<int>(std::ceil(reach / step));
    Eigen::Vector3d best = axis;
    double most = 0.0;
    for (int i = -half; i <= half; ++i) {
      for (int j = -half; j <= half; ++j) {
        const Eigen::Vector3d tried =
            (axis + std::tan(i * step) * first + std::tan(j * step) * second).normalized();
        const double peak = Peakedness(directions, tried, step);
        if (peak > most) most = peak, best = tried;
      }
    }
    axis = best;
  }
  return axis;
}

// The axis is the sensor's z, x or y, or near the direction in which the scan is thinnest.
Grouping Search(const std::vector<ScanPoint>& points) {
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d::UnitZ().eval(), Eigen::Vector3d::UnitX().eval(),
        Eigen::Vector3d::UnitY().eval()}) {
    Grouping grouping = FromElevations(points, axis);
    if (grouping.Distinct()) return grouping;
  }
  const Eigen::Matrix3Xd directions = SomeDirections(points);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(directions * directions.transpose());
  const Eigen::Vector3d thinnest = solver.eigenvectors().col(0);
  return FromElevations(points, ClimbToPeak(directions, thinnest, 12.0 * kDegree));
}

Grouping Group(const std::vector<ScanPoint>& points, const CloudLayout& layout) {
  std::vector<std::int64_t> names(points.size());
  if (!layout.ring.empty()) {
    for (std::size_t i = 0; i < points.size(); ++i) names[i] = layout.ring[points[i].index];
    Grouping grouping = FromNames(points, names);
    if (grouping.Distinct()) return grouping;
  }
  if (layout.height > 1 && layout.width > 1) {
    // Rows are layers; or columns are; or the driver wrote column after column.
    const std::int64_t width = layout.width, height = layout.height;
    for (const int way : {0, 1, 2}) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const std::int64_t k = points[i].index;
        names[i] = way == 0 ? k / width : way == 1 ? k % width : k % height;
      }
      Grouping grouping = FromNames(points, names);
      if (grouping.Distinct()) return grouping;
    }
  }
  return Search(points);
}

// Orders the layers by elevation and fills in elevation and azimuth of the points.
void Assign(const Grouping& grouping, Scan* scan) {
  const Eigen::Vector3d axis = grouping.axis, first = axis.unitOrthogonal();
  scan->sensor_R_spin << first, axis.cross(first), axis;
  std::vector<double> sum(grouping.count, 0.0), number(grouping.count, 0.0);
  const std::vector<double> elevation = Elevations(scan->points, axis);
  for (std::size_t i = 0; i < elevation.size(); ++i) {
    sum[grouping.layer[i]] += elevation[i];
    number[grouping.layer[i]] += 1.0;
  }
  std::vector<std::pair<double, int>> means;
  for (int k = 0; k < grouping.count; ++k) means.emplace_back(sum[k] / number[k], k);
  std::sort(means.begin(), means.end());
  std::vector<int> rank(grouping.count);
  for (int k = 0; k < grouping.count; ++k) {
    rank[means[k].second] = k;
    scan->layer_elevation.push_back(means[k].first);
  }
  for (std::size_t i = 0; i < elevation.size(); ++i) {
    const Eigen::Vector3d in_spin = scan->sensor_R_spin.transpose() * scan->points[i].position;
    scan->points[i].azimuth = std::atan2(in_spin.y(), in_spin.x());
    scan->points[i].elevation = elevation[i];
    scan->points[i].layer = rank[grouping.layer[i]];
  }
}

void SortByAzimuth(Scan* scan) {
  const std::vector<ScanPoint>& points = scan->points;
  scan->by_azimuth.resize(points.size());
  scan->layer_begin.assign(scan->layer_elevation.size() + 1, 0);
  for (const ScanPoint& point : points) ++scan->layer_begin[point.layer + 1];
  std::partial_sum(scan->layer_begin.begin(), scan->layer_begin.end(), scan->layer_begin.begin());
  std::vector<int> next(scan->layer_begin.begin(), scan->layer_begin.end() - 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    scan->by_azimuth[next[points[i].layer]++] = static_cast<int>(i);
  }
  const auto begin = scan->by_azimuth.begin();
  for (std::size_t k = 0; k + 1 < scan->layer_begin.size(); ++k) {
    std::sort(begin + scan->layer_begin[k], begin + scan->layer_begin[k + 1], [&](int a, int b) {
      return points[a].azimuth != points[b].azimuth ? points[a].azimuth < points[b].azimuth : a < b;
    });
  }
}

// The azimuth step of the fullest layer: the mean over runs of neighbours, not the median of single
// steps: where azimuths jitter (a cloud that was undistorted, say), sorted ones are mostly closer
// than a step. A low quantile over the runs, since some have gaps and none has too many points.
double AzimuthStep(const Scan& scan) {
  std::size_t most = 0;
  for (std::size_t k = 1; k + 1 < scan.layer_begin.size(); ++k) {
    const auto size = [&](std::size_t i) { return scan.layer_begin[i + 1] - scan.layer_begin[i]; };
    if (size(k) > size(most)) most = k;
  }
  std::vector<double> fullest;
  for (int i = scan.layer_begin[most]; i < scan.layer_begin[most + 1]; ++i) {
    fullest.push_back(scan.points[scan.by_azimuth[i]].azimuth);
  }
  const auto same = [](double a, double b) { return b - a <= kSameAzimuth; };
  fullest.erase(std::unique(fullest.begin(), fullest.end(), same), fullest.end());
  const std::size_t run = std::min(kStepsOfRun, std::max<std::size_t>(fullest.size() / 4, 1));
  std::vector<double> steps;
  for (std::size_t i = run; i < fullest.size(); ++i) {
    const double step = (fullest[i] - fullest[i - run]) / run;
    if (step < kLongestStep) steps.push_back(step);
  }
  if (steps.empty()) return kLongestStep;
  const auto low = steps.begin() + steps.size() / 4;
  std::nth_element(steps.begin(), low, steps.end());
  return *low;
}

}  // namespace

Eigen::Vector3d Scan::Direction(double azimuth, double elevation) const {
  const double horizontal = std::cos(elevation);
  return sensor_R_spin * Eigen::Vector3d(horizontal * std::cos(azimuth),
                                         horizontal * std::sin(azimuth), std::sin(elevation));
}

Scan FindLayers(const Eigen::Ref<const PointRows>& cloud, const CloudLayout& layout) {
  const auto size = static_cast<std::size_t>(cloud.rows());
  if (!layout.ring.empty() && layout.ring.size() != size) {
    throw std::invalid_argument("ring must have one entry for each point");
  }
  const std::int64_t rows =
      std::max<std::int64_t>(layout.height, 1);  // times width: may be too large
  if (rows > 1 && (cloud.rows() % rows != 0 || cloud.rows() / rows != layout.width)) {
    throw std::invalid_argument("width * height must be the number of points");
  }
  Scan scan;
  scan.sensor_R_spin.setIdentity();
  scan.points = ValidPoints(cloud);
  if (scan.points.empty()) return scan;
  Grouping grouping = Group(scan.points, layout);
  scan.has_layers = grouping.Distinct();
  if (!scan.has_layers) return scan;
  Assign(grouping, &scan);
  SortByAzimuth(&scan);
  scan.azimuth_step = AzimuthStep(scan);
  return scan;
}

}  // namespace atom_core
