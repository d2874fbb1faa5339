// Boards in clouds without scan layers, at a seed and without one.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "board_judgement.h"
#include "board_size.h"
#include "cloud_board.h"
#include "plane_points.h"

namespace atom_core {
namespace {

constexpr std::size_t kMostProposing = 1500;  // points that planes are proposed from
constexpr std::size_t kPatchProposing = 150;  // the same of a patch
constexpr std::size_t kMostPieces = 3;        // of a plane
constexpr double kCellShare = 0.35;           // of the shorter side: cells that the cloud is cut in
constexpr double kPatchShare = 0.4;           // of it: radius of a patch
constexpr std::size_t kLeastOfCell = 3;       // points
constexpr std::size_t kLeastOfPatch = 14;     // points: half of what a board needs there
constexpr double kPatchSigma = 0.03;          // [m] of a patch that is none
constexpr int kRingSectors = 24;              // of a ring that no board reaches
constexpr double kRingFrom = 1.05, kRingTo = 1.6;  // its radii in diagonals
constexpr double kRingShare = 0.4;                 // of the sectors: the plane is larger
constexpr double kRingDensity = 0.2;               // of the points, against those inside
constexpr double kLeastMargin = 0.008;             // [m] about a plane that is known
constexpr double kSamePiece = 0.95;  // of the points of two pieces: what is said of one holds
// Cells from the sensor to the farthest, of which a key has room for; what is beyond counts as
// there.
constexpr std::int64_t kFarthest = 1 << 20;

constexpr int kOtherSize = 1;  // progress of pieces that are too large or too small

using Positions = std::vector<int>;  // among the points of the scan

std::vector<int> Some(const std::vector<int>& all, std::size_t most) {
  const std::size_t step = std::max<std::size_t>((all.size() + most - 1) / most, 1);
  std::vector<int> some;
  for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

bool IsBetterCloudBoard(const BoardSegment& a, const BoardSegment& b) {
  if (a.detected != b.detected) return a.detected;
  return a.detected ? a.score < b.score : a.progress > b.progress;
}

// The pieces of a plane, the largest first.
std::vector<std::vector<int>> PiecesOfPlane(const BoardSearch& search, const Plane& plane,
                                            double threshold, const Eigen::Vector3d& seed) {
  const PlaneAxes axes(plane, seed);
  const std::vector<int> inliers =
      InliersOf(search.window, axes, threshold, kSquareShare * search.options.size.minCoeff());
  return ConnectedPieces(search.window, inliers, axes, search.options.size);
}

// The best of the larger pieces of a plane.
BoardSegment BestPiece(const BoardSearch& search, const Plane& plane, const Eigen::Vector3d& seed) {
  const double threshold = kThreshold * std::min(search.options.noise, plane.sigma);
  auto pieces = PiecesOfPlane(search, plane, std::max(threshold, kLeastMargin), seed);
  BoardSegment best;
  best.reason = Text("only %.0f points are on the plane there, %.0f are needed",
                     pieces.empty() ? 0 : pieces.front().size(), search.options.least_points);
  for (std::size_t k = 0; k < std::min(pieces.size(), kMostPieces); ++k) {
    if (static_cast<int>(pieces[k].size()) < search.options.least_points) break;
    BoardSegment segment = JudgeCloudPiece(search, pieces[k]);
    if (search.options.tells_size) TellSize(search, pieces[k], &segment);
    const Eigen::Vector3d middle = segment.sensor_T_board.topRightCorner<3, 1>();
    segment.score += 0.5 * (middle - seed).norm() / SeedRadius(search.options);
    if (k == 0 || IsBetterCloudBoard(segment, best)) best = segment;
  }
  return best;
}

// The piece of a plane that has most of a patch; empty: none is large enough.
std::vector<int> PieceOfPatch(const BoardSearch& search, const Plane& plane, double threshold,
                              const Eigen::Vector3d& seed) {
  std::vector<int> best;
  std::size_t most = 0;
  for (auto& piece : PiecesOfPlane(search, plane, threshold, seed)) {
    if (static_cast<int>(piece.size()) < search.options.least_points) break;
    std::vector<int> common;
    const std::vector<int>& patch = search.window.sphere;
    std::set_intersection(piece.begin(), piece.end(), patch.begin(), patch.end(),
                          std::back_inserter(common));
    if (common.size() > most) most = common.size(), best = std::move(piece);
  }
  return best;
}

BoardSegment BestOfCloudPlanes(const BoardSearch& search, const Eigen::Vector3d& seed) {
  const BoardOptions& options = search.options;
  BoardSegment best;
  best.reason = Text("no plane with %.0f points is within %.2f m of the seed", options.least_points,
                     SeedRadius(options));
  std::vector<int> left = Some(search.window.sphere, kMostProposing);
  for (int k = 0; k < options.most_planes; ++k) {
    Plane plane;
    if (static_cast<int>(left.size()) < options.least_points ||
        !ProposePlane(search.window, left, kProposal * options.noise, kLeastCosine * seed.norm(),
                      &plane)) {
      break;
    }
    const BoardSegment segment = BestPiece(search, plane, seed);
    if (IsBetterCloudBoard(segment, best)) best = segment;
    std::vector<int> rest = OffPlane(search.window, left, plane, kThreshold * options.noise);
    if (rest.size() == left.size()) break;
    left = std::move(rest);
  }
  return best;
}

// The best piece of any plane around a seed.
BoardSegment SegmentAt(const Scan& scan, const Eigen::Vector3d& seed, const BoardOptions& options) {
  const double sphere = SeedRadius(options), radius = sphere + options.size.norm();
  Window window;
  for (const ScanPoint& point : scan.points) {
    const double squared = (point.position - seed).squaredNorm();
    if (squared > radius * radius) continue;
    if (squared < sphere * sphere) window.sphere.push_back(static_cast<int>(window.points.size()));
    window.points.push_back({&point, 0.0});
  }
  if (static_cast<int>(window.sphere.size()) < options.least_points) {
    BoardSegment none;
    none.reason = Text("only %.0f points within %.2f m of the seed, %.0f are needed",
                       window.sphere.size(), sphere, options.least_points);
    return none;
  }
  return BestOfCloudPlanes({scan, window, options}, seed);
}

// The points of a scan in cubes: sorted by them, so that those around a place stand together.
class CellIndex {
 public:
  CellIndex(const Scan& scan, double side) : side_(side) {
    std::vector<std::pair<std::int64_t, int>> order;
    order.reserve(scan.points.size());
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      order.emplace_back(Key(Cube(scan.points[i].position)), static_cast<int>(i));
    }
    std::sort(order.begin(), order.end());
    scan_.sensor_R_spin = scan.sensor_R_spin;
    for (const auto& item : order) {
      if (keys_.empty() || item.first != keys_.back()) {
        keys_.push_back(item.first);
        begins_.push_back(static_cast<int>(scan_.points.size()));
      }
      scan_.points.push_back(scan.points[item.second]);
    }
    begins_.push_back(static_cast<int>(scan_.points.size()));
  }

  // The scan in the order of the cubes.
  const Scan& scan() const { return scan_; }
  std::vector<std::size_t> FullestFirst() const {
    std::vector<std::size_t> cells(keys_.size());
    std::iota(cells.begin(), cells.end(), std::size_t{0});
    std::stable_sort(cells.begin(), cells.end(), [&](std::size_t a, std::size_t b) {
      return End(a) - Begin(a) > End(b) - Begin(b);
    });
    return cells;
  }
  int Begin(std::size_t cell) const { return begins_[cell]; }
  int End(std::size_t cell) const { return begins_[cell + 1]; }

  // The points nearer to a place than a radius, ascending.
  Positions Around(const Eigen::Vector3d& place, double radius) const {
    Positions found;
    const auto add_near = [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const Eigen::Vector3d away = scan_.points[i].position - place;
        if (away.squaredNorm() < radius * radius) found.push_back(i);
      }
    };
    const Eigen::Vector3i low = Cube(place.array() - radius), high = Cube(place.array() + radius);
    const Eigen::Vector3d count = (high - low).cast<double>().array() + 1.0;
    if (count.x() * count.y() > static_cast<double>(keys_.size())) {  // more columns than cells
      add_near(0, begins_.back());
      return found;
    }
    auto column = keys_.begin();
    for (int x = low.x(); x <= high.x(); ++x) {
      for (int y = low.y(); y <= high.y(); ++y) {
        column = std::lower_bound(column, keys_.end(), Key({x, y, low.z()}));
        const auto end = std::upper_bound(column, keys_.end(), Key({x, y, high.z()}));
        add_near(begins_[column - keys_.begin()], begins_[end - keys_.begin()]);
      }
    }
    return found;
  }

 private:
  Eigen::Vector3i Cube(const Eigen::Vector3d& point) const {
    return (point / side_).array().floor().max(-1.0 * kFarthest).min(kFarthest - 1.0).cast<int>();
  }
  static std::int64_t Key(const Eigen::Vector3i& cube) {
    const auto part = [](int value) { return static_cast<std::int64_t>(value) + kFarthest; };
    return (part(cube.x()) << 42) + (part(cube.y()) << 21) + part(cube.z());
  }

  double side_;
  Scan scan_;
  std::vector<std::int64_t> keys_;  // of the cells
  std::vector<int> begins_;         // of each cell among the points; and the end of the last
};

// Looks for boards patch by patch; what is known to be something else is not looked at again.
class CloudSearch {
 public:
  CloudSearch(const Scan& scan, const BoardOptions& options)
      : options_(options),
        index_(scan, kCellShare * options.size.minCoeff()),
        scan_(index_.scan()),
        known_(scan.points.size(), false),
        in_round_(scan.points.size(), 0) {}

  std::vector<BoardSegment> Boards() {
    return BoardsNear(Eigen::Vector3d::Zero(), std::numeric_limits<double>::infinity());
  }

  // Boards of which patches within a radius of a place are a part.
  std::vector<BoardSegment> BoardsNear(const Eigen::Vector3d& seed, double radius) {
    std::vector<BoardSegment> boards;
    for (const std::size_t cell : index_.FullestFirst()) {
      Positions unknown;
      for (int i = index_.Begin(cell); i < index_.End(cell); ++i) {
        if (!known_[i]) unknown.push_back(i);
      }
      if (unknown.size() < kLeastOfCell) continue;
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      for (const int i : unknown) mean += scan_.points[i].position / unknown.size();
      if ((mean - seed).norm() > radius) continue;
      const BoardSegment segment = AtPatch(mean);
      if (segment.detected) {
        if (std::none_of(boards.begin(), boards.end(),
                         [&](const BoardSegment& other) { return IsSame(segment, other); })) {
          boards.push_back(segment);
        }
      } else if (boards.empty() && segment.progress > nearest_.progress) {
        nearest_ = segment;
      }
    }
    std::stable_sort(
        boards.begin(), boards.end(),
        [](const BoardSegment& a, const BoardSegment& b) { return a.score < b.score; });
    if (boards.empty() && !nearest_.reason.empty()) boards.push_back(nearest_);
    return boards;
  }

 private:
  bool IsSame(const BoardSegment& a, const BoardSegment& b) const {
    const auto apart = a.sensor_T_board - b.sensor_T_board;
    return apart.topRightCorner<3, 1>().norm() < 0.5 * options_.size.minCoeff();
  }

  BoardSegment AtPatch(const Eigen::Vector3d& place) {
    BoardSegment none;
    Positions patch;
    for (const int i : index_.Around(place, kPatchShare * options_.size.minCoeff())) {
      if (!known_[i]) patch.push_back(i);
    }
    if (patch.size() < kLeastOfPatch) return none;
    const double reach = kRingTo * options_.size.norm();
    const Window window = MakeWindow(index_.Around(place, reach), patch);
    Plane plane;
    const std::vector<int> some = Some(window.sphere, kPatchProposing);
    if (!ProposePlane(window, some, kProposal * options_.noise, kLeastCosine * place.norm(),
                      &plane) ||
        plane.sigma > kPatchSigma) {
      Know(window, window.sphere);
      return none;
    }
    const double margin = std::max(kThreshold * plane.sigma, kLeastMargin);
    if (IsLarger(window, plane, place, margin)) return none;
    return Judged(window, plane, place, margin);
  }

  BoardSegment Judged(const Window& window, const Plane& plane, const Eigen::Vector3d& place,
                      double margin) {
    const BoardSearch search{scan_, window, options_};
    std::vector<int> piece = PieceOfPatch(search, plane, margin, place);
    BoardSegment segment;
    const auto patch = piece.empty() ? std::nullopt : FitCloudPiece(search, piece, &segment);
    if (patch && !WasRefused(window, patch->piece)) {
      segment = JudgeCloudPatch(search, *patch, segment);
      if (!segment.detected) Refuse(window, patch->piece);
    }
    if (segment.progress > nearest_.progress) TellSize(search, piece, &segment);
    if (segment.progress == kOtherSize) Know(window, patch ? patch->piece : piece);
    Know(window, OnPlane(window, window.sphere, plane, margin));
    if (!segment.detected) return segment;
    const Eigen::Vector3d middle = segment.sensor_T_board.topRightCorner<3, 1>();
    BoardOptions here = options_;  // the seed is on the board: its plane comes first
    here.seed_radius = kPatchShare * options_.size.minCoeff() / options_.size.norm();
    here.most_planes = 1;
    segment = SegmentAt(scan_, middle, here);  // the same from wherever it was found
    for (const int i : index_.Around(middle, 0.6 * options_.size.norm())) {
      const Eigen::Vector3d normal = segment.sensor_T_board.block<3, 1>(0, 2);
      if (std::abs(normal.dot(scan_.points[i].position - middle)) < 0.05) known_[i] = true;
    }
    return segment;
  }

  Window MakeWindow(const Positions& around, const Positions& patch) const {
    Window window;
    std::size_t next = 0;
    for (const int i : around) {
      if (next < patch.size() && patch[next] == i) {
        window.sphere.push_back(static_cast<int>(window.points.size()));
        ++next;
      }
      window.points.push_back({&scan_.points[i], 0.0});
    }
    return window;
  }

  void Know(const Window& window, const std::vector<int>& positions) {
    for (const int i : positions) known_[NumberOf(window, i)] = true;
  }

  std::size_t NumberOf(const Window& window, int position) const {
    return window.points[position].point - scan_.points.data();
  }

  // Remembers a piece that is no board.
  void Refuse(const Window& window, const std::vector<int>& piece) {
    refused_.emplace_back();
    for (const int i : piece) refused_.back().push_back(NumberOf(window, i));
  }

  // Tells whether a piece was refused before, from another patch of it.
  bool WasRefused(const Window& window, const std::vector<int>& piece) {
    ++round_;
    for (const int i : piece) in_round_[NumberOf(window, i)] = round_;
    return std::any_of(refused_.begin(), refused_.end(), [&](const auto& other) {
      const double least = kSamePiece * std::max(other.size(), piece.size());
      return std::count_if(other.begin(), other.end(),
                           [&](std::size_t point) { return in_round_[point] == round_; }) > least;
    });
  }

  // Tells whether the plane goes on all around, farther than any board; its points are then known.
  bool IsLarger(const Window& window, const Plane& plane, const Eigen::Vector3d& place,
                double margin) {
    const PlaneAxes axes(plane, place);
    const double diagonal = options_.size.norm();
    const double inner = kPatchShare * options_.size.minCoeff();
    std::vector<bool> seen(kRingSectors, false);
    std::vector<int> on;
    double inside = 0.0, around = 0.0;
    int beside = 0, behind = 0;  // of the returns in the ring
    for (std::size_t i = 0; i < window.points.size(); ++i) {
      const Eigen::Vector3d& position = window.At(i).position;
      const double off = plane.Residual(position);
      if (off < -margin || off > margin + kRightBehind) continue;
      const Eigen::Vector2d point = axes.InPlane(position);
      const double away = point.norm();
      const bool in_ring = away > kRingFrom * diagonal && away < kRingTo * diagonal;
      if (in_ring) (off > margin ? behind : beside) += 1;
      if (off > margin) continue;
      if (away < diagonal) on.push_back(i);
      if (away < inner) inside += 1.0 / (inner * inner);
      if (!in_ring) continue;
      around += 1.0 / ((kRingTo * kRingTo - kRingFrom * kRingFrom) * diagonal * diagonal);
      const double turn = std::atan2(point.y(), point.x()) / (2.0 * M_PI) + 0.5;
      seen[std::min(static_cast<int>(turn * kRingSectors), kRingSectors - 1)] = true;
    }
    if (behind > beside) return false;  // a wall right behind scatters into the plane
    // Where other surfaces cross the plane are lines, as long as they may be.
    if (around < kRingDensity * inside) return false;
    if (std::count(seen.begin(), seen.end(), true) < kRingShare * kRingSectors) return false;
    Know(window, on);
    return true;
  }

  const BoardOptions options_;
  const CellIndex index_;
  const Scan& scan_;
  std::vector<bool> known_;
  std::vector<std::vector<std::size_t>> refused_;  // pieces that were judged: points of the scan
  std::vector<int> in_round_;                      // of each point, when it was compared with them
  int round_ = 0;
  BoardSegment nearest_;
};

// Without a seed to trust, the board must be seen better.
BoardOptions StrictInCloud(BoardOptions options) {
  options.least_visible = std::max(options.least_visible, 0.75);
  options.most_through = std::min(options.most_through, 0.04);
  options.least_of_outline = std::max(options.least_of_outline, 0.75);
  return options;
}

}  // namespace

BoardSegment SegmentCloudBoard(const Scan& scan, const Eigen::Vector3d& seed,
                               const BoardOptions& options) {
  const BoardSegment segment = SegmentAt(scan, seed, options);
  if (segment.detected) return segment;
  // Planes from a place as large as this are no board's where a wall is right behind it; a search
  // proposes them from patches.
  const double on_board = 0.5 * options.size.norm();
  for (const BoardSegment& found :
       CloudSearch(scan, StrictInCloud(options)).BoardsNear(seed, on_board)) {
    const Eigen::Vector3d middle = found.sensor_T_board.topRightCorner<3, 1>();
    if (found.detected && (middle - seed).norm() < on_board) return found;
  }
  return segment;
}

std::vector<BoardSegment> FindCloudBoards(const Scan& scan, const BoardOptions& options) {
  return CloudSearch(scan, StrictInCloud(options)).Boards();
}

}  // namespace atom_core
