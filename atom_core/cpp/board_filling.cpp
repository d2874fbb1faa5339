#include "board_filling.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "board_judgement.h"

namespace atom_core {
namespace {

constexpr double kLeastSpacing = 1e-5;  // of layers that continue; finer ones are not counted [rad]
// Layers in half a turn, and beams across a board: damaged clouds seem to have millions, and those
// that no sensor has are counted by a part of them.
constexpr double kMostAcross = 2000.0;
constexpr double kMostBeams = 1e9;
constexpr int kLeastThrough = 8;      // beams of a layer that show what is behind
constexpr double kLeastBright = 0.6;  // of what must be visible, where dark squares return nothing

// Beams of some layers that meet the rectangle.
double Beams(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
             const Eigen::Matrix4d& sensor_T_board, const std::vector<double>& elevations) {
  const Scan& scan = search.scan;
  const Eigen::Vector2d half = search.HalfSize();
  double from = 0.0, to = 0.0;
  const double middle = Azimuth(scan, surface.origin());
  for (const double x : {-half.x(), half.x()}) {
    for (const double y : {-half.y(), half.y()}) {
      const Eigen::Vector4d corner = sensor_T_board * Eigen::Vector4d(x, y, 0.0, 1.0);
      const double azimuth = Wrapped(Azimuth(scan, corner.head<3>()) - middle);
      from = std::min(from, azimuth);
      to = std::max(to, azimuth);
    }
  }
  std::vector<Eigen::Vector3d> columns;  // level directions
  const double step = std::max(scan.azimuth_step, (to - from) / kMostAcross);
  for (double azimuth = from; azimuth <= to; azimuth += step) {
    columns.push_back(scan.Direction(middle + azimuth, 0.0));
  }
  const Eigen::Vector3d axis = scan.sensor_R_spin.col(2);
  const double reach = half.norm();  // of the rectangle about its middle
  const Eigen::Vector3d centre = sensor_T_board.topRightCorner<3, 1>();
  const double away = centre.norm(), off = std::asin(std::min(reach / std::max(away, 1e-9), 1.0));
  const double mean = std::asin(std::max(-1.0, std::min(1.0, axis.dot(centre) / away)));
  int count = 0;
  for (const double elevation : elevations) {
    if (std::abs(elevation - mean) > off) continue;
    const double horizontal = std::cos(elevation), up = std::sin(elevation);
    for (const Eigen::Vector3d& column : columns) {
      Eigen::Vector2d p;
      if (surface.Meets(horizontal * column + up * axis, &p) &&
          SignedDistance(pose.ToBoard(p), half) <= 0.0) {
        ++count;
      }
    }
  }
  return std::min(count * step / scan.azimuth_step, kMostBeams);
}

// Layers that continue the scan's own ones above and below, as if it saw everything.
// Where they would be more than any sensor has, some of them, each of which stands for `weight`.
std::vector<double> LayersBeyond(const Scan& scan, double* weight) {
  const std::vector<double>& own = scan.layer_elevation;
  const double own_spacing = (own.back() - own.front()) / std::max<std::size_t>(own.size() - 1, 1);
  const double spacing = std::max(own_spacing, M_PI / kMostAcross);
  *weight = spacing / std::max(own_spacing, kLeastSpacing);
  std::vector<double> beyond;
  if (own_spacing < kLeastSpacing) return beyond;
  for (double e = own.back() + spacing; e < M_PI / 2.0; e += spacing) beyond.push_back(e);
  for (double e = own.front() - spacing; e > -M_PI / 2.0; e -= spacing) beyond.push_back(e);
  return beyond;
}

// Returns of beams that meet the rectangle: on it, before it, and behind it; beams without a return
// from squares that swallow light, between others that are on it; and how many layers pass through.
struct Filling {
  int there = 0, nearer = 0, farther = 0, dark = 0, open_layers = 0;
};

// Beams that are lost between two neighbours on the board, no farther apart than dark squares are
// wide.
int LostBetween(const BoardSearch& search, int i, int k) {
  const Near &a = search.window.points[i], &b = search.window.points[k];
  if (a.point->layer != b.point->layer) return 0;
  if ((a.point->position - b.point->position).norm() > search.options.LongestDark()) return 0;
  const double steps = (b.azimuth - a.azimuth) / search.scan.azimuth_step;
  return std::max(static_cast<int>(std::lround(steps)) - 1, 0);
}

Filling CountReturns(const BoardSearch& search, const Surface& surface, const RectanglePose& pose) {
  Filling filling;
  const double margin = surface.StepOnBoard();
  const Eigen::Vector2d half = search.HalfSize();
  const Plane& plane = surface.plane();
  int last = -1;  // return on the board
  // Of each layer, beams well inside that pass through, and that return. Where layers are dense in
  // the middle, one of the others is few of all beams, and stands for a large part of the board.
  const double deep = 0.25 * surface.Tolerance() + margin;
  std::map<int, std::pair<int, int>> layers;
  for (std::size_t i = 0; i < search.window.points.size(); ++i) {
    const ScanPoint& point = search.At(i);
    Eigen::Vector2d p;
    if (!surface.Meets(point.position / point.range, &p)) continue;
    const double distance = SignedDistance(pose.ToBoard(p), half);
    if (distance > 0.0) continue;
    const int side = plane.Side(point);
    if (distance < -deep && (side > 0 || plane.Holds(point))) {
      std::pair<int, int>& layer = layers[point.layer];
      ++(plane.Holds(point) ? layer.second : layer.first);
    }
    if (plane.Holds(point)) {
      ++filling.there;
      if (last >= 0 && last + 1 == static_cast<int>(i))
        filling.dark += LostBetween(search, last, i);
      last = static_cast<int>(i);
    } else if (side < 0) {
      ++filling.nearer;
    } else if (side > 0 && distance < -margin) {
      ++filling.farther;
    }
  }
  for (const auto& layer : layers) {
    const int through = layer.second.first;
    if (through >= kLeastThrough && through > layer.second.second) ++filling.open_layers;
  }
  return filling;
}

// Sets what is seen of the board.
void MeasureFilling(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                    const Filling& filling, BoardSegment* segment) {
  const auto beams = [&](const std::vector<double>& elevations) {
    return Beams(search, surface, pose, segment->sensor_T_board, elevations);
  };
  segment->expected_points = static_cast<int>(std::lround(beams(search.scan.layer_elevation)));
  const double expected = std::max(segment->expected_points, 1);
  segment->visible = filling.there / expected;
  segment->hidden = filling.nearer / expected;
  segment->through = filling.farther / expected;
  segment->dark = filling.dark / expected;
  segment->score = segment->border_rms / search.options.border_tolerance +
                   std::max(0.0, 1.0 - segment->visible - segment->dark) + 2.0 * segment->through;
  double weight = 1.0;
  const std::vector<double> beyond = LayersBeyond(search.scan, &weight);
  segment->in_view = expected / (expected + weight * beams(beyond));
}

}  // namespace

bool FillsRectangle(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                    BoardSegment* segment) {
  const BoardOptions& options = search.options;
  const Filling filling = CountReturns(search, surface, pose);
  MeasureFilling(search, surface, pose, filling, segment);
  std::string reason;
  if (segment->in_view < options.least_in_view) {
    reason = Text("only %.0f %% of the board would be between the lowest and the highest layer",
                  100.0 * segment->in_view);
  } else if (segment->through > options.most_through) {
    reason = Text("%.0f %% of the beams pass through where the board would be",
                  100.0 * segment->through);
  } else if (filling.open_layers > 0) {
    reason = Text("%.0f of the layers pass through where the board would be",
                  static_cast<double>(filling.open_layers));
  } else if (segment->visible < kLeastBright * options.least_visible ||
             segment->visible + segment->dark < options.least_visible ||
             segment->visible + segment->dark + segment->hidden < options.least_coverage) {
    reason = Text("only %.0f of %.0f expected returns from the board are there (%.0f hidden)",
                  filling.there, std::max(segment->expected_points, 1), filling.nearer);
  }
  if (reason.empty()) return true;
  segment->progress = 6;
  segment->reason = reason;
  return false;
}

std::set<int> OpenLayers(const BoardSearch& search, const Surface& surface,
                         const RectanglePose& pose, double margin) {
  struct Returns {
    int there = 0, inside = 0, farther = 0, between = 0, since = 0;
  };
  std::map<int, Returns> layers;
  const Eigen::Vector2d half = surface.seen_half();
  for (std::size_t i = 0; i < search.window.points.size(); ++i) {
    const ScanPoint& point = search.At(i);
    Eigen::Vector2d p;
    if (!surface.Meets(point.position / point.range, &p)) continue;
    const double distance = SignedDistance(pose.ToBoard(p), half);
    if (distance > margin) continue;
    Returns& layer = layers[point.layer];
    if (surface.plane().Holds(point)) {
      if (layer.there > 0) layer.between += layer.since;
      layer.since = 0;
      ++layer.there;
      layer.inside += distance < 0.0 ? 1 : 0;
    } else if (surface.plane().Side(point) > 0) {
      ++layer.farther;
      ++layer.since;
    }
  }
  std::set<int> open;
  for (const auto& item : layers) {
    const Returns& layer = item.second;
    const int through = layer.inside > 0 ? layer.between : layer.farther;
    if (through > layer.there) open.insert(item.first);
  }
  return open;
}

}  // namespace atom_core
