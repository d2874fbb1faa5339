#include "board_contact.h"

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "board_judgement.h"

namespace atom_core {
namespace {

constexpr double kTouchingOff = 0.1;      // [m] off the plane,
constexpr double kTouchingBeside = 0.12;  // and from the outline, where something larger touches it
constexpr int kLeastTouching = 5;         // returns of that
constexpr double kBlurredShare = 0.1;  // of the shorter side: noise takes returns of either there
constexpr int kLeastBeamsOff = 8;      // beams of a layer that are not on the board
constexpr double kWholeInView = 0.85;
constexpr double kMostOfLength = 0.62;
constexpr double kDoubtful = 0.2;  // of a layer's returns on a board
constexpr int kContactProgress = 6;

bool Touches(const BoardSearch &search, const Surface &surface, const RectanglePose &pose) {
  int touching = 0;
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint &point = search.At(i);
    if (std::abs(surface.plane().Residual(point.position)) > kTouchingOff) continue;
    const Eigen::Vector2d place = pose.ToBoard(surface.InPlane(point.position));
    if (SignedDistance(place, surface.seen_half()) > kTouchingBeside) continue;
    if (search.IsOfLarger(i, surface.plane()) && ++touching == kLeastTouching) return true;
  }
  return false;
}

// Tells whether the size of what touches something larger is known: it is in view, opposite sides
// of it are seen, and most of its length where they are not.
bool IsToldBeside(const BoardSearch &search, const Surface &surface, const RectanglePose &pose,
                  const BoardSegment &segment) {
  if (segment.in_view < kWholeInView || !segment.measured_size.array().isFinite().any()) {
    return false;
  }
  Eigen::Array2d low = search.options.size, high = -search.options.size;
  for (const int i : surface.piece()) {
    const Eigen::Array2d place = pose.ToBoard(surface.InPlane(search.At(i).position));
    low = low.min(place), high = high.max(place);
  }
  for (int axis = 0; axis < 2; ++axis) {
    const bool is_measured = std::isfinite(segment.measured_size[axis]);
    const double least = kMostOfLength * search.options.size[axis];
    if (!is_measured && high[axis] - low[axis] < least) return false;
  }
  return true;
}

}  // namespace

bool ReachesIntoLarger(const BoardSearch &search, const Surface &surface, const RectanglePose &pose,
                       BoardSegment *segment) {
  if (search.larger == nullptr || !Touches(search, surface, pose)) return false;
  if (!IsToldBeside(search, surface, pose, *segment)) {
    Reject(kContactProgress,
           "too little of the plane there is seen to tell its size, and a larger surface, as a "
           "wall or the floor, touches it: hold it farther away from that",
           segment);
    return true;
  }
  const Eigen::Vector2d half = surface.seen_half();
  const double deep = surface.StepOnBoard() + kBlurredShare * search.options.size.minCoeff();
  std::map<int, std::pair<int, int>> layers;  // beams well inside that are on the board, or not
  int off = 0, all = 0;
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint &point = search.At(i);
    Eigen::Vector2d p;
    if (!surface.Meets(point.position / point.range, &p)) continue;
    if (SignedDistance(pose.ToBoard(p), half) > -deep) continue;
    const bool on = surface.plane().Holds(point) && !search.IsOfLarger(i, surface.plane());
    std::pair<int, int> &layer = layers[point.layer];
    ++(on ? layer.first : layer.second), ++all;
    off += on ? 0 : 1;
  }
  bool reaches = off > search.options.most_through * all;
  for (const auto &layer : layers) {
    reaches |= layer.second.second >= kLeastBeamsOff && layer.second.second > layer.second.first;
  }
  if (reaches) {
    Reject(kContactProgress,
           "a larger surface, as a wall or the floor, begins where the board "
           "would be: hold "
           "it farther away from that",
           segment);
  }
  return reaches;
}

std::set<int> LayersInDoubt(const BoardSearch &search, const Surface &surface,
                            const RectanglePose &pose, double margin) {
  std::set<int> doubtful;
  if (search.larger == nullptr) return doubtful;
  std::map<int, std::pair<int, int>> layers;  // returns on the plane; of them of something larger
  const int count = static_cast<int>(search.window.points.size());
  for (int i = 0; i < count; ++i) {
    const ScanPoint &point = search.At(i);
    if (!surface.plane().Holds(point)) continue;
    const Eigen::Vector2d place = pose.ToBoard(surface.InPlane(point.position));
    if (SignedDistance(place, surface.seen_half()) > margin) continue;
    std::pair<int, int> &layer = layers[point.layer];
    ++layer.first, layer.second += search.IsOfLarger(i, surface.plane()) ? 1 : 0;
  }
  for (const auto &layer : layers) {
    if (layer.second.second > kDoubtful * layer.second.first) doubtful.insert(layer.first);
  }
  return doubtful;
}

}  // namespace atom_core
