// Boards in a whole scan: seeds from straight runs of returns, then the segmentation at each seed.

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "atom_core/board_segmentation.h"
#include "cloud_board.h"

namespace atom_core {
namespace {

constexpr double kJump = 0.10;         // [m] of range, between a surface and the next
constexpr double kGapSteps = 4.5;      // of azimuth, without returns
constexpr double kStraightRun = 0.05;  // [m] a run may deviate from its chord
constexpr int kLeastReturns = 4;
constexpr double kPatch = 0.45;  // of the shorter side: radius in which a plane is proposed
constexpr int kManyLayers = 8;
constexpr double kLittle = 0.1;  // of the board may be hidden where no side is measured
constexpr int kWorthNaming = 4;  // progress of what is named where there is no board: has its size
constexpr double kBorderRms = 0.03;   // [m] of the layers' ends
constexpr double kBend = 0.022;       // [m] of smoothed returns from a chord: the run is cut there
constexpr std::size_t kSmoothed = 3;  // returns on each side are averaged, and
constexpr double kSmoothedOver = 0.06;  // [m] on each side
constexpr double kBesideEnd = 0.12;     // [m] within which a part of a run must end, to stand out
constexpr double kApart = 0.3;          // of the shorter side: nearer seeds are one
constexpr double kKnownShare = 0.7;     // of a run's returns are on what is known
constexpr double kKnownSigmas = 0.5;    // by which their mean may be off its plane, or
constexpr double kKnownOff = 0.008;     // [m]

struct StraightRun {
  Eigen::Vector3d middle;
  int first, returns;  // in Scan::by_azimuth
};

std::vector<const ScanPoint*> LayerByLayer(const Scan& scan) {
  std::vector<const ScanPoint*> sorted;
  for (const int i : scan.by_azimuth) sorted.push_back(&scan.points[i]);
  return sorted;
}

bool IsStraight(const std::vector<const ScanPoint*>& points, std::size_t first, std::size_t last) {
  const Eigen::Vector3d start = points[first]->position;
  const Eigen::Vector3d along = (points[last]->position - start).normalized();
  for (std::size_t i = first; i <= last; ++i) {
    const Eigen::Vector3d offset = points[i]->position - start;
    if ((offset - along * along.dot(offset)).norm() > kStraightRun) return false;
  }
  return true;
}

// Tells whether a surface goes on from one return to the next.
bool GoesOn(const Scan& scan, const ScanPoint& a, const ScanPoint& b, double dark) {
  if (a.layer != b.layer || std::abs(b.range - a.range) >= kJump) return false;
  return b.azimuth - a.azimuth < kGapSteps * scan.azimuth_step ||
         (b.position - a.position).norm() < dark;
}

// The return between two others that is farthest from the line through them; where none is farther
// than a bend, the first.
std::size_t Farthest(const std::vector<Eigen::Vector3d>& smooth, std::size_t first,
                     std::size_t last) {
  const Eigen::Vector3d start = smooth[first], along = (smooth[last] - start).normalized();
  std::size_t farthest = first;
  double most = kBend;
  for (std::size_t i = first + 1; i < last; ++i) {
    const Eigen::Vector3d offset = smooth[i] - start;
    const double off = (offset - along * along.dot(offset)).norm();
    if (off > most) most = off, farthest = i;
  }
  return farthest;
}

void Cut(const std::vector<Eigen::Vector3d>& smooth, std::size_t first, std::size_t last,
         std::vector<std::size_t>* cuts) {
  const std::size_t farthest = Farthest(smooth, first, last);
  if (farthest == first) return;
  Cut(smooth, first, farthest, cuts);
  cuts->push_back(farthest);
  Cut(smooth, farthest, last, cuts);
}

// Where a run bends or steps, as where a board hangs before a wall; its first and last return, too.
// What was cut to begin with need not be a bend of the parts beside it.
std::vector<std::size_t> Bends(const std::vector<Eigen::Vector3d>& smooth) {
  std::vector<std::size_t> cuts{0}, bends{0};
  Cut(smooth, 0, smooth.size() - 1, &cuts);
  cuts.push_back(smooth.size() - 1);
  for (std::size_t k = 1; k + 1 < cuts.size(); ++k) {
    if (Farthest(smooth, bends.back(), cuts[k + 1]) != bends.back()) bends.push_back(cuts[k]);
  }
  bends.push_back(cuts.back());
  return bends;
}

// Each return's mean with those near it, up to three on each side, as many on both.
std::vector<Eigen::Vector3d> Smoothed(const std::vector<const ScanPoint*>& points,
                                      std::size_t first, std::size_t last) {
  std::vector<Eigen::Vector3d> smooth;
  for (std::size_t i = first; i <= last; ++i) {
    const Eigen::Vector3d here = points[i]->position;
    Eigen::Vector3d sum = here;
    std::size_t k = 0;
    while (k < kSmoothed && i >= first + k + 1 && i + k + 1 <= last) {
      const Eigen::Vector3d &before = points[i - k - 1]->position,
                            &after = points[i + k + 1]->position;
      if (k > 0 && std::max((before - here).norm(), (after - here).norm()) > kSmoothedOver) break;
      sum += before + after;
      ++k;
    }
    smooth.push_back(sum / (2 * k + 1));
  }
  return smooth;
}

// Tells whether a run leaves the line of one of its parts soon after each end of that. A board does
// so; an arc, as of a layer on the floor, turns away slowly.
bool StandsOut(const std::vector<Eigen::Vector3d>& smooth, std::size_t first, std::size_t last) {
  const Eigen::Vector3d start = smooth[first], along = (smooth[last] - start).normalized();
  const double length = (smooth[last] - start).norm();
  const auto leaves = [&](std::size_t i, double beyond) {
    const Eigen::Vector3d offset = smooth[i] - start;
    const double off = (offset - along * along.dot(offset)).norm();
    return off > kBend && beyond < kBesideEnd + off;
  };
  bool before = first == 0, after = last + 1 == smooth.size();
  for (std::size_t i = first; i-- > 0 && !before;) {
    const double beyond = -along.dot(smooth[i] - start);
    before = i == 0 || leaves(i, beyond);
    if (beyond > kBesideEnd) break;
  }
  for (std::size_t i = last + 1; i < smooth.size() && !after; ++i) {
    const double beyond = along.dot(smooth[i] - start) - length;
    after = i + 1 == smooth.size() || leaves(i, beyond);
    if (beyond > kBesideEnd) break;
  }
  return before && after;
}

// Runs that may be a cut through a board. One across the seam of the azimuth is two shorter ones.
std::vector<StraightRun> FindStraightRuns(const Scan& scan, const BoardOptions& options) {
  const std::vector<const ScanPoint*> points = LayerByLayer(scan);
  const double shortest = 0.25 * options.size.minCoeff(), longest = 1.15 * options.size.norm();
  std::vector<StraightRun> runs;
  const auto add = [&](std::size_t first, std::size_t last) {
    const double length = (points[last]->position - points[first]->position).norm();
    const int returns = static_cast<int>(last - first) + 1;
    if (returns < kLeastReturns || length < shortest || length > longest) return false;
    if (!IsStraight(points, first, last)) return false;
    const Eigen::Vector3d middle = (points[first]->position + points[last]->position) / 2.0;
    runs.push_back({middle, static_cast<int>(first), returns});
    return true;
  };
  for (std::size_t first = 0, i = 1; i <= points.size(); ++i) {
    if (i < points.size() && GoesOn(scan, *points[i - 1], *points[i], options.LongestDark())) {
      continue;
    }
    if (!add(first, i - 1) && i - first >= static_cast<std::size_t>(3 * kLeastReturns)) {
      const std::vector<Eigen::Vector3d> smooth = Smoothed(points, first, i - 1);
      const std::vector<std::size_t> bends = Bends(smooth);
      for (std::size_t k = 1; k < bends.size(); ++k) {
        if (StandsOut(smooth, bends[k - 1], bends[k])) add(first + bends[k - 1], first + bends[k]);
      }
    }
    first = i;
  }
  std::stable_sort(runs.begin(), runs.end(), [](const StraightRun& a, const StraightRun& b) {
    return a.returns > b.returns;
  });
  return runs;
}

Eigen::Vector3d Middle(const BoardSegment& segment) {
  return segment.sensor_T_board.topRightCorner<3, 1>();
}

// What returns are known to belong to: planes that are too large, boards that were found.
class KnownSurfaces {
 public:
  explicit KnownSurfaces(const Scan& scan) : scan_(scan), of_(scan.points.size(), kUnknown) {}

  void AddBoard(const std::vector<int>& points) {
    for (const int i : points) of_[i] = kBoard;
  }
  void AddPlane(const BoardSegment& segment) {
    const Eigen::Vector3d normal = segment.sensor_T_board.block<3, 1>(0, 2);
    const double off = std::max(kKnownSigmas * segment.plane_sigma, kKnownOff);
    for (const int i : segment.too_large) of_[i] = static_cast<int>(planes_.size());
    planes_.push_back({normal, normal.dot(Middle(segment)), off});
  }

  // Tells whether a run is known. A board before a wall may have some of the wall's returns, but
  // their mean is off the wall.
  bool Has(const StraightRun& run) const {
    std::map<int, int> returns;  // of the run, by surface
    int count = 0;
    for (int k = run.first; k < run.first + run.returns; ++k) {
      const int surface = of_[scan_.by_azimuth[k]];
      if (surface != kUnknown) ++returns[surface], ++count;
    }
    if (count < kKnownShare * run.returns) return false;
    const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
    const int most = std::max_element(returns.begin(), returns.end(), fewer)->first;
    return most == kBoard || std::abs(MeanResidual(run, planes_[most])) < planes_[most].off;
  }

 private:
  static constexpr int kUnknown = -2, kBoard = -1;
  struct Known {
    Eigen::Vector3d normal;
    double distance, off;
  };

  double MeanResidual(const StraightRun& run, const Known& plane) const {
    double sum = 0.0;
    for (int k = run.first; k < run.first + run.returns; ++k) {
      sum += plane.normal.dot(scan_.points[scan_.by_azimuth[k]].position) - plane.distance;
    }
    return sum / run.returns;
  }

  const Scan& scan_;
  std::vector<int> of_;  // surface of each point
  std::vector<Known> planes_;
};

std::vector<int> PositionsOf(const Scan& scan, const std::vector<std::int64_t>& indices) {
  std::vector<int> positions;
  for (const std::int64_t index : indices) {
    const auto i = std::lower_bound(
        scan.points.begin(), scan.points.end(), index,
        [](const ScanPoint& point, std::int64_t value) { return point.index < value; });
    positions.push_back(static_cast<int>(i - scan.points.begin()));
  }
  return positions;
}

// One seed for runs side by side; there must be as many of them as a board has layers.
class Seeds {
 public:
  Seeds(const Scan& scan, const BoardOptions& options)
      : options_(options), runs_(FindStraightRuns(scan, options)) {}

  // Sets the next seed on nothing that is known; false: there is none.
  bool Next(const KnownSurfaces& known, Eigen::Vector3d* seed) {
    const double apart = kApart * options_.size.minCoeff();
    for (; next_ < runs_.size(); ++next_) {
      const StraightRun& run = runs_[next_];
      if (Near(seeds_, run, apart) || known.Has(run)) continue;
      const auto beside = std::count_if(runs_.begin(), runs_.end(), [&](const StraightRun& other) {
        return (other.middle - run.middle).norm() < 0.6 * options_.size.norm();
      });
      if (beside < options_.least_layers - 1) continue;
      seeds_.push_back(run.middle);
      *seed = run.middle;
      return true;
    }
    return false;
  }

 private:
  static bool Near(const std::vector<Eigen::Vector3d>& seeds, const StraightRun& run,
                   double apart) {
    return std::any_of(seeds.begin(), seeds.end(), [&](const Eigen::Vector3d& seed) {
      return (seed - run.middle).norm() < apart;
    });
  }

  const BoardOptions& options_;
  const std::vector<StraightRun> runs_;
  std::vector<Eigen::Vector3d> seeds_;
  std::size_t next_ = 0;
};

// Many layers must show two opposite sides: without a seed, a hidden wall has one side at most.
bool IsConvincing(const BoardSegment& segment) {
  if (segment.border_rms > kBorderRms) return false;
  const bool measured = segment.measured_size.array().isFinite().any();
  return measured || (segment.layers < kManyLayers && segment.hidden < kLittle);
}

void Doubt(BoardSegment* board) {
  board->detected = false;
  board->reason =
      "no two opposite sides of the board's size are seen, as a search needs: give a seed";
  board->progress = 7;
  board->indices.clear();
  board->limit_indices.clear();
}

// Without a seed to trust, the board must be seen better.
BoardOptions Strict(BoardOptions options) {
  options.least_layers = std::max(options.least_layers, 6);
  options.least_visible = std::max(options.least_visible, 0.75);
  options.least_in_view = std::max(options.least_in_view, 0.85);
  options.most_through = std::min(options.most_through, 0.04);
  return options;
}

}  // namespace

std::vector<BoardSegment> FindBoards(const Scan& scan, const BoardOptions& options) {
  if (!scan.has_layers) return FindCloudBoards(scan, options);
  BoardOptions here =
      Strict(options);  // a seed is on the board, if there is one: its plane comes first
  here.seed_radius = kPatch * options.size.minCoeff() / options.size.norm();
  here.most_planes = 1;
  here.at_seed = true;
  here.tells_size = false;
  BoardOptions strict = Strict(options);
  strict.tells_size = false;
  std::vector<BoardSegment> boards;
  BoardSegment nearest;  // to a board, if there is none
  Eigen::Vector3d nearest_seed = Eigen::Vector3d::Zero();
  KnownSurfaces known(scan);
  Seeds seeds(scan, options);
  for (Eigen::Vector3d seed; seeds.Next(known, &seed);) {
    BoardSegment board = SegmentBoard(scan, seed, here);
    if (!board.too_large.empty()) known.AddPlane(board);
    if (board.detected)
      board = SegmentBoard(scan, Middle(board), strict);  // the same from anywhere
    if (board.detected && !IsConvincing(board)) Doubt(&board);
    const auto is_same = [&](const BoardSegment& other) {
      return (Middle(other) - Middle(board)).norm() < 0.5 * options.size.minCoeff();
    };
    if (!board.detected) {
      if (board.progress > nearest.progress) nearest = board, nearest_seed = seed;
      continue;
    }
    known.AddBoard(PositionsOf(scan, board.indices));
    if (std::none_of(boards.begin(), boards.end(), is_same)) boards.push_back(board);
  }
  std::stable_sort(boards.begin(), boards.end(),
                   [](const BoardSegment& a, const BoardSegment& b) { return a.score < b.score; });
  if (boards.empty() && nearest.progress >= kWorthNaming) {
    here.tells_size = true;
    const BoardSegment again = SegmentBoard(scan, nearest_seed, here);
    boards.push_back(again.progress == nearest.progress && !again.detected ? again : nearest);
  }
  return boards;
}

}  // namespace atom_core
