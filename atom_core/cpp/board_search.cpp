// Boards in a whole scan: seeds from straight runs of returns, then the segmentation at each seed.

#include <algorithm>
#include <cmath>
#include <vector>

#include "atom_core/board_segmentation.h"
#include "cloud_board.h"

namespace atom_core {
namespace {

constexpr double kJump = 0.10;      // [m] of range, between a surface and the next
constexpr double kGapSteps = 4.5;   // of azimuth, without returns
constexpr double kStraight = 0.05;  // [m] a run may deviate from its chord
constexpr int kLeastReturns = 4;
constexpr double kPatch = 0.45;  // of the shorter side: radius in which a plane is proposed
constexpr int kManyLayers = 8;
constexpr double kBorderRms = 0.03;  // [m] of the layers' ends
constexpr double kSizeError = 0.06;  // of what is measured of the size
constexpr double kApart = 0.3;       // of the shorter side: nearer seeds are one

struct StraightRun {
  Eigen::Vector3d middle;
  int returns;
};

std::vector<const ScanPoint*> LayerByLayer(const Scan& scan) {
  std::vector<const ScanPoint*> sorted;
  for (const ScanPoint& point : scan.points) sorted.push_back(&point);
  std::sort(sorted.begin(), sorted.end(), [](const ScanPoint* a, const ScanPoint* b) {
    if (a->layer != b->layer) return a->layer < b->layer;
    return a->azimuth != b->azimuth ? a->azimuth < b->azimuth : a->index < b->index;
  });
  return sorted;
}

bool IsStraight(const std::vector<const ScanPoint*>& points, std::size_t first, std::size_t last) {
  const Eigen::Vector3d start = points[first]->position;
  const Eigen::Vector3d along = (points[last]->position - start).normalized();
  for (std::size_t i = first; i <= last; ++i) {
    const Eigen::Vector3d offset = points[i]->position - start;
    if ((offset - along * along.dot(offset)).norm() > kStraight) return false;
  }
  return true;
}

// Runs that may be a cut through a board. One across the seam of the azimuth is two shorter ones.
std::vector<StraightRun> FindStraightRuns(const Scan& scan, const Eigen::Vector2d& size) {
  const std::vector<const ScanPoint*> points = LayerByLayer(scan);
  const double shortest = 0.25 * size.minCoeff(), longest = 1.15 * size.norm();
  std::vector<StraightRun> runs;
  for (std::size_t first = 0, i = 1; i <= points.size(); ++i) {
    const bool goes_on =
        i < points.size() && points[i]->layer == points[i - 1]->layer &&
        std::abs(points[i]->range - points[i - 1]->range) < kJump &&
        points[i]->azimuth - points[i - 1]->azimuth < kGapSteps * scan.azimuth_step;
    if (goes_on) continue;
    const double length = (points[i - 1]->position - points[first]->position).norm();
    const int returns = static_cast<int>(i - first);
    if (returns >= kLeastReturns && length > shortest && length < longest &&
        IsStraight(points, first, i - 1)) {
      runs.push_back({(points[first]->position + points[i - 1]->position) / 2.0, returns});
    }
    first = i;
  }
  std::stable_sort(runs.begin(), runs.end(), [](const StraightRun& a, const StraightRun& b) {
    return a.returns > b.returns;
  });
  return runs;
}

// One seed for runs side by side; there must be as many of them as a board has layers.
std::vector<Eigen::Vector3d> Seeds(const Scan& scan, const BoardOptions& options) {
  const std::vector<StraightRun> runs = FindStraightRuns(scan, options.size);
  std::vector<Eigen::Vector3d> seeds;
  for (const StraightRun& run : runs) {
    const double apart = kApart * options.size.minCoeff();
    if (std::any_of(seeds.begin(), seeds.end(), [&](const Eigen::Vector3d& seed) {
          return (seed - run.middle).norm() < apart;
        })) {
      continue;
    }
    const auto beside = std::count_if(runs.begin(), runs.end(), [&](const StraightRun& other) {
      return (other.middle - run.middle).norm() < 0.6 * options.size.norm();
    });
    if (beside >= options.least_layers - 1) seeds.push_back(run.middle);
  }
  return seeds;
}

// Many layers must show two opposite sides: without a seed, a hidden wall has one side at most.
bool IsConvincing(const BoardSegment& segment, const BoardOptions& options) {
  if (segment.border_rms > kBorderRms) return false;
  int measured = 0;
  for (int axis = 0; axis < 2; ++axis) {
    const double size = segment.measured_size[axis];
    if (!std::isfinite(size)) continue;
    if (std::abs(size / options.size[axis] - 1.0) > kSizeError) return false;
    ++measured;
  }
  return measured > 0 || segment.layers < kManyLayers;
}

// Without a seed to trust, the board must be seen better.
BoardOptions Strict(BoardOptions options) {
  options.least_layers = std::max(options.least_layers, 6);
  options.least_visible = std::max(options.least_visible, 0.75);
  options.least_in_view = std::max(options.least_in_view, 0.85);
  options.most_through = std::min(options.most_through, 0.04);
  return options;
}

Eigen::Vector3d Middle(const BoardSegment& segment) {
  return segment.sensor_T_board.topRightCorner<3, 1>();
}

}  // namespace

std::vector<BoardSegment> FindBoards(const Scan& scan, const BoardOptions& options) {
  if (!scan.has_layers) return FindCloudBoards(scan, options);
  BoardOptions here =
      Strict(options);  // a seed is on the board, if there is one: its plane comes first
  here.seed_radius = kPatch * options.size.minCoeff() / options.size.norm();
  here.most_planes = 1;
  const BoardOptions strict = Strict(options);
  std::vector<BoardSegment> boards;
  for (const Eigen::Vector3d& seed : Seeds(scan, options)) {
    BoardSegment board = SegmentBoard(scan, seed, here);
    if (!board.detected) continue;
    board = SegmentBoard(scan, Middle(board), strict);  // the same from wherever it was found
    const auto is_same = [&](const BoardSegment& other) {
      return (Middle(other) - Middle(board)).norm() < 0.5 * options.size.minCoeff();
    };
    if (board.detected && IsConvincing(board, options) &&
        std::none_of(boards.begin(), boards.end(), is_same)) {
      boards.push_back(board);
    }
  }
  std::stable_sort(boards.begin(), boards.end(),
                   [](const BoardSegment& a, const BoardSegment& b) { return a.score < b.score; });
  return boards;
}

}  // namespace atom_core
