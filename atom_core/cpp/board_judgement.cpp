#include "board_judgement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "board_beside.h"
#include "board_border.h"
#include "board_contact.h"
#include "board_filling.h"
#include "board_size.h"
#include "board_squares.h"
#include "plane_pieces.h"
#include "plane_points.h"

namespace atom_core {

std::nullopt_t Reject(int progress, const std::string& reason, BoardSegment* segment) {
  segment->progress = progress;
  segment->reason = reason;
  return std::nullopt;
}

namespace {

constexpr int kRefits = 6;
constexpr double kStripShare = 0.5;  // of the shorter half side: gaps that a run bridges
constexpr double kFlatness = 2.0;    // of the scatter along layers, and
constexpr double kUneven = 0.008;    // [m] about the plane are flat
constexpr double kWideLayer = 0.4;   // of the shorter side: layers beyond the board count, if
constexpr double kSolid = 0.6;       // of them returns, and
constexpr double kFarBeyond = 0.12;  // of that side away
constexpr int kFitted = 4;           // progress of what a rectangle was laid on
constexpr double kAllInView = 0.99;  // of a board, else one without its ends may be a larger one
constexpr std::size_t kNearest = 4;  // ends on each side that are limit points in any case

// ---- the surface: plane and threshold from the piece itself, and the piece from them

// The piece of the plane that has most in common with the one before.
std::vector<int> PieceAround(const BoardSearch& search, const Plane& plane,
                             const std::vector<int>& before) {
  const PlaneAxes axes(plane, search.At(before.front()).position);
  std::vector<int> inliers = InliersOf(search.window, axes, kThreshold * plane.sigma,
                                       kSquareShare * search.options.size.minCoeff());
  if (search.larger != nullptr) inliers = search.larger->Without(inliers, plane);
  std::vector<int> best;
  std::size_t most = 0;
  for (auto& piece : FindPieces(search.scan, search.window, inliers, plane,
                                search.options.size.minCoeff(), search.options.LongestDark())) {
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
  const std::string layers = segment->layers == 1 ? "only one layer meets"
                                                  : Text("only %.0f layers meet", segment->layers);
  return Reject(2,
                layers + Text(" the plane at %.1f m, %.0f are needed: bring the board nearer",
                              surface.origin().norm(), search.options.least_layers),
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
    segment->sensor_T_board.block<3, 1>(0, 2) = surface.plane().normal;
    segment->sensor_T_board.block<3, 1>(0, 3) = surface.origin();
    for (const int i : surface.piece()) {
      segment->too_large.push_back(&search.At(i) - search.scan.points.data());
    }
    Reject(1, std::string("the plane there is larger than the board") + kHoldAway, segment);
    return false;
  }
  return true;
}

// A board scatters about its plane as it does among neighbours; a plane laid through a board and
// other things does not.
bool IsFlat(const Surface& surface, BoardSegment* segment) {
  const double sigma = surface.plane().sigma, own = surface.OwnScatter();
  if (sigma <= kFlatness * own + kUneven) return true;
  Reject(3,
         Text("the surface is not flat (%.0f mm about its plane, %.0f mm among neighbours)",
              1e3 * sigma, 1e3 * own),
         segment);
  return false;
}

// solid: without ends that are much narrower than what is beside them.
std::optional<Surface> FindSurface(const BoardSearch& search, std::vector<int> piece, bool solid,
                                   BoardSegment* segment) {
  std::optional<std::vector<int>> refit = Refit(search, std::move(piece), segment);
  if (!refit) return std::nullopt;
  std::optional<Surface> surface = SurfaceOf(search, std::move(*refit), segment);
  if (!surface) return std::nullopt;
  std::vector<int> left = solid ? surface->WithoutNarrowEnds() : surface->WithoutOpenEnds();
  if (left.size() < surface->piece().size()) {
    if (static_cast<int>(left.size()) < search.options.least_points) {
      return Reject(2, "only posts are on the plane there, no surface between them", segment);
    }
    surface = SurfaceOf(search, std::move(left), segment);
  }
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
  for (const Run& run : FindRuns(search.scan, search.window, surface.piece(), surface.plane(),
                                 bridged, search.options.LongestDark())) {
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

// The board's rectangle in the axes of a surface nearly in its plane.
RectanglePose InPlaneOf(const Surface& surface, const BoardSegment& segment) {
  RectanglePose pose;
  pose.centre = surface.InPlane(segment.sensor_T_board.topRightCorner<3, 1>());
  const Eigen::Vector2d along =
      surface.axes().leftCols<2>().transpose() * segment.sensor_T_board.topLeftCorner<3, 1>();
  pose.angle = std::atan2(along.y(), along.x());
  return pose;
}

// Width and height of a surface along the axes of a rectangle.
Eigen::Vector2d SizeAlong(const BoardSearch& search, const Surface& surface,
                          const RectanglePose& pose) {
  Eigen::Vector2d size;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const int i : surface.piece()) {
      values.push_back(pose.ToBoard(surface.InPlane(search.At(i).position))[axis]);
    }
    std::sort(values.begin(), values.end());
    const std::size_t cut = values.size() / 100;
    size[axis] = values[values.size() - 1 - cut] - values[cut];
  }
  return size;
}

// Tells whether whole layers of the surface lie beyond the rectangle: it belongs to something
// larger.
//
// surface: all of it; its plane is nearly that in which the rectangle lies.
bool IsAll(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
           BoardSegment* segment) {
  const double margin = surface.Tolerance(), least = kWideLayer * search.options.size.minCoeff();
  std::size_t k = 0;
  for (const auto& end : surface.ends()) {
    int count = 0;
    bool is_beyond = true;
    double farthest = 0.0;
    for (; k < surface.piece().size() && surface.piece()[k] <= end.second; ++k, ++count) {
      const Eigen::Vector2d point = surface.InPlane(search.At(surface.piece()[k]).position);
      const double distance = SignedDistance(pose.ToBoard(point), surface.seen_half());
      is_beyond = is_beyond && distance > margin;
      farthest = std::max(farthest, distance);
    }
    const double wide = (search.At(end.second).position - search.At(end.first).position).norm();
    if (!is_beyond || wide < least || count * surface.StepOnBoard() < kSolid * wide) continue;
    if (farthest < kFarBeyond * search.options.size.minCoeff() + margin) continue;
    segment->measured_size = SizeAlong(search, surface, pose);
    Reject(5, SizeReason(segment->measured_size, search.options), segment);
    return false;
  }
  return true;
}

// The rectangle, from the ends of the layers where the surface does not go on beyond them.
std::optional<RectanglePose> FitToEnds(const BoardSearch& search, const Surface& surface,
                                       BoardSegment* segment) {
  const LayerBorders borders = FindBorders(surface);
  const Outline& outline = borders.outline;
  const std::size_t layers = surface.ends().size();
  if (outline.limits.size() < std::max<std::size_t>(4, layers - 1)) {
    return Reject(
        4,
        Text("only %.0f of %.0f ends of layers show a border", outline.limits.size(), 2.0 * layers),
        segment);
  }
  const RectanglePose pose =
      InMiddle(outline, surface.seen_half(), FitRectangle(outline, surface.seen_half()));
  SetPose(surface, pose, segment);
  if (!SizeFits(search, surface, pose, outline, segment) ||
      !BorderFits(surface, pose, borders, segment)) {
    return std::nullopt;
  }
  segment->unsure = !IsToldBySize(search, surface, pose, outline, segment);
  return pose;
}

// ---- the label

// An end of a layer that may be a limit point.
struct Limit {
  double inset;  // how far inside the outline, in beam steps
  std::int64_t index;
};

void AddLimit(const BoardSearch& search, const Surface& surface, const RectanglePose& pose, int i,
              int side, std::vector<Limit>* limits) {
  const BoardOptions& options = search.options;
  const Eigen::Vector2d point = pose.ToBoard(surface.InPlane(search.At(i).position));
  const double distance = SignedDistance(point, surface.seen_half());
  const double step = surface.StepOnBoard();
  if (!surface.IsHiddenBeside(i, side) && distance > -options.most_inside * step &&
      distance < options.border_tolerance + step) {
    limits->push_back({-distance / step, search.At(i).index});
  }
}

// Takes the half of the ends on one side that lies nearest to the border, four at least, and all
// others near to it. What lies farther inside tells less of where the border is.
void TakeNearest(double well_inside, std::vector<Limit> limits, std::vector<std::int64_t>* taken) {
  std::stable_sort(limits.begin(), limits.end(),
                   [](const Limit& a, const Limit& b) { return a.inset < b.inset; });
  const std::size_t least = std::max(kNearest, (limits.size() + 1) / 2);
  for (std::size_t k = 0; k < limits.size(); ++k) {
    if (k >= least && limits[k].inset > well_inside) break;
    taken->push_back(limits[k].index);
  }
}

void Label(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
           BoardSegment* segment) {
  const double step = surface.StepOnBoard(), margin = 0.01 + 0.5 * step;
  std::set<int> open = OpenLayers(search, surface, pose, margin);
  open.merge(LayersInDoubt(search, surface, pose, margin));
  std::map<int, std::pair<int, int>> ends;  // of the layers
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint& point = search.At(i);
    if (!surface.plane().Holds(point) || open.count(point.layer) != 0) continue;
    if (search.IsOfLarger(i, surface.plane())) continue;
    const Eigen::Vector2d on_board = pose.ToBoard(surface.InPlane(point.position));
    const double distance = SignedDistance(on_board, surface.seen_half());
    if (distance > margin) continue;
    const bool at_border = distance > -2.0 * step;
    if (at_border && (surface.IsMixed(i, -1) || surface.IsMixed(i, 1))) continue;
    segment->indices.push_back(point.index);
    ends.emplace(point.layer, std::make_pair(i, i)).first->second.second = i;
  }
  std::vector<Limit> first, last;
  for (const auto& item : ends) {
    AddLimit(search, surface, pose, surface.Trusted(item.second.first, 1), -1, &first);
    AddLimit(search, surface, pose, surface.Trusted(item.second.second, -1), 1, &last);
  }
  auto& limits = segment->limit_indices;
  TakeNearest(search.options.well_inside, std::move(first), &limits);
  TakeNearest(search.options.well_inside, std::move(last), &limits);
  std::sort(segment->indices.begin(), segment->indices.end());
  std::sort(limits.begin(), limits.end());
  limits.erase(std::unique(limits.begin(), limits.end()), limits.end());
  segment->layers = static_cast<int>(ends.size());
}

// What is found unsure is labeled, too, if nothing else speaks against it.
void LabelSurface(const BoardSearch& search, const Surface& surface, const RectanglePose& first,
                  BoardSegment* segment) {
  const auto restricted = Restrict(search, surface, first, segment);
  if (!restricted || !IsFlat(*restricted, segment)) return;
  const auto pose = FitToEnds(search, *restricted, segment);
  if (!pose || !IsAll(search, surface, InPlaneOf(surface, *segment), segment)) return;
  if (!FillsRectangle(search, *restricted, *pose, segment)) return;
  if (GoesOnBesideSide(search, *restricted, *pose, segment)) return;
  if (ReachesIntoLarger(search, *restricted, *pose, segment)) return;
  segment->detected = !segment->unsure;
  Label(search, *restricted, *pose, segment);
}

BoardSegment Judged(const BoardSearch& search, std::vector<int> piece, bool solid) {
  BoardSegment segment;
  const auto surface = FindSurface(search, std::move(piece), solid, &segment);
  if (!surface) return segment;
  const auto first = FitToRuns(search, *surface, &segment);
  if (!first) return segment;
  LabelSurface(search, *surface, *first, &segment);
  segment.unsure = segment.unsure && !segment.indices.empty();
  if (segment.indices.empty()) TellSquares(search, *surface, *first, &segment);
  return segment;
}

// Where layers are sparse, as the outer ones of a VLP-32C, one post may be all that they meet of
// what carries a board. The narrow end of a larger board that the view cuts looks the same.
BoardSegment JudgeSurface(const BoardSearch& search, std::vector<int> piece) {
  const BoardSegment segment = Judged(search, piece, false);
  if (segment.progress < kFitted || !segment.indices.empty()) return segment;
  const BoardSegment again = Judged(search, std::move(piece), true);
  return again.indices.empty() || again.in_view < kAllInView ? segment : again;
}

}  // namespace

std::string Text(const char* format, double a, double b, double c, double d) {
  char buffer[200];
  std::snprintf(buffer, sizeof buffer, format, a, b, c, d);
  return buffer;
}

BoardSegment JudgePiece(const BoardSearch& search, std::vector<int> piece) {
  if (!search.options.tells_size) return JudgeSurface(search, std::move(piece));
  BoardSegment segment = JudgeSurface(search, piece);
  TellSize(search, piece, &segment);
  return segment;
}

}  // namespace atom_core
