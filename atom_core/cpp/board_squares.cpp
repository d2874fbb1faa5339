#include "board_squares.h"

#include <cmath>
#include <utility>
#include <vector>

#include "board_judgement.h"
#include "median.h"

namespace atom_core {
namespace {

constexpr double kLeastBehind = 0.02;          // [m] along the beam,
constexpr double kMostBehind = 0.15;           // and at most
constexpr double kMostSquareScatter = 0.02;    // [m] of these about their median
constexpr std::size_t kLeastSquares = 8;       // between white ones
constexpr std::size_t kLeastDarkReturns = 12;  // from them
constexpr double kLeastBetween = 0.5;          // of what is behind lies between white ones
constexpr int kSquaresProgress = 6;            // it has the board's squares

// How far [m] beyond the plane a beam went.
double BeyondPlane(const Plane &plane, const ScanPoint &point) {
  return point.range - plane.distance * point.range / plane.normal.dot(point.position);
}

// What is behind a plane within an outline: between two returns on it that are
// no farther apart than squares are, or not.
struct Behind {
  std::vector<double> between;  // [m] along the beams
  std::size_t squares = 0, others = 0;
};

Behind LookBehind(const BoardSearch &search, const Surface &surface, const RectanglePose &pose) {
  Behind behind;
  std::vector<double> open;  // since the last return on the plane
  int last = -1, layer = -1;
  const double longest = search.options.LongestDark() + 2.0 * surface.StepOnBoard();
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint &point = search.At(i);
    Eigen::Vector2d p;
    if (!surface.Meets(point.position / point.range, &p)) continue;
    if (SignedDistance(pose.ToBoard(p), surface.seen_half()) > 0.0) continue;
    if (point.layer != layer) {
      behind.others += open.size();
      open.clear(), last = -1, layer = point.layer;
    }
    if (!surface.plane().Holds(point)) {
      const double beyond = BeyondPlane(surface.plane(), point);
      if (search.IsOfLarger(i, surface.plane())) {
        ++behind.others;
      } else if (beyond > kLeastBehind) {
        open.push_back(beyond);
      }
      continue;
    }
    const bool is_square =
        !open.empty() && last >= 0 && (search.At(last).position - point.position).norm() < longest;
    if (is_square) {
      behind.between.insert(behind.between.end(), open.begin(), open.end());
      ++behind.squares;
    } else {
      behind.others += open.size();
    }
    open.clear(), last = i;
  }
  behind.others += open.size();
  return behind;
}

}  // namespace

void TellSquares(const BoardSearch &search, const Surface &surface, const RectanglePose &pose,
                 BoardSegment *segment) {
  if (search.options.dark <= 0.0) return;
  const Behind behind = LookBehind(search, surface, pose);
  const double all = behind.between.size() + behind.others;
  if (behind.squares < kLeastSquares || behind.between.size() < kLeastDarkReturns ||
      behind.between.size() < kLeastBetween * all) {
    return;
  }
  const double middle = Median(behind.between);
  std::vector<double> off;
  for (const double beyond : behind.between) off.push_back(std::abs(beyond - middle));
  if (middle < kLeastApart || middle > kMostBehind ||
      1.4826 * Median(std::move(off)) > kMostSquareScatter)
    return;
  Reject(kSquaresProgress,
         Text("returns from the black squares lie %.0f mm behind those from "
              "the white ones",
              1e3 * middle) +
             ", so that they are on no plane: the sensor's ranges depend on "
             "brightness; print the "
             "black in grey, or hold the board nearer or farther away",
         segment);
}

}  // namespace atom_core
