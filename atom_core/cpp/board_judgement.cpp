#include "board_judgement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

#include "board_beside.h"
#include "plane_pieces.h"

namespace atom_core {
namespace {

constexpr int kRefits = 6;
constexpr double kStripShare = 0.5;   // of the shorter half side: gaps that a run bridges
constexpr double kBorderShare = 0.7;  // of the layers' ends that must lie on the border

std::nullopt_t Reject(int progress, const std::string& reason, BoardSegment* segment) {
  segment->progress = progress;
  segment->reason = reason;
  return std::nullopt;
}

// ---- the surface: plane and threshold from the piece itself, and the piece from them

// The piece of the plane that has most in common with the one before.
std::vector<int> PieceAround(const BoardSearch& search, const Plane& plane,
                             const std::vector<int>& before) {
  std::vector<int> inliers;
  for (std::size_t i = 0; i < search.window.points.size(); ++i) {
    if (plane.Holds(search.At(i))) inliers.push_back(i);
  }
  std::vector<int> best;
  std::size_t most = 0;
  for (auto& piece :
       FindPieces(search.scan, search.window, inliers, plane, search.options.size.minCoeff())) {
    if (piece.size() <= most) break;
    std::vector<int> common;
    std::set_intersection(piece.begin(), piece.end(), before.begin(), before.end(),
                          std::back_inserter(common));
    if (common.size() > most) most = common.size(), best = std::move(piece);
  }
  return best;
}

// The piece after refits until nothing changes.
std::optional<std::vector<int>> Refit(const BoardSearch& search, std::vector<int> piece,
                                      BoardSegment* segment) {
  for (int k = 0; k < kRefits; ++k) {
    if (static_cast<int>(piece.size()) < search.options.least_points) {
      return Reject(0, Text("only %.0f points on a plane", piece.size()), segment);
    }
    const Plane plane = FitPlane(search.window, piece);
    if (plane.sigma > search.options.most_noise) {
      return Reject(1, Text("the surface is not flat (%.0f mm about its plane)", 1e3 * plane.sigma),
                    segment);
    }
    const std::vector<int> before = std::move(piece);
    piece = PieceAround(search, plane, before);
    if (piece == before) break;
  }
  if (piece.empty()) return Reject(0, "no connected points on a plane", segment);
  return piece;
}

// The surface of a piece if enough layers meet it.
std::optional<Surface> SurfaceOf(const BoardSearch& search, std::vector<int> piece,
                                 BoardSegment* segment) {
  Surface surface(search, std::move(piece));
  segment->plane_sigma = surface.plane().sigma;
  segment->incidence = surface.incidence();
  segment->layers = static_cast<int>(surface.ends().size());
  if (segment->layers >= search.options.least_layers) return surface;
  return Reject(2,
                Text("only %.0f layers meet the plane at %.1f m, %.0f are needed: bring the board "
                     "nearer",
                     segment->layers, surface.origin().norm(), search.options.least_layers),
                segment);
}

// Also tells planes apart that are seen too flat, or reach too far.
bool HasExtent(const BoardSearch& search, const Surface& surface, BoardSegment* segment) {
  double longest = 0.0;
  const Eigen::Vector2d from = surface.InPlane(search.At(surface.piece().front()).position);
  for (const auto& end : surface.ends()) {
    for (const int i : {end.first, end.second}) {
      longest = std::max(longest, (surface.InPlane(search.At(i).position) - from).norm());
    }
  }
  if (surface.incidence() > std::acos(kLeastCosine)) {
    Reject(3, Text("the plane is seen too flat (%.0f degrees)", surface.incidence() * 180.0 / M_PI),
           segment);
    return false;
  }
  if (longest > 2.0 * search.options.size.norm()) {
    Reject(1,
           Text("the plane is larger than the board (%.2f m across, the board %.2f m)", longest,
                search.options.size.norm()),
           segment);
    return false;
  }
  return true;
}

std::optional<Surface> FindSurface(const BoardSearch& search, std::vector<int> piece,
                                   BoardSegment* segment) {
  std::optional<std::vector<int>> refit = Refit(search, std::move(piece), segment);
  if (!refit) return std::nullopt;
  std::optional<Surface> surface = SurfaceOf(search, std::move(*refit), segment);
  if (surface && !HasExtent(search, *surface, segment)) return std::nullopt;
  return surface;
}

// ---- the outline: a rectangle of the board's size through the ends of the layers

void SetPose(const Surface& surface, const RectanglePose& pose, BoardSegment* segment) {
  const auto in_plane = surface.axes().leftCols<2>();
  Eigen::Matrix2d turn;
  turn << std::cos(pose.angle), -std::sin(pose.angle), std::sin(pose.angle), std::cos(pose.angle);
  segment->sensor_T_board.topLeftCorner<3, 2>() = in_plane * turn;
  segment->sensor_T_board.block<3, 1>(0, 2) = surface.plane().normal;
  segment->sensor_T_board.block<3, 1>(0, 3) = surface.origin() + in_plane * pose.centre;
}

// A first rectangle, from the ends of all runs: other things in the plane may hang on the board.
std::optional<RectanglePose> FitToRuns(const BoardSearch& search, const Surface& surface,
                                       BoardSegment* segment) {
  Outline outline;
  const double bridged = kStripShare * search.HalfSize().minCoeff();
  for (const Run& run :
       FindRuns(search.scan, search.window, surface.piece(), surface.plane(), bridged)) {
    surface.AddEnd(run.first, -1, &outline);
    surface.AddEnd(run.last, 1, &outline);
  }
  surface.AddLayersAround(&outline.outside);
  if (outline.limits.size() < 4) {
    return Reject(3, Text("only %.0f ends of layers are not hidden", outline.limits.size()),
                  segment);
  }
  const RectanglePose pose = FitRectangle(outline, surface.seen_half());
  SetPose(surface, pose, segment);
  return pose;
}

// The surface without what lies outside the rectangle.
std::optional<Surface> Restrict(const BoardSearch& search, const Surface& surface,
                                const RectanglePose& pose, BoardSegment* segment) {
  std::vector<int> inside;
  for (const int i : surface.piece()) {
    const Eigen::Vector2d point = pose.ToBoard(surface.InPlane(search.At(i).position));
    if (SignedDistance(point, surface.seen_half()) < surface.Tolerance()) inside.push_back(i);
  }
  if (static_cast<int>(inside.size()) < search.options.least_points) {
    return Reject(3, Text("only %.0f points within an outline of the board", inside.size()),
                  segment);
  }
  return SurfaceOf(search, std::move(inside), segment);
}

// Tells whether enough ends of layers lie on the border.
//
// open: ends beyond which the surface goes on.
bool BorderFits(const Surface& surface, const RectanglePose& pose, const Outline& outline, int open,
                BoardSegment* segment) {
  double sum = 0.0;
  int near = 0;
  for (const auto& point : outline.limits) {
    const double distance = SignedDistance(pose.ToBoard(point), surface.seen_half());
    if (std::abs(distance) > 3.0 * surface.Tolerance()) continue;
    sum += distance * distance;
    ++near;
  }
  segment->border_rms = std::sqrt(sum / std::max(near, 1));
  const double all = outline.limits.size() + open;
  if (near >= kBorderShare * all && near >= 4 && segment->border_rms < surface.Tolerance()) {
    return true;
  }
  Reject(5,
         Text("the outline is not the board's (%.0f of %.0f ends of layers on it, %.0f mm RMS)",
              near, all, 1e3 * segment->border_rms),
         segment);
  return false;
}

bool SizeFits(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
              const Outline& outline, BoardSegment* segment) {
  segment->measured_size = MeasureSize(outline.limits, pose, surface.seen_half());
  segment->measured_size -= 2.0 * (surface.seen_half() - search.HalfSize());
  for (int axis = 0; axis < 2; ++axis) {
    const double size = segment->measured_size[axis], expected = search.options.size[axis];
    const double most = 0.05 * expected + surface.Tolerance();
    if (std::isfinite(size) && std::abs(size - expected) > most) {
      Reject(4, Text("it measures %.2f m where the board has %.2f m", size, expected), segment);
      return false;
    }
  }
  return true;
}

// The rectangle, from the ends of the layers where the surface does not go on beyond them.
std::optional<RectanglePose> FitToEnds(const BoardSearch& search, const Surface& surface,
                                       BoardSegment* segment) {
  Outline outline;
  int open = 0;
  const auto add = [&](int i, int side) {
    if (surface.GoesOn(i, side)) {
      ++open;
    } else {
      surface.AddEnd(i, side, &outline);
    }
  };
  for (const auto& end : surface.ends()) {
    add(end.first, -1);
    add(end.second, 1);
  }
  surface.AddLayersAround(&outline.outside);
  const std::size_t layers = surface.ends().size();
  if (outline.limits.size() < std::max<std::size_t>(4, layers - 1)) {
    return Reject(
        4,
        Text("only %.0f of %.0f ends of layers show a border", outline.limits.size(), 2.0 * layers),
        segment);
  }
  const RectanglePose pose = FitRectangle(outline, surface.seen_half());
  SetPose(surface, pose, segment);
  if (!BorderFits(surface, pose, outline, open, segment) ||
      !SizeFits(search, surface, pose, outline, segment)) {
    return std::nullopt;
  }
  return pose;
}

// ---- the filling: returns wherever the board would give them

// Beams of some layers that meet the rectangle.
int Beams(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
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
  int count = 0;
  for (const double elevation : elevations) {
    for (double azimuth = from; azimuth <= to; azimuth += scan.azimuth_step) {
      Eigen::Vector2d p;
      if (surface.Meets(scan.Direction(middle + azimuth, elevation), &p) &&
          SignedDistance(pose.ToBoard(p), half) <= 0.0) {
        ++count;
      }
    }
  }
  return count;
}

// Layers that continue the scan's own ones above and below, as if it saw everything.
std::vector<double> LayersBeyond(const Scan& scan) {
  const std::vector<double>& own = scan.layer_elevation;
  const double spacing = (own.back() - own.front()) / std::max<std::size_t>(own.size() - 1, 1);
  std::vector<double> beyond;
  if (spacing <= 0.0) return beyond;
  for (double e = own.back() + spacing; e < M_PI / 2.0; e += spacing) beyond.push_back(e);
  for (double e = own.front() - spacing; e > -M_PI / 2.0; e -= spacing) beyond.push_back(e);
  return beyond;
}

// Returns of beams that meet the rectangle: on it, before it, and behind it.
struct Filling {
  int there = 0, nearer = 0, farther = 0;
};

Filling CountReturns(const BoardSearch& search, const Surface& surface, const RectanglePose& pose) {
  Filling filling;
  const double margin = surface.StepOnBoard();
  const Eigen::Vector2d half = search.HalfSize();
  const Plane& plane = surface.plane();
  for (const Near& near : search.window.points) {
    const ScanPoint& point = *near.point;
    Eigen::Vector2d p;
    if (!surface.Meets(point.position / point.range, &p)) continue;
    const double distance = SignedDistance(pose.ToBoard(p), half);
    if (distance > 0.0) continue;
    const int side = plane.Side(point);
    if (plane.Holds(point)) {
      ++filling.there;
    } else if (side < 0) {
      ++filling.nearer;
    } else if (side > 0 && distance < -margin) {
      ++filling.farther;
    }
  }
  return filling;
}

// Sets what is seen of the board.
void MeasureFilling(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                    const Filling& filling, BoardSegment* segment) {
  const auto beams = [&](const std::vector<double>& elevations) {
    return Beams(search, surface, pose, segment->sensor_T_board, elevations);
  };
  segment->expected_points = beams(search.scan.layer_elevation);
  const double expected = std::max(segment->expected_points, 1);
  segment->visible = filling.there / expected;
  segment->hidden = filling.nearer / expected;
  segment->through = filling.farther / expected;
  segment->score = segment->border_rms / search.options.border_tolerance +
                   std::max(0.0, 1.0 - segment->visible) + 2.0 * segment->through;
  segment->in_view = expected / (expected + beams(LayersBeyond(search.scan)));
}

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
  } else if (segment->visible < options.least_visible ||
             segment->visible + segment->hidden < options.least_coverage) {
    reason = Text("only %.0f of %.0f expected returns from the board are there (%.0f hidden)",
                  filling.there, std::max(segment->expected_points, 1), filling.nearer);
  }
  if (reason.empty()) return true;
  Reject(6, reason, segment);
  return false;
}

// ---- the label

void AddLimit(const BoardSearch& search, const Surface& surface, const RectanglePose& pose, int i,
              int side, std::vector<std::int64_t>* limits) {
  const BoardOptions& options = search.options;
  const Eigen::Vector2d point = pose.ToBoard(surface.InPlane(search.At(i).position));
  const double distance = SignedDistance(point, surface.seen_half());
  const double step = surface.StepOnBoard();
  if (!surface.IsHiddenBeside(i, side) && distance > -options.most_inside * step &&
      distance < options.border_tolerance + step) {
    limits->push_back(search.At(i).index);
  }
}

void Label(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
           BoardSegment* segment) {
  const double step = surface.StepOnBoard(), margin = 0.01 + 0.5 * step;
  std::map<int, std::pair<int, int>> ends;  // of the layers
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint& point = search.At(i);
    if (!surface.plane().Holds(point)) continue;
    const Eigen::Vector2d on_board = pose.ToBoard(surface.InPlane(point.position));
    const double distance = SignedDistance(on_board, surface.seen_half());
    if (distance > margin) continue;
    const bool at_border = distance > -2.0 * step;
    if (at_border && (surface.IsMixed(i, -1) || surface.IsMixed(i, 1))) continue;
    segment->indices.push_back(point.index);
    ends.emplace(point.layer, std::make_pair(i, i)).first->second.second = i;
  }
  auto& limits = segment->limit_indices;
  for (const auto& item : ends) {
    AddLimit(search, surface, pose, surface.Trusted(item.second.first, 1), -1, &limits);
    AddLimit(search, surface, pose, surface.Trusted(item.second.second, -1), 1, &limits);
  }
  std::sort(segment->indices.begin(), segment->indices.end());
  std::sort(limits.begin(), limits.end());
  limits.erase(std::unique(limits.begin(), limits.end()), limits.end());
  segment->layers = static_cast<int>(ends.size());
}

}  // namespace

std::string Text(const char* format, double a, double b, double c, double d) {
  char buffer[200];
  std::snprintf(buffer, sizeof buffer, format, a, b, c, d);
  return buffer;
}

BoardSegment JudgePiece(const BoardSearch& search, std::vector<int> piece) {
  BoardSegment segment;
  const auto surface = FindSurface(search, std::move(piece), &segment);
  if (!surface) return segment;
  const auto first = FitToRuns(search, *surface, &segment);
  if (!first) return segment;
  const auto restricted = Restrict(search, *surface, *first, &segment);
  if (!restricted) return segment;
  const auto pose = FitToEnds(search, *restricted, &segment);
  if (!pose || !FillsRectangle(search, *restricted, *pose, &segment)) return segment;
  if (GoesOnBesideSide(search, *restricted, *pose, &segment)) return segment;
  segment.detected = true;
  Label(search, *restricted, *pose, &segment);
  return segment;
}

}  // namespace atom_core
