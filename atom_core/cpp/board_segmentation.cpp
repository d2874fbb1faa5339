#include "atom_core/board_segmentation.h"

#include <pcl/console/print.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "atom_core/board_rectangle.h"

namespace atom_core {
namespace {

constexpr int kPlanes = 8;  // proposed around a seed
constexpr int kRansacIterations = 400;
constexpr double kThreshold = 3.0;       // standard deviations of inliers
constexpr double kTrusted = 1.5;         // standard deviations of returns at the border
constexpr double kLeastSigma = 0.002;    // [m] below, rounding and the board's own flatness count
constexpr double kLeastCosine = 0.14;    // of the incidence, 82 degrees
constexpr double kDropoutSteps = 4.5;    // of azimuth without a return that a run bridges
constexpr double kNeighbourSteps = 3.5;  // within which a return is beside a limit point
constexpr double kSurfaceShare = 0.03;   // of the range, between neighbours on one surface
constexpr double kApart = 4.0;           // standard deviations of ranges of something else, but
constexpr double kLeastApart = 0.03;     // [m] at least
constexpr double kConfidence = 0.9999;   // of RANSAC
constexpr double kProposal = 2.0;        // standard deviations of its inliers
constexpr int kRefits = 6;
constexpr double kStripShare = 0.5;   // of the shorter half side: gaps that a run bridges
constexpr double kBorderShare = 0.7;  // of the layers' ends that must lie on the border

// A return near the seed; azimuth counted from the seed's.
struct Near {
  const ScanPoint* point;
  double azimuth;
};

// The returns around a board, layer by layer, by azimuth.
struct Window {
  std::vector<Near> points;
  std::vector<int> sphere;  // positions in points of those around the seed
};

double Wrapped(double angle) { return std::remainder(angle, 2.0 * M_PI); }

double Azimuth(const Scan& scan, const Eigen::Vector3d& position) {
  const Eigen::Vector3d in_spin = scan.sensor_R_spin.transpose() * position;
  return std::atan2(in_spin.y(), in_spin.x());
}

Window CutWindow(const Scan& scan, const Eigen::Vector3d& seed, const BoardOptions& options) {
  const double sphere = SeedRadius(options), radius = sphere + options.size.norm();
  const double distance = seed.norm(), seed_azimuth = Azimuth(scan, seed);
  // The cone about the seed's direction that the ball of the window fills.
  const double sine = std::min(radius / std::max(distance, 1e-9), 1.0);
  const double cosine = sine < 1.0 ? std::sqrt(1.0 - sine * sine) : -1.0;
  Window window;
  for (const ScanPoint& point : scan.points) {
    if (point.position.dot(seed) < cosine * distance * point.range) continue;
    window.points.push_back({&point, Wrapped(point.azimuth - seed_azimuth)});
  }
  std::sort(window.points.begin(), window.points.end(), [](const Near& a, const Near& b) {
    if (a.point->layer != b.point->layer) return a.point->layer < b.point->layer;
    return a.azimuth != b.azimuth ? a.azimuth < b.azimuth : a.point->index < b.point->index;
  });
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    if ((window.points[i].point->position - seed).norm() < sphere) window.sphere.push_back(i);
  }
  return window;
}

// n . p = distance with n pointing away from the sensor.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double distance = 0.0;

  double sigma = 0.01;  // standard deviation of the returns about it [m]

  double Residual(const Eigen::Vector3d& point) const { return normal.dot(point) - distance; }
  bool Holds(const ScanPoint& point) const {
    return std::abs(Residual(point.position)) < kThreshold * sigma;
  }
  // 1 for a return clearly behind the plane, along its beam, -1 for one clearly before it.
  int Side(const ScanPoint& point) const {
    const double cosine = normal.dot(point.position) / point.range;
    if (cosine < 1e-3) return -1;  // the beam does not meet the plane
    const double beyond = point.range - distance / cosine;
    const double apart = std::max(kLeastApart, kApart * sigma / cosine);
    return beyond > apart ? 1 : beyond < -apart ? -1 : 0;
  }
};

// Standard deviation about a plane, from the median of the residuals' sizes.
double RobustSigma(const Window& window, const std::vector<int>& chosen, const Plane& plane) {
  std::vector<double> sizes;
  for (const int i : chosen) {
    sizes.push_back(std::abs(plane.Residual(window.points[i].point->position)));
  }
  std::nth_element(sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
  return std::max(1.4826 * sizes[sizes.size() / 2], kLeastSigma);
}

Plane FitPlane(const Window& window, const std::vector<int>& chosen) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int i : chosen) mean += window.points[i].point->position;
  mean /= chosen.size();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const int i : chosen) {
    const Eigen::Vector3d offset = window.points[i].point->position - mean;
    scatter += offset * offset.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  Plane plane;
  plane.normal = solver.eigenvectors().col(0);
  plane.distance = plane.normal.dot(mean);
  if (plane.distance < 0) plane.normal = -plane.normal, plane.distance = -plane.distance;
  plane.sigma = RobustSigma(window, chosen, plane);
  return plane;
}

// PCL's plane, without those that pass near the sensor: every single layer is nearly such a plane.
class FacingPlane : public pcl::SampleConsensusModelPlane<pcl::PointXYZ> {
 public:
  FacingPlane(const pcl::PointCloud<pcl::PointXYZ>::ConstPtr& cloud, double least_distance)
      : pcl::SampleConsensusModelPlane<pcl::PointXYZ>(cloud), least_distance_(least_distance) {}

  bool computeModelCoefficients(const std::vector<int>& samples,
                                Eigen::VectorXf& coefficients) const override {
    using Base = pcl::SampleConsensusModelPlane<pcl::PointXYZ>;
    return Base::computeModelCoefficients(samples, coefficients) &&
           std::abs(coefficients[3]) >= least_distance_;
  }

  bool isSampleGood(const std::vector<int>& samples) const override {  // PCL's own complains aloud
    const Eigen::Vector3f first = (*input_)[samples[0]].getVector3fMap();
    const Eigen::Vector3f a = (*input_)[samples[1]].getVector3fMap() - first;
    const Eigen::Vector3f b = (*input_)[samples[2]].getVector3fMap() - first;
    return a.cross(b).norm() > 1e-4f;  // [m^2]
  }

 private:
  double least_distance_;
};

std::vector<int> OnPlane(const Window& window, const std::vector<int>& among, const Plane& plane,
                         double threshold) {
  std::vector<int> chosen;
  for (const int i : among) {
    if (std::abs(plane.Residual(window.points[i].point->position)) < threshold) chosen.push_back(i);
  }
  return chosen;
}

// The plane with the most points among those given, refit to them; false if there is none.
bool ProposePlane(const Window& window, const std::vector<int>& among, double threshold,
                  double least_distance, Plane* plane) {
  if (among.size() < 3) return false;
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const int i : among) {
    const Eigen::Vector3f p = window.points[i].point->position.cast<float>();
    cloud->push_back(pcl::PointXYZ(p.x(), p.y(), p.z()));
  }
  const FacingPlane::Ptr model(new FacingPlane(cloud, least_distance));
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, threshold);
  ransac.setMaxIterations(kRansacIterations);
  ransac.setProbability(kConfidence);
  const auto verbosity = pcl::console::getVerbosityLevel();
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);  // "no model" is no error here
  const bool found = ransac.computeModel();
  pcl::console::setVerbosityLevel(verbosity);
  if (!found) return false;
  Eigen::VectorXf c;
  ransac.getModelCoefficients(c);
  plane->normal = c.head<3>().cast<double>().normalized();
  plane->distance = -c[3];
  if (plane->distance < 0) plane->normal = -plane->normal, plane->distance = -plane->distance;
  for (int k = 0; k < 3; ++k) {
    const std::vector<int> chosen = OnPlane(window, among, *plane, threshold);
    if (chosen.size() < 3) break;
    const Plane refit = FitPlane(window, chosen);
    if (refit.distance < least_distance) break;
    *plane = refit;
  }
  return true;
}

// Neighbouring inliers of one layer, first and last position in the window.
struct Run {
  int layer, first, last;
  double from, to;  // azimuths
};

// Tells whether the plane may go on between two inliers of a layer.
bool Continues(const Scan& scan, const Window& window, int i, int j, const Plane& plane,
               double reach) {
  const Near &a = window.points[i], &b = window.points[j];
  if ((a.point->position - b.point->position).norm() > reach) return false;
  bool hidden = false;
  for (int k = i + 1; k < j; ++k) {
    const int side = plane.Side(*window.points[k].point);
    if (side > 0) return false;
    hidden = hidden || side < 0;
  }
  return hidden || b.azimuth - a.azimuth <= kDropoutSteps * scan.azimuth_step;
}

std::vector<Run> FindRuns(const Scan& scan, const Window& window, const std::vector<int>& inliers,
                          const Plane& plane, double reach) {
  std::vector<Run> runs;
  for (const int i : inliers) {
    const Near& near = window.points[i];
    if (!runs.empty() && runs.back().layer == near.point->layer &&
        Continues(scan, window, runs.back().last, i, plane, reach)) {
      runs.back().last = i;
      runs.back().to = near.azimuth;
    } else {
      runs.push_back({near.point->layer, i, i, near.azimuth, near.azimuth});
    }
  }
  return runs;
}

int Root(std::vector<int>* parent, int i) {
  while ((*parent)[i] != i) i = (*parent)[i] = (*parent)[(*parent)[i]];
  return i;
}

// Pieces of a plane: inliers whose runs overlap from one layer to the next. Larger pieces first.
std::vector<std::vector<int>> FindPieces(const Scan& scan, const Window& window,
                                         const std::vector<int>& inliers, const Plane& plane,
                                         double reach) {
  const std::vector<Run> runs = FindRuns(scan, window, inliers, plane, reach);
  std::vector<int> parent(runs.size());
  std::iota(parent.begin(), parent.end(), 0);
  const double slack = 2.0 * scan.azimuth_step;
  std::size_t low = 0;  // first run of the layer below
  for (std::size_t i = 0; i < runs.size(); ++i) {
    while (runs[low].layer < runs[i].layer - 1) ++low;
    for (std::size_t k = low; k < i && runs[k].layer < runs[i].layer; ++k) {
      if (runs[k].from <= runs[i].to + slack && runs[i].from <= runs[k].to + slack) {
        parent[Root(&parent, i)] = Root(&parent, k);
      }
    }
  }
  std::map<int, std::vector<int>> pieces;
  std::size_t next = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    std::vector<int>& piece = pieces[Root(&parent, i)];
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

std::string Text(const char* format, double a, double b = 0.0, double c = 0.0) {
  char buffer[200];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

// A piece of a plane on its way to be told a board or not.
class Candidate {
 public:
  Candidate(const Scan& scan, const Window& window, const BoardOptions& options)
      : scan_(scan), window_(window), options_(options), half_(options.size / 2.0) {}

  BoardSegment Judge(const std::vector<int>& piece, const Plane& plane) {
    piece_ = piece;
    plane_ = plane;
    if (Refit() && HasLayers() && HasExtent() && FitOutline() && FillsRectangle()) {
      segment_.detected = true;
      Label();
    }
    return segment_;
  }

 private:
  bool Reject(int progress, const std::string& reason) {
    segment_.progress = progress;
    segment_.reason = reason;
    return false;
  }

  const ScanPoint& At(int i) const { return *window_.points[i].point; }

  Eigen::Vector2d InPlane(const Eigen::Vector3d& point) const {
    return axes_.leftCols<2>().transpose() * (point - origin_);
  }

  // Where a beam meets the plane; false if it does not.
  bool Meets(const Eigen::Vector3d& direction, Eigen::Vector2d* in_plane) const {
    const double cosine = plane_.normal.dot(direction);
    if (cosine < 1e-3) return false;
    *in_plane = InPlane(direction * (plane_.distance / cosine));
    return true;
  }

  // Plane and threshold from the piece itself, and the piece from them, until nothing changes.
  bool Refit() {
    for (int k = 0; k < kRefits; ++k) {
      if (static_cast<int>(piece_.size()) < options_.least_points) {
        return Reject(0, Text("only %.0f points on a plane", piece_.size()));
      }
      plane_ = FitPlane(window_, piece_);
      if (plane_.sigma > options_.most_noise) {
        return Reject(
            1, Text("the surface is not flat (%.0f mm about its plane)", 1e3 * plane_.sigma));
      }
      const std::vector<int> before = std::move(piece_);
      piece_ = PieceAround(before);
      if (piece_ == before) break;
    }
    if (piece_.empty()) return Reject(0, "no connected points on a plane");
    SetPlane();
    return true;
  }

  std::vector<int> PieceAround(const std::vector<int>& before) const {
    std::vector<int> inliers;
    for (std::size_t i = 0; i < window_.points.size(); ++i) {
      if (plane_.Holds(At(i))) inliers.push_back(i);
    }
    std::vector<int> best;
    std::size_t most = 0;
    for (auto& piece : FindPieces(scan_, window_, inliers, plane_, options_.size.minCoeff())) {
      if (piece.size() <= most) break;
      std::vector<int> common;
      std::set_intersection(piece.begin(), piece.end(), before.begin(), before.end(),
                            std::back_inserter(common));
      if (common.size() > most) most = common.size(), best = std::move(piece);
    }
    return best;
  }

  void SetPlane() {
    plane_ = FitPlane(window_, piece_);
    segment_.plane_sigma = plane_.sigma;
    origin_.setZero();
    for (const int i : piece_) origin_ += At(i).position;
    origin_ /= piece_.size();
    origin_ -= plane_.Residual(origin_) * plane_.normal;
    const Eigen::Vector3d first = plane_.normal.unitOrthogonal();
    axes_ << first, plane_.normal.cross(first), plane_.normal;
    // Beams of some width return from the board though their middle is beyond its border.
    seen_half_ = half_.array() + options_.beam_width / 2.0 * origin_.norm();
    segment_.incidence = std::acos(std::min(1.0, plane_.distance / std::max(origin_.norm(), 1e-9)));
  }

  bool HasLayers() {
    ends_.clear();
    for (std::size_t k = 0; k < piece_.size(); ++k) {
      const int i = piece_[k];
      if (ends_.empty() || At(i).layer != At(ends_.back().first).layer) ends_.push_back({i, i});
      ends_.back().second = i;
    }
    segment_.layers = static_cast<int>(ends_.size());
    if (segment_.layers >= options_.least_layers) return true;
    return Reject(2, Text("only %.0f layers meet the plane at %.1f m, %.0f are needed: bring the "
                          "board nearer",
                          segment_.layers, origin_.norm(), options_.least_layers));
  }

  // Also tells planes apart that are seen too flat, or reach too far.
  bool HasExtent() {
    double longest = 0.0;
    const Eigen::Vector2d from = InPlane(At(piece_.front()).position);
    for (const auto& end : ends_) {
      for (const int i : {end.first, end.second}) {
        longest = std::max(longest, (InPlane(At(i).position) - from).norm());
      }
    }
    if (segment_.incidence > std::acos(kLeastCosine)) {
      return Reject(
          3, Text("the plane is seen too flat (%.0f degrees)", segment_.incidence * 180.0 / M_PI));
    }
    if (longest > 2.0 * options_.size.norm()) {
      return Reject(1, Text("the plane is larger than the board (%.2f m across, the board %.2f m)",
                            longest, options_.size.norm()));
    }
    return true;
  }

  // Returns the next position in the layer, outwards of an end; -1 if none is beside it.
  int Neighbour(int i, int side) const {
    const int k = i + side;
    if (k < 0 || k >= static_cast<int>(window_.points.size())) return -1;
    if (At(k).layer != At(i).layer) return -1;
    const double away = std::abs(window_.points[k].azimuth - window_.points[i].azimuth);
    return away <= kNeighbourSteps * scan_.azimuth_step ? k : -1;
  }

  // Tells whether something nearer to the sensor begins beside an end of a layer.
  bool IsHiddenBeside(int i, int side) const {
    int k = i;
    for (int step = 0; step < 3; ++step) {
      k = Neighbour(k, side);
      if (k < 0) return false;
      const int beyond = plane_.Side(At(k));
      if (beyond != 0) return beyond < 0;
    }
    return false;
  }

  // The first return inwards of an end that is not off the plane, as weak returns at edges are.
  int Trusted(int i, int inwards) const {
    int k = i;
    for (int step = 0; step < 3 && k >= 0; ++step, k = Neighbour(k, inwards)) {
      if (std::abs(plane_.Residual(At(k).position)) < kTrusted * plane_.sigma) return k;
    }
    return i;
  }

  // Where the border is met beyond the last return of a layer: half way to the first beam that
  // reached a surface behind, since returns in between, mixed of both, may be on either side; half
  // a beam step where there is none.
  Eigen::Vector2d Border(int i, int side) const {
    Eigen::Vector2d in_plane;
    const double azimuth = At(i).azimuth + side * BeyondEnd(i, side);
    if (!Meets(scan_.Direction(azimuth, At(i).elevation), &in_plane)) {
      return InPlane(At(i).position);
    }
    return in_plane;
  }

  double BeyondEnd(int i, int side) const {
    int k = i;  // where the beam's width is given, it accounts for mixed returns
    for (int step = 0; options_.beam_width <= 0.0 && step < 3; ++step) {
      k = Neighbour(k, side);
      const int next = k < 0 ? -1 : Neighbour(k, side);
      if (next < 0) break;
      const bool on_surface = std::abs(At(next).range - At(k).range) < kSurfaceShare * At(k).range;
      if (plane_.Side(At(k)) > 0 && on_surface) {
        return std::abs(window_.points[k].azimuth - window_.points[i].azimuth) / 2.0;
      }
    }
    return scan_.azimuth_step / 2.0;
  }

  bool FitOutline() { return FitToRuns() && Restrict() && FitToEnds(); }

  // A first rectangle, from the ends of all runs: other things in the plane may hang on the board.
  bool FitToRuns() {
    Outline outline;
    for (const Run& run :
         FindRuns(scan_, window_, piece_, plane_, kStripShare * half_.minCoeff())) {
      AddEnd(run.first, -1, &outline);
      AddEnd(run.last, 1, &outline);
    }
    AddLayersAround(&outline.outside);
    if (outline.limits.size() < 4) {
      return Reject(3, Text("only %.0f ends of layers are not hidden", outline.limits.size()));
    }
    pose_ = FitRectangle(outline, seen_half_);
    SetPose();
    return true;
  }

  // Drops what lies outside the rectangle.
  bool Restrict() {
    std::vector<int> inside;
    for (const int i : piece_) {
      const double distance = SignedDistance(pose_.ToBoard(InPlane(At(i).position)), seen_half_);
      if (distance < Tolerance()) inside.push_back(i);
    }
    piece_ = std::move(inside);
    if (static_cast<int>(piece_.size()) < options_.least_points) {
      return Reject(3, Text("only %.0f points within an outline of the board", piece_.size()));
    }
    SetPlane();
    return HasLayers();
  }

  // The rectangle, from the ends of the layers where the surface does not go on beyond them.
  bool FitToEnds() {
    Outline outline;
    int open = 0;
    for (const auto& end : ends_) {
      open += GoesOn(end.first, -1) ? 1 : AddEnd(end.first, -1, &outline);
      open += GoesOn(end.second, 1) ? 1 : AddEnd(end.second, 1, &outline);
    }
    AddLayersAround(&outline.outside);
    if (outline.limits.size() < std::max<std::size_t>(4, ends_.size() - 1)) {
      return Reject(4, Text("only %.0f of %.0f ends of layers show a border", outline.limits.size(),
                            2.0 * ends_.size()));
    }
    pose_ = FitRectangle(outline, seen_half_);
    SetPose();
    return BorderFits(outline, open) && SizeFits(outline);
  }

  // Adds what an end of a layer says about the outline; returns 0.
  int AddEnd(int i, int side, Outline* outline) const {
    outline->inside.push_back(InPlane(At(i).position));
    if (!IsHiddenBeside(i, side)) outline->limits.push_back(Border(Trusted(i, -side), side));
    AddOutside(i, side, &outline->outside);
    return 0;
  }

  // Tells whether the surface goes on beyond an end of a layer.
  bool GoesOn(int i, int side) const {
    const int next = Neighbour(i, side), after = next < 0 ? -1 : Neighbour(next, side);
    return after >= 0 && plane_.Holds(At(next)) && plane_.Holds(At(after));
  }

  void AddOutside(int i, int side, PlanePoints* outside) const {
    const int k = Neighbour(i, side);
    Eigen::Vector2d in_plane;
    if (k >= 0 && plane_.Side(At(k)) > 0 && Meets(At(k).position / At(k).range, &in_plane)) {
      outside->push_back(in_plane);
    }
  }

  // Beams of the layers next above and below that passed the plane.
  void AddLayersAround(PlanePoints* outside) const {
    const int low = At(ends_.front().first).layer, high = At(ends_.back().first).layer;
    const double reach = options_.size.norm() / 2.0;
    for (std::size_t i = 0; i < window_.points.size(); i += 3) {
      const int layer = At(i).layer;
      Eigen::Vector2d in_plane;
      if ((layer == low - 1 || layer == high + 1) && plane_.Side(At(i)) > 0 &&
          Meets(At(i).position / At(i).range, &in_plane) && in_plane.norm() < reach) {
        outside->push_back(in_plane);
      }
    }
  }

  void SetPose() {
    Eigen::Matrix2d turn;
    turn << std::cos(pose_.angle), -std::sin(pose_.angle), std::sin(pose_.angle),
        std::cos(pose_.angle);
    segment_.sensor_T_board.topLeftCorner<3, 2>() = axes_.leftCols<2>() * turn;
    segment_.sensor_T_board.block<3, 1>(0, 2) = plane_.normal;
    segment_.sensor_T_board.block<3, 1>(0, 3) = origin_ + axes_.leftCols<2>() * pose_.centre;
  }

  // A length on the board that one beam step spans, at the middle of the piece [m].
  double StepOnBoard() const {
    return scan_.azimuth_step * origin_.norm() /
           std::max(std::cos(segment_.incidence), kLeastCosine);
  }

  // How far a layer's end may be from the border.
  double Tolerance() const {
    return options_.border_tolerance + std::min(StepOnBoard(), 0.05 * options_.size.minCoeff());
  }

  bool BorderFits(const Outline& outline, int open) {
    double sum = 0.0;
    int near = 0;
    for (const auto& point : outline.limits) {
      const double distance = SignedDistance(pose_.ToBoard(point), seen_half_);
      if (std::abs(distance) > 3.0 * Tolerance()) continue;
      sum += distance * distance;
      ++near;
    }
    segment_.border_rms = std::sqrt(sum / std::max(near, 1));
    const double all = outline.limits.size() + open;
    if (near >= kBorderShare * all && near >= 4 && segment_.border_rms < Tolerance()) return true;
    return Reject(5, Text("the outline is not the board's (%.0f of %.0f ends of layers on it, %.0f "
                          "mm RMS)",
                          near, all, 1e3 * segment_.border_rms));
  }

  bool SizeFits(const Outline& outline) {
    segment_.measured_size = MeasureSize(outline.limits, pose_, seen_half_);
    segment_.measured_size -= 2.0 * (seen_half_ - half_);
    for (int axis = 0; axis < 2; ++axis) {
      const double size = segment_.measured_size[axis];
      const double most = 0.05 * options_.size[axis] + Tolerance();
      if (std::isfinite(size) && std::abs(size - options_.size[axis]) > most) {
        return Reject(
            4, Text("it measures %.2f m where the board has %.2f m", size, options_.size[axis]));
      }
    }
    return true;
  }

  // Beams of some layers that meet the rectangle.
  int Beams(const std::vector<double>& elevations) const {
    double from = 0.0, to = 0.0;
    const double middle = Azimuth(scan_, origin_);
    for (const double x : {-half_.x(), half_.x()}) {
      for (const double y : {-half_.y(), half_.y()}) {
        const Eigen::Vector4d corner = segment_.sensor_T_board * Eigen::Vector4d(x, y, 0.0, 1.0);
        const double azimuth = Wrapped(Azimuth(scan_, corner.head<3>()) - middle);
        from = std::min(from, azimuth);
        to = std::max(to, azimuth);
      }
    }
    int count = 0;
    for (const double elevation : elevations) {
      for (double azimuth = from; azimuth <= to; azimuth += scan_.azimuth_step) {
        Eigen::Vector2d p;
        if (Meets(scan_.Direction(middle + azimuth, elevation), &p) &&
            SignedDistance(pose_.ToBoard(p), half_) <= 0.0) {
          ++count;
        }
      }
    }
    return count;
  }

  // Layers that continue the scan's own ones above and below, as if it saw everything.
  std::vector<double> LayersBeyond() const {
    const std::vector<double>& own = scan_.layer_elevation;
    const double spacing = (own.back() - own.front()) / std::max<std::size_t>(own.size() - 1, 1);
    std::vector<double> beyond;
    if (spacing <= 0.0) return beyond;
    for (double e = own.back() + spacing; e < M_PI / 2.0; e += spacing) beyond.push_back(e);
    for (double e = own.front() - spacing; e > -M_PI / 2.0; e -= spacing) beyond.push_back(e);
    return beyond;
  }

  bool FillsRectangle() {
    int there = 0, nearer = 0, farther = 0;
    const double margin = StepOnBoard();
    for (std::size_t i = 0; i < window_.points.size(); ++i) {
      Eigen::Vector2d p;
      if (!Meets(At(i).position / At(i).range, &p)) continue;
      const double distance = SignedDistance(pose_.ToBoard(p), half_);
      if (distance > 0.0) continue;
      const int side = plane_.Side(At(i));
      if (plane_.Holds(At(i)))
        ++there;
      else if (side < 0)
        ++nearer;
      else if (side > 0 && distance < -margin)
        ++farther;
    }
    segment_.expected_points = Beams(scan_.layer_elevation);
    const double expected = std::max(segment_.expected_points, 1);
    segment_.visible = there / expected;
    segment_.hidden = nearer / expected;
    segment_.through = farther / expected;
    segment_.score = segment_.border_rms / options_.border_tolerance +
                     std::max(0.0, 1.0 - segment_.visible) + 2.0 * segment_.through;
    segment_.in_view = expected / (expected + Beams(LayersBeyond()));
    if (segment_.in_view < options_.least_in_view) {
      return Reject(6, Text("only %.0f %% of the board would be between the lowest and the highest "
                            "layer",
                            100.0 * segment_.in_view));
    }
    if (segment_.through > options_.most_through) {
      return Reject(6, Text("%.0f %% of the beams pass through where the board would be",
                            100.0 * segment_.through));
    }
    if (segment_.visible < options_.least_visible ||
        segment_.visible + segment_.hidden < options_.least_coverage) {
      return Reject(6, Text("only %.0f of %.0f expected returns from the board are there (%.0f "
                            "hidden)",
                            there, expected, nearer));
    }
    return true;
  }

  // A return between the board and what is beside it: off the plane, towards its neighbour.
  bool IsMixed(int i, int side) const {
    const double residual = plane_.Residual(At(i).position);
    if (std::abs(residual) < 1.5 * plane_.sigma) return false;
    const int k = Neighbour(i, side);
    return k >= 0 && plane_.Side(At(k)) * residual > 0.0;
  }

  void Label() {
    const double margin = 0.01 + 0.5 * StepOnBoard();
    std::map<int, std::pair<int, int>> ends;  // of the layers
    std::vector<int> chosen;
    for (std::size_t i = 0; i < window_.points.size(); ++i) {
      if (!plane_.Holds(At(i))) continue;
      const double distance = SignedDistance(pose_.ToBoard(InPlane(At(i).position)), seen_half_);
      if (distance > margin) continue;
      const bool at_border = distance > -2.0 * StepOnBoard();
      if (at_border && (IsMixed(i, -1) || IsMixed(i, 1))) continue;
      chosen.push_back(i);
      const int position = static_cast<int>(i);
      const auto found = ends.emplace(At(i).layer, std::make_pair(position, position)).first;
      found->second.second = position;
    }
    for (const int i : chosen) segment_.indices.push_back(At(i).index);
    for (const auto& item : ends) {
      AddLimit(Trusted(item.second.first, 1), -1);
      AddLimit(Trusted(item.second.second, -1), 1);
    }
    std::sort(segment_.indices.begin(), segment_.indices.end());
    auto& limits = segment_.limit_indices;
    std::sort(limits.begin(), limits.end());
    limits.erase(std::unique(limits.begin(), limits.end()), limits.end());
    segment_.layers = static_cast<int>(ends.size());
  }

  void AddLimit(int i, int side) {
    const double distance = SignedDistance(pose_.ToBoard(InPlane(At(i).position)), seen_half_);
    if (!IsHiddenBeside(i, side) && distance > -options_.most_inside * StepOnBoard() &&
        distance < options_.border_tolerance + StepOnBoard()) {
      segment_.limit_indices.push_back(At(i).index);
    }
  }

  const Scan& scan_;
  const Window& window_;
  const BoardOptions& options_;
  const Eigen::Vector2d half_;  // of the board's size
  Eigen::Vector2d seen_half_;   // of the outline that the beams' middles trace
  BoardSegment segment_;
  std::vector<int> piece_;
  std::vector<std::pair<int, int>> ends_;  // first and last of the piece in each layer
  Plane plane_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();    // middle of the piece, on the plane
  Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();  // of the plane, the third is its normal
  RectanglePose pose_;
};

bool IsBetter(const BoardSegment& a, const BoardSegment& b) {
  if (a.detected != b.detected) return a.detected;
  return a.detected ? a.score < b.score : a.progress > b.progress;
}

void Check(const BoardOptions& options) {
  if (!options.size.allFinite() || options.size.minCoeff() <= 0.0) {
    throw std::invalid_argument("the board's size must be positive");
  }
}

std::vector<int> Without(const Window& window, const std::vector<int>& points, const Plane& plane,
                         double threshold) {
  std::vector<int> left;
  for (const int i : points) {
    if (std::abs(plane.Residual(window.points[i].point->position)) >= threshold) left.push_back(i);
  }
  return left;
}

// The best piece of the window on one plane.
BoardSegment BestOnPlane(const Scan& scan, const Window& window, const Plane& plane,
                         const Eigen::Vector3d& seed, const BoardOptions& options) {
  std::vector<int> inliers;
  for (std::size_t i = 0; i < window.points.size(); ++i) {
    const auto& position = window.points[i].point->position;
    if (std::abs(plane.Residual(position)) < kThreshold * options.noise) inliers.push_back(i);
  }
  BoardSegment best;
  best.reason = "no plane has enough points";
  for (const auto& piece : FindPieces(scan, window, inliers, plane, options.size.minCoeff())) {
    if (static_cast<int>(piece.size()) < options.least_points) break;
    BoardSegment segment = Candidate(scan, window, options).Judge(piece, plane);
    const Eigen::Vector3d middle = segment.sensor_T_board.topRightCorner<3, 1>();
    segment.score += 0.5 * (middle - seed).norm() / SeedRadius(options);
    if (IsBetter(segment, best)) best = segment;
  }
  return best;
}

}  // namespace

double SeedRadius(const BoardOptions& options) { return options.seed_radius * options.size.norm(); }

BoardSegment SegmentBoard(const Scan& scan, const Eigen::Vector3d& seed,
                          const BoardOptions& options) {
  Check(options);
  if (!seed.allFinite()) throw std::invalid_argument("the seed must be finite");
  BoardSegment best;
  const Window window = CutWindow(scan, seed, options);
  if (static_cast<int>(window.sphere.size()) < options.least_points) {
    best.reason = Text("only %.0f points within %.2f m of the seed", window.sphere.size(),
                       SeedRadius(options));
    return best;
  }
  if (!scan.has_layers) {
    best.reason = "the cloud has no layers of a spinning scanner";
    return best;
  }
  best.reason = "no plane around the seed";
  std::vector<int> left = window.sphere;
  const double threshold = kProposal * options.noise;
  for (int k = 0; k < options.most_planes; ++k) {
    Plane plane;
    if (static_cast<int>(left.size()) < options.least_points ||
        !ProposePlane(window, left, threshold, kLeastCosine * seed.norm(), &plane)) {
      break;
    }
    const BoardSegment segment = BestOnPlane(scan, window, plane, seed, options);
    if (IsBetter(segment, best)) best = segment;
    std::vector<int> rest = Without(window, left, plane, kThreshold * options.noise);
    if (rest.size() == left.size()) break;
    left = std::move(rest);
  }
  return best;
}

}  // namespace atom_core
