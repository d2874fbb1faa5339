#include "board_size.h"

#include <algorithm>
#include <cmath>

#include "board_judgement.h"
#include "plane_points.h"

namespace atom_core {
namespace {

constexpr double kSizeSteps = 0.5;      // beam steps that a size may be off beside its tolerance
constexpr double kMostSmaller = 0.035;  // of a side: nothing makes a board look smaller
constexpr int kLeastEnds = 2;           // of layers, on each of two opposite sides of it
constexpr double kMostGap = 0.25;       // of the shorter side, to the layer beyond a board's end
constexpr double kWideBeamSteps = 2.0;  // by which beams of unknown width may enlarge a board

// By how much [m] beams of unknown width may enlarge a board.
double Widening(const BoardSearch& search, const Surface& surface) {
  return search.options.beam_width > 0.0 ? 0.0 : kWideBeamSteps * surface.StepOnBoard();
}

// Why nothing tells where a surface ends beyond its lowest or its highest layer; empty if the next
// layer of the scan passes near by.
std::string WhyOpen(const BoardSearch& search, const Surface& surface) {
  const std::vector<double>& elevation = search.scan.layer_elevation;
  const double most = kMostGap * search.options.size.minCoeff();
  double widest = 0.0;
  for (const int step : {-1, 1}) {
    const auto& end = step < 0 ? surface.ends().front() : surface.ends().back();
    const int next = search.At(end.first).layer + step;
    if (next < 0 || next >= static_cast<int>(elevation.size())) {
      return "the sensor's lowest or highest layer cuts it: bring all of it into view";
    }
    widest = std::max(widest, surface.ToLayer((end.first + end.second) / 2, elevation[next]));
  }
  if (widest <= most) return "";
  return Text(
      "the sensor's layers are %.0f cm apart where it ends: bring it to where they are dense",
      100.0 * widest);
}

}  // namespace

std::string SizeText(const Eigen::Vector2d& measured, const Eigen::Vector2d& configured) {
  return Text("the plane there measures %.2f x %.2f m; the configuration says %.2f x %.2f",
              measured.x(), measured.y(), configured.x(), configured.y());
}

void TellSize(const BoardSearch& search, const std::vector<int>& piece, BoardSegment* segment) {
  if (segment->detected || segment->unsure || piece.size() < 3) return;
  if (segment->reason.find("measures") != std::string::npos) return;
  const PlaneAxes axes(FitPlane(search.window, piece), search.At(piece.front()).position);
  PlanePoints points;
  for (const int i : piece) points.push_back(axes.InPlane(search.At(i).position));
  const Eigen::Vector2d size = MeasurePiece(points, 0.0), board = search.options.size;
  segment->reason += "; " + SizeText(board.x() >= board.y() ? size : size.reverse().eval(), board);
}

std::string SizeReason(const Eigen::Vector2d& measured, const BoardOptions& options) {
  for (int axis = 0; axis < 2; ++axis) {
    if (std::isfinite(measured[axis])) continue;
    return Text(
        "a side of the plane there measures %.2f m; the configuration says %.2f x %.2f, of which "
        "that side is to be %.2f",
        measured[1 - axis], options.size.x(), options.size.y(), options.size[1 - axis]);
  }
  return SizeText(measured, options.size);
}

bool SizeFits(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
              const Outline& outline, BoardSegment* segment) {
  Eigen::Vector2d sigma;
  segment->measured_size = MeasureSize(outline.limits, pose, surface.seen_half(), &sigma);
  segment->measured_size -= 2.0 * (surface.seen_half() - search.HalfSize());
  const double step = surface.StepOnBoard(), wide = Widening(search, surface);
  for (int axis = 0; axis < 2; ++axis) {
    const double expected = search.options.size[axis];
    const double off = segment->measured_size[axis] - expected;
    const double most = kSizeTolerance * expected + kSizeSigmas * sigma[axis] + kSizeSteps * step;
    const double limit = kMostSizeError * expected;
    if (std::isfinite(off) &&
        (off < -std::min(most, kMostSmaller * expected) || off > std::min(most + wide, limit))) {
      Reject(5, SizeReason(segment->measured_size, search.options), segment);
      return false;
    }
  }
  return true;
}

bool IsToldBySize(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                  const Outline& outline, BoardSegment* segment) {
  const std::string open = WhyOpen(search, surface);
  if (open.empty()) return true;
  const Eigen::Vector2d half = surface.seen_half();
  const Eigen::Vector2d measured = MeasureSize(outline.limits, pose, half, nullptr, kLeastEnds) -
                                   2.0 * (half - search.HalfSize());
  const Eigen::Vector2d off = measured - search.options.size;
  const double wide = Widening(search, surface);
  bool one = false, all = true;
  for (int axis = 0; axis < 2; ++axis) {
    if (!std::isfinite(off[axis])) continue;
    one = true;
    const double least = kMostCutError * search.options.size[axis];
    const double most = std::min(least + wide, kMostSizeError * search.options.size[axis]);
    all = all && off[axis] >= -least && off[axis] <= most;
  }
  if (one && all) return true;
  const std::string reason =
      one ? SizeReason(measured, search.options)
          : "no two opposite sides of the plane there are seen, so that its size is not known";
  Reject(7, reason + "; " + open + ", or let a camera see it, too", segment);
  return false;
}

}  // namespace atom_core
