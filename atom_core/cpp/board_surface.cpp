#include "board_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "median.h"

namespace atom_core {
namespace {

constexpr double kTrusted = 1.5;         // standard deviations of returns at the border
constexpr double kMixed = 1.5;           // standard deviations, beyond them a return may be mixed
constexpr double kNeighbourSteps = 3.5;  // within which a return is beside a limit point
constexpr double kSurfaceShare = 0.03;   // of the range, between neighbours on one surface
constexpr int kStepsBeside = 3;          // returns that are looked at beside an end
constexpr std::size_t kLeastBends = 12;  // of returns, and
constexpr std::size_t kLeastLayerBends = 3;  // of layers, of which the scatter is measured

std::vector<std::pair<int, int>> LayerEnds(const Window& window, const std::vector<int>& piece) {
  std::vector<std::pair<int, int>> ends;
  for (const int i : piece) {
    if (ends.empty() || window.At(i).layer != window.At(ends.back().first).layer) {
      ends.push_back({i, i});
    }
    ends.back().second = i;
  }
  return ends;
}

// Second differences have six variances, whatever the slope.
double ScatterOfBends(std::vector<double> bends) {
  return 1.4826 * Median(std::move(bends)) / std::sqrt(6.0);
}

}  // namespace

Surface::Surface(const BoardSearch& search, std::vector<int> piece)
    : search_(&search), piece_(std::move(piece)), ends_(LayerEnds(search.window, piece_)) {
  plane_ = FitPlane(search.window, piece_);
  origin_.setZero();
  for (const int i : piece_) origin_ += At(i).position;
  origin_ /= piece_.size();
  origin_ -= plane_.Residual(origin_) * plane_.normal;
  const Eigen::Vector3d first = plane_.normal.unitOrthogonal();
  axes_ << first, plane_.normal.cross(first), plane_.normal;
  // Beams of some width return from the board though their middle is beyond its border.
  seen_half_ = search.HalfSize().array() + search.options.beam_width / 2.0 * origin_.norm();
  incidence_ = std::acos(std::min(1.0, plane_.distance / std::max(origin_.norm(), 1e-9)));
}

double Surface::StepOnBoard() const {
  return search_->scan.azimuth_step * origin_.norm() / std::max(std::cos(incidence_), kLeastCosine);
}

double Surface::LayerSpacing(int i) const {
  const std::vector<double>& elevation = search_->scan.layer_elevation;
  const int layer = At(i).layer, highest = static_cast<int>(elevation.size()) - 1;
  const int low = std::max(layer - 1, 0), high = std::min(layer + 1, highest);
  return high > low ? (elevation[high] - elevation[low]) / (high - low) : 0.0;
}

double Surface::ToLayer(int i, double elevation) const {
  Eigen::Vector2d here, there;
  const Eigen::Vector3d beam = search_->scan.Direction(At(i).azimuth, elevation);
  if (!Meets(At(i).position / At(i).range, &here) || !Meets(beam, &there)) return origin_.norm();
  return (there - here).norm();
}

double Surface::Tolerance() const {
  const BoardOptions& options = search_->options;
  return options.border_tolerance + std::min(StepOnBoard(), 0.05 * options.size.minCoeff());
}

int Surface::Neighbour(int i, int side) const {
  const std::vector<Near>& points = search_->window.points;
  const int k = i + side;
  if (k < 0 || k >= static_cast<int>(points.size())) return -1;
  if (At(k).layer != At(i).layer) return -1;
  const double away = std::abs(points[k].azimuth - points[i].azimuth);
  return away <= kNeighbourSteps * search_->scan.azimuth_step ? k : -1;
}

double Surface::OwnScatter() const {
  std::vector<double> along, across;
  const auto bend = [](double a, double b, double c) { return std::abs(a - 2.0 * b + c); };
  std::vector<double> means;  // of the residuals of layers
  std::size_t count = 0;
  for (std::size_t k = 0; k < piece_.size(); ++k) {
    const double here = plane_.Residual(At(piece_[k]).position);
    if (k == 0 || At(piece_[k]).layer != At(piece_[k - 1]).layer) means.push_back(0.0), count = 0;
    means.back() += (here - means.back()) / ++count;
    if (count < 3 || piece_[k] != piece_[k - 2] + 2) continue;
    along.push_back(bend(plane_.Residual(At(piece_[k - 2]).position),
                         plane_.Residual(At(piece_[k - 1]).position), here));
  }
  for (std::size_t k = 2; k < means.size(); ++k) {
    across.push_back(bend(means[k - 2], means[k - 1], means[k]));
  }
  if (along.size() < kLeastBends) return plane_.sigma;
  const double first = ScatterOfBends(std::move(along));
  return across.size() < kLeastLayerBends ? first
                                          : std::hypot(first, ScatterOfBends(std::move(across)));
}

std::vector<int> Surface::WithoutOpenEnds() const {
  std::vector<bool> open(ends_.size(), false);
  std::size_t k = 0;
  for (std::size_t layer = 0; layer < ends_.size(); ++layer) {
    int there = 0, through = 0;
    for (; k < piece_.size() && piece_[k] <= ends_[layer].second; ++k) ++there;
    for (int i = ends_[layer].first; i <= ends_[layer].second; ++i) {
      through += plane_.Side(At(i)) > 0 ? 1 : 0;
    }
    open[layer] = through > there;
  }
  // A single layer may be an arc that leaves the board in its middle.
  auto low = std::find(open.begin(), open.end(), false) - open.begin();
  auto high = open.rend() - std::find(open.rbegin(), open.rend(), false);
  if (low == 1) low = 0;
  if (high + 1 == static_cast<std::ptrdiff_t>(open.size())) high = open.size();
  return Between(low, high);
}

std::vector<int> Surface::WithoutNarrowEnds() const {
  std::ptrdiff_t low = 0, high = ends_.size();
  while (high - low > 1 && PassesBeside(low, low + 1)) ++low;
  while (high - low > 1 && PassesBeside(high - 1, high - 2)) --high;
  return Between(low, high);
}

std::vector<int> Surface::Between(std::ptrdiff_t low, std::ptrdiff_t high) const {
  std::vector<int> solid;
  for (std::ptrdiff_t layer = low; layer < high; ++layer) {
    const auto from = std::lower_bound(piece_.begin(), piece_.end(), ends_[layer].first);
    const auto to = std::upper_bound(piece_.begin(), piece_.end(), ends_[layer].second);
    solid.insert(solid.end(), from, to);
  }
  return solid;
}

// Tells whether of a layer's beams more pass through than return, where another layer is on the
// surface.
bool Surface::PassesBeside(std::ptrdiff_t layer, std::ptrdiff_t other) const {
  const std::vector<Near>& points = search_->window.points;
  const auto first = points.begin() + ends_[layer].first;
  const double from = points[ends_[other].first].azimuth, to = points[ends_[other].second].azimuth;
  int excess = 0;
  const auto count = [&](const Near& near) {
    if (near.point->layer != first->point->layer) return false;
    if (near.azimuth < from || near.azimuth > to) return true;
    excess += plane_.Side(*near.point) > 0 ? 1 : plane_.Holds(*near.point) ? -1 : 0;
    return true;
  };
  for (auto i = first; i != points.end() && count(*i); ++i) {
  }
  for (auto i = first; i != points.begin() && count(*(i - 1)); --i) {
  }
  return excess > 0;
}

bool Surface::IsHiddenBeside(int i, int side) const {
  int k = i;
  for (int step = 0; step < kStepsBeside; ++step) {
    k = Neighbour(k, side);
    if (k < 0) return false;
    const int beyond = plane_.Side(At(k));
    if (beyond != 0) return beyond < 0;
    if (search_->IsOfLarger(k, plane_)) return true;
  }
  return false;
}

bool Surface::GoesOn(int i, int side) const {
  const int next = Neighbour(i, side), after = next < 0 ? -1 : Neighbour(next, side);
  return after >= 0 && plane_.Holds(At(next)) && plane_.Holds(At(after)) &&
         !search_->IsOfLarger(next, plane_);
}

bool Surface::IsMixed(int i, int side) const {
  const double residual = plane_.Residual(At(i).position);
  if (std::abs(residual) < kMixed * plane_.sigma) return false;
  const int k = Neighbour(i, side);
  return k >= 0 && plane_.Side(At(k)) * residual > 0.0;
}

int Surface::Trusted(int i, int inwards) const {
  int k = i;
  for (int step = 0; step < kStepsBeside && k >= 0; ++step, k = Neighbour(k, inwards)) {
    if (std::abs(plane_.Residual(At(k).position)) < kTrusted * plane_.sigma) return k;
  }
  return i;
}

// Where the border is met beyond the last return of a layer: half way to the first beam that
// reached a surface behind, since returns in between, mixed of both, may be on either side; half
// a beam step where there is none.
Eigen::Vector2d Surface::Border(int i, int side) const {
  Eigen::Vector2d in_plane;
  const double azimuth = At(i).azimuth + side * BeyondEnd(i, side);
  if (!Meets(search_->scan.Direction(azimuth, At(i).elevation), &in_plane)) {
    return InPlane(At(i).position);
  }
  return in_plane;
}

double Surface::BeyondEnd(int i, int side) const {
  const std::vector<Near>& points = search_->window.points;
  // Where the beam's width is given, it accounts for mixed returns.
  const int steps = search_->options.beam_width <= 0.0 ? kStepsBeside : 0;
  int k = i;
  for (int step = 0; step < steps; ++step) {
    k = Neighbour(k, side);
    const int next = k < 0 ? -1 : Neighbour(k, side);
    if (next < 0) break;
    const bool on_surface = std::abs(At(next).range - At(k).range) < kSurfaceShare * At(k).range;
    if (plane_.Side(At(k)) > 0 && on_surface) {
      return std::abs(points[k].azimuth - points[i].azimuth) / 2.0;
    }
  }
  return search_->scan.azimuth_step / 2.0;
}

void Surface::AddEnd(int i, int side, Outline* outline) const {
  outline->inside.push_back(InPlane(At(i).position));
  if (!IsHiddenBeside(i, side)) outline->limits.push_back(Border(Trusted(i, -side), side));
  AddOutside(i, side, &outline->outside);
}

void Surface::AddOutside(int i, int side, PlanePoints* outside) const {
  const int k = Neighbour(i, side);
  Eigen::Vector2d in_plane;
  if (k >= 0 && plane_.Side(At(k)) > 0 && Meets(At(k).position / At(k).range, &in_plane)) {
    outside->push_back(in_plane);
  }
}

void Surface::AddLayersAround(PlanePoints* outside) const {
  const int low = At(ends_.front().first).layer, high = At(ends_.back().first).layer;
  const double reach = search_->options.size.norm() / 2.0;
  for (std::size_t i = 0; i < search_->window.points.size(); i += 3) {
    const int layer = At(i).layer;
    Eigen::Vector2d in_plane;
    if ((layer == low - 1 || layer == high + 1) &&
        (plane_.Side(At(i)) > 0 || search_->IsOfLarger(i, plane_)) &&
        Meets(At(i).position / At(i).range, &in_plane) && in_plane.norm() < reach) {
      outside->push_back(in_plane);
    }
  }
}

}  // namespace atom_core
