#include "cloud_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

#include "board_judgement.h"
#include "board_size.h"
#include "cloud_filling.h"
#include "cloud_label.h"
#include "cloud_patch.h"
#include "plane_points.h"
#include "rectangle_sides.h"
#include "view_edge.h"

namespace atom_core {
namespace {

constexpr int kCloudRefits = 3;
constexpr std::size_t kMostFitted = 200;    // points that a first rectangle is laid on
constexpr double kWidestSpacing = 1.0 / 8;  // of the shorter side: sparser points show no outline
constexpr double kCloudPixelShare = 0.008;  // of the diagonal
constexpr double kCloudFlatness = 2.0;      // of the scatter among neighbours, and
constexpr double kCloudUneven = 0.005;      // [m] about the plane are flat
constexpr double kLargest = 2.0;            // of the board's diagonal: a longer piece is none, if
constexpr double kLargestCore = 1.0;        // of the board's area are its core: posts have none
constexpr double kMuchLarger = 1.7;         // the same, however long it is
constexpr double kSmallest = 0.6;           // of that diagonal: so is a smaller one
constexpr double kNarrowest = 0.5;          // of its shorter side: strips where surfaces meet
constexpr double kFlattest = 75.0 * M_PI / 180.0;  // incidence
constexpr double kSlack = 6.0;                     // insets: the points fill less than the board
constexpr double kGoodSide = 0.5;                  // of its bins in view are on the border, and
constexpr double kLeastOfSide = 0.2;               // of them are in view
constexpr int kGoodSides = 3;
constexpr double kOpenSide = 0.2;        // of its bins, and more than on the border: a larger thing
constexpr double kOnShare = 0.7;         // of the bins that are not hidden or touched
constexpr double kCloudBorderRms = 0.6;  // of the spacing, and
constexpr double kBorderNoise = 0.012;   // [m] about the border, of large boards; of small ones
constexpr double kBorderOfSide = 0.04;   // of the shorter side

std::nullopt_t Refuse(int progress, const std::string& reason, BoardSegment* segment) {
  segment->progress = progress;
  segment->reason = reason;
  return std::nullopt;
}

std::vector<int> Around(const BoardSearch& search, const PlaneAxes& axes,
                        const std::vector<int>& before) {
  const std::vector<int> inliers = InliersOf(search.window, axes, kThreshold * axes.plane.sigma,
                                             kSquareShare * search.options.size.minCoeff());
  std::vector<int> best;
  std::size_t most = 0;
  for (auto& piece : ConnectedPieces(search.window, inliers, axes, search.options.size)) {
    if (piece.size() <= most) break;
    std::vector<int> common;
    std::set_intersection(piece.begin(), piece.end(), before.begin(), before.end(),
                          std::back_inserter(common));
    if (common.size() > most) most = common.size(), best = std::move(piece);
  }
  return best;
}

// Walls, floors and small things are known before anything is fitted.
bool IsOfSize(const BoardSearch& search, const std::vector<int>& piece, BoardSegment* segment) {
  if (static_cast<int>(piece.size()) < search.options.least_points) return true;
  const Eigen::Vector2d size = RoughSize(search, piece), board = search.options.size;
  const double longest = size.x() / board.norm();
  const bool is_strip = size.y() < kNarrowest * board.minCoeff();
  const double core = CoreOfPiece(search, piece) / board.prod();
  const bool is_small = core < (longest < kLargest ? kMuchLarger : kLargestCore);
  if (longest > kSmallest && is_small && !is_strip) return true;
  segment->sensor_T_board.block<3, 1>(0, 3) = search.At(piece.front()).position;
  const std::string how = longest < 1.0 || is_strip ? "smaller" : "larger";
  const std::string why = "the plane there is " + how + " than the board";
  Refuse(1, why + (how == "larger" ? kHoldAway : "") + "; " + SizeText(size, board), segment);
  return false;
}

std::optional<Patch> RefitPatch(const BoardSearch& search, std::vector<int> piece,
                                BoardSegment* segment) {
  Plane plane;
  for (int k = 0; k <= kCloudRefits; ++k) {
    if (static_cast<int>(piece.size()) < search.options.least_points) {
      return Refuse(0,
                    Text("only %.0f points are on the plane there, %.0f are needed", piece.size(),
                         search.options.least_points),
                    segment);
    }
    plane = FitPlane(search.window, piece);
    segment->plane_sigma = plane.sigma;
    if (plane.sigma > search.options.most_noise) {
      return Refuse(1, Text("the surface is not flat (%.0f mm about its plane)", 1e3 * plane.sigma),
                    segment);
    }
    if (k == kCloudRefits) break;
    const std::vector<int> before = std::move(piece);
    piece = Around(search, PlaneAxes(plane, search.At(before.front()).position), before);
    if (piece == before) break;
  }
  return MakePatch(search, plane, std::move(piece));
}

bool IsPossible(const BoardSearch& search, const Patch& patch, BoardSegment* segment) {
  const BoardOptions& options = search.options;
  const double spacing = patch.spacing.At({0.0, 0.0}),
               widest = kWidestSpacing * options.size.minCoeff();
  segment->spacing = spacing;
  segment->incidence = patch.incidence;
  if (patch.incidence > kFlattest) {
    Refuse(1, Text("the plane is seen too flat (%.0f degrees)", patch.incidence * 180.0 / M_PI),
           segment);
  } else if (spacing > widest) {
    Refuse(
        2,
        Text("only %.0f points are on the plane there, about %.0f are needed on the board: bring "
             "it nearer",
             patch.points.size(), options.size.prod() / (widest * widest)),
        segment);
  } else {
    return true;
  }
  return false;
}

bool IsFlat(const BoardSearch& search, const Patch& patch, BoardSegment* segment) {
  const double along = patch.axes.plane.sigma / std::max(std::cos(patch.incidence), kLeastCosine);
  if (along > search.options.most_noise + kCloudUneven) {
    Refuse(3, Text("the surface is not flat (%.0f mm along the beams)", 1e3 * along), segment);
    return false;
  }
  const double between = ScatterAmongNeighbours(search, patch);
  if (patch.axes.plane.sigma <= kCloudFlatness * between + kCloudUneven) return true;
  Refuse(3,
         Text("the surface is not flat (%.0f mm about its plane, %.0f mm among neighbours)",
              1e3 * patch.axes.plane.sigma, 1e3 * between),
         segment);
  return false;
}

void SetPose(const Patch& patch, const RectanglePose& pose, BoardSegment* segment) {
  const auto in_plane = patch.axes.axes.leftCols<2>();
  Eigen::Matrix2d turn;
  turn << std::cos(pose.angle), -std::sin(pose.angle), std::sin(pose.angle), std::cos(pose.angle);
  segment->sensor_T_board.topLeftCorner<3, 2>() = in_plane * turn;
  segment->sensor_T_board.block<3, 1>(0, 2) = patch.axes.plane.normal;
  segment->sensor_T_board.block<3, 1>(0, 3) = patch.axes.InSpace(pose.centre);
}

// A rectangle that holds as many points as it can.
RectanglePose FirstRectangle(const Patch& patch, const BoardOptions& options) {
  Outline outline;
  const std::vector<int> thin = Thinned(patch.points, kCloudPixelShare * options.size.norm());
  const std::size_t step = std::max<std::size_t>(thin.size() / kMostFitted, 1);
  for (std::size_t i = 0; i < thin.size(); i += step) {
    outline.inside.push_back(patch.points[thin[i]]);
  }
  return FitRectangle(outline, patch.half);
}

// Where the rectangle may be moved along its axes: flush with either end of the points, if it holds
// more than they fill.
std::vector<double> Places(const Patch& patch, const RectanglePose& pose, int axis, double inset) {
  std::vector<double> values;
  for (const Eigen::Vector2d& point : patch.points) values.push_back(pose.ToBoard(point)[axis]);
  std::sort(values.begin(), values.end());
  const std::size_t cut = values.size() / 200;
  const double low = values[cut], high = values[values.size() - 1 - cut], half = patch.half[axis];
  if (2.0 * half - (high - low) < kSlack * inset) return {0.0};
  return {0.0, low - inset + half, high + inset - half};
}

// Where a side is hidden, the rectangle may lie flush with the other one, and turned: of the places
// that hold the points, the one where most of the outline is seen.
RectanglePose BestPlace(const std::vector<PlaneReturn>& returns, const Patch& patch,
                        const RectanglePose& pose, const Sampling& sampling) {
  const double inset = 0.5 * sampling.spacing.At({0.0, 0.0});
  RectanglePose best = pose;
  std::ptrdiff_t most = -1;
  double box = 0.0;
  MeasurePiece(patch.points, 0.0, &box);
  for (const double angle : {pose.angle, box, box + M_PI / 2.0}) {
    RectanglePose turned = pose;
    turned.angle = angle;
    const auto along = Places(patch, turned, 0, inset), across = Places(patch, turned, 1, inset);
    if (along.size() * across.size() == 1 && angle == pose.angle) return pose;
    for (const double x : along) {
      for (const double y : across) {
        RectanglePose tried = turned;
        tried.centre += Eigen::Rotation2Dd(angle) * Eigen::Vector2d(x, y);
        std::ptrdiff_t on = 0;
        for (const auto& side : LookAlongSides(returns, tried, patch.half, sampling)) {
          on += std::count_if(side.begin(), side.end(), [](const auto& b) { return b.OnBorder(); });
        }
        if (on > most) most = on, best = tried;
      }
    }
  }
  return best;
}

// The same rectangle in the axes of another plane nearby.
RectanglePose Moved(const PlaneAxes& from, const RectanglePose& pose, const PlaneAxes& to) {
  RectanglePose moved = pose;
  moved.centre = to.InPlane(from.InSpace(pose.centre));
  const Eigen::Vector2d ahead(std::cos(pose.angle), std::sin(pose.angle));
  const Eigen::Vector2d turned = to.InPlane(from.InSpace(pose.centre + ahead)) - moved.centre;
  moved.angle = std::atan2(turned.y(), turned.x());
  return moved;
}

// The patch and its rectangle without what lies outside or at the rectangle's edge.
std::optional<Patch> Restrict(const BoardSearch& search, const Patch& patch, RectanglePose* pose,
                              BoardSegment* segment) {
  std::vector<int> inside;
  for (std::size_t i = 0; i < patch.points.size(); ++i) {
    const double distance = SignedDistance(pose->ToBoard(patch.points[i]), patch.half);
    if (distance < -0.5 * patch.spacing.At(patch.points[i])) inside.push_back(patch.piece[i]);
  }
  if (static_cast<int>(inside.size()) < search.options.least_points) {
    return Refuse(3,
                  Text("only %.0f points are within an outline of the board, %.0f are needed",
                       inside.size(), search.options.least_points),
                  segment);
  }
  const Plane plane = FitPlane(search.window, inside);
  Patch restricted = MakePatch(search, plane, std::move(inside));
  *pose = Moved(patch.axes, *pose, restricted.axes);
  return restricted;
}

std::vector<PlaneReturn> ReturnsNear(const BoardSearch& search, const Patch& patch) {
  std::vector<PlaneReturn> returns;
  const double thick = 0.1, wide = 1.3 * patch.half.norm() + 0.1;
  for (std::size_t i = 0; i < search.window.points.size(); ++i) {
    const Eigen::Vector3d& position = search.At(i).position;
    const double off = patch.axes.plane.Residual(position);
    if (std::abs(off) > thick) continue;
    const Eigen::Vector2d point = patch.axes.InPlane(position);
    if (point.norm() < wide) returns.push_back({point, off, static_cast<int>(i)});
  }
  return returns;
}

// ---- what the sides say

// Tells whether the sides show the outline of the board.
bool SidesFit(const Sides& sides, double shorter, BoardSegment* segment) {
  int good = 0, on = 0, all = 0, open = 0, bins = 0;
  double squares = 0.0, spacings = 0.0;
  bool goes_on = false;
  for (const auto& side : sides) {
    int here = 0, open_here = 0, in_view = 0;
    for (const SideBin& bin : side) {
      in_view += bin.in_view;
      const bool is_on = bin.OnBorder();
      here += is_on;
      open_here += bin.GoesOn();
      all += bin.GoesOn() || (bin.in_view && !bin.hidden && TouchMargin(bin, 0.01) == 0.0);
      if (is_on) squares += std::pow(bin.beyond + bin.inset, 2), spacings += bin.spacing;
    }
    on += here;
    open += open_here;
    bins += static_cast<int>(side.size());
    goes_on |= open_here > std::max<double>(here, kOpenSide * side.size());
    good += in_view >= kLeastOfSide * side.size() && here >= kGoodSide * in_view;
  }
  segment->border_rms = std::sqrt(squares / std::max(on, 1));
  const double most = std::min(kBorderNoise, kBorderOfSide * shorter) +
                      kCloudBorderRms * spacings / std::max(on, 1);
  if (!goes_on && good >= kGoodSides && on >= kOnShare * all && segment->border_rms < most) {
    return true;
  }
  std::string reason =
      Text("the outline is not the board's (%.0f %% of it seen on %.0f sides, %.0f mm RMS)",
           100.0 * on / std::max(bins, 1), good, 1e3 * segment->border_rms);
  if (goes_on || open > 0.25 * bins) reason = "the surface goes on beyond the board's outline";
  Refuse(4, reason, segment);
  return false;
}

// The reason of a wrong outline is a wrong size, where there is one, or that its end is out of
// view.
void TellWhy(const Patch& patch, const View& view, const BoardOptions& options,
             BoardSegment* segment) {
  if (!view.edges.empty()) {
    segment->reason += "; the edge of the field of view cuts what is there";
    return;
  }
  const Eigen::Vector2d size = SizeOfPiece(patch, options), beam = 2.0 * patch.half - options.size;
  const Eigen::Vector2d error = (size - beam - options.size).cwiseAbs();
  const double most = 0.5 * patch.spacing.At({0.0, 0.0}) + 0.01;
  if ((error.array() < kSizeTolerance * options.size.array() + most).all()) return;
  segment->measured_size = size - beam;
  segment->reason = SizeText(segment->measured_size, options.size);
}

bool SizeFits(const MeasuredSize& measured, const Patch& patch, const View& view,
              const BoardOptions& options, BoardSegment* segment) {
  segment->measured_size = measured.size - (2.0 * patch.half - options.size);
  bool fits = true;
  Eigen::Vector2d shown = segment->measured_size;
  const bool is_whole = view.edges.empty() && shown.array().isFinite().all();
  for (int axis = 0; axis < 2; ++axis) {
    const double expected = options.size[axis];
    if (!std::isfinite(shown[axis])) {
      shown[axis] = expected;
      continue;
    }
    const double most = std::min(kSizeTolerance * expected + kSizeSigmas * measured.sigma[axis],
                                 (is_whole ? kMostSizeError : kMostCutError) * expected);
    fits &= std::abs(shown[axis] - expected) < most;
  }
  if (!segment->measured_size.array().isFinite().any()) {
    Refuse(5, "no two opposite sides of the plane there are seen", segment);
    return false;
  }
  if (!fits) Refuse(5, SizeText(shown, options.size), segment);
  return fits;
}

bool IsFilled(const CellShares& cells, const BoardOptions& options, BoardSegment* segment) {
  segment->visible = cells.there;
  segment->in_view = cells.in_view;
  segment->hidden = cells.nearer;
  segment->through = cells.farther;
  segment->score = segment->border_rms / options.border_tolerance +
                   std::max(0.0, 1.0 - cells.there) + 2.0 * cells.farther;
  if (cells.in_view < options.least_of_outline) {
    Refuse(6,
           Text("only %.0f %% of the board would be in the field of view, %.0f %% are needed",
                100.0 * cells.in_view, 100.0 * options.least_of_outline),
           segment);
  } else if (cells.farther > options.most_through) {
    Refuse(6, Text("%.0f %% of the board's place is seen through", 100.0 * cells.farther), segment);
  } else if (cells.there < options.least_visible ||
             cells.there + cells.nearer + cells.enclosed < options.least_coverage) {
    Refuse(6,
           Text("only %.0f %% of the board's place has points (%.0f %% is hidden)",
                100.0 * cells.there, 100.0 * cells.nearer),
           segment);
  } else {
    return true;
  }
  return false;
}

}  // namespace

std::optional<Patch> FitCloudPiece(const BoardSearch& search, std::vector<int> piece,
                                   BoardSegment* segment) {
  if (!IsOfSize(search, piece, segment)) return std::nullopt;
  auto patch = RefitPatch(search, std::move(piece), segment);
  // A piece of a plane that was a little off may have grown.
  if (!patch || !IsOfSize(search, patch->piece, segment) || !IsPossible(search, *patch, segment)) {
    return std::nullopt;
  }
  return patch;
}

BoardSegment JudgeCloudPiece(const BoardSearch& search, std::vector<int> piece) {
  BoardSegment segment;
  const auto patch = FitCloudPiece(search, std::move(piece), &segment);
  return patch ? JudgeCloudPatch(search, *patch, segment) : segment;
}

BoardSegment JudgeCloudPatch(const BoardSearch& search, const Patch& patch, BoardSegment segment) {
  const BoardOptions& options = search.options;
  RectanglePose pose = FirstRectangle(patch, options);
  SetPose(patch, pose, &segment);
  const auto board = Restrict(search, patch, &pose, &segment);
  if (!board || !IsPossible(search, *board, &segment) || !IsFlat(search, *board, &segment)) {
    return segment;
  }
  const std::vector<PlaneReturn> returns = ReturnsNear(search, *board);
  const View view =
      FindView(search.scan, board->axes, options.size.norm(), board->spacing.At({0.0, 0.0}));
  const Sampling sampling =
      MeasureSampling(returns, pose, board->half, board->spacing, board->axes.plane.sigma, view);
  segment.spacing = sampling.spacing.At({0.0, 0.0});
  if (segment.spacing > kWidestSpacing * options.size.minCoeff()) {
    Refuse(3,
           Text("points on the plane there are too sparse (%.0f mm apart)", 1e3 * segment.spacing),
           &segment);
    return segment;
  }
  pose = BestPlace(returns, *board, pose, sampling);
  pose = RefineBySides(returns, pose, board->half, sampling);
  SetPose(*board, pose, &segment);
  Sides sides = LookAlongSides(returns, pose, board->half, sampling);
  double widest = 0.0;
  for (const auto& side : sides) {
    for (const SideBin& bin : side) widest = std::max(widest, bin.spacing);
  }
  const CellShares cells = LookAtCells(search.scan, view, pose, board->half, widest, &sides);
  if (!SidesFit(sides, options.size.minCoeff(), &segment)) {
    TellWhy(patch, view, options, &segment);
    return segment;
  }
  if (!SizeFits(MeasureSides(sides, board->half), *board, view, options, &segment)) {
    if (!segment.measured_size.allFinite()) TellWhy(patch, view, options, &segment);
    return segment;
  }
  if (!IsFilled(cells, options, &segment)) return segment;
  segment.detected = true;
  LabelCloudBoard(search, *board, pose, returns, sides, &segment);
  return segment;
}

}  // namespace atom_core
