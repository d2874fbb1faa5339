#include "atom_core/board_segmentation.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "board_judgement.h"
#include "cloud_board.h"
#include "plane_pieces.h"
#include "plane_points.h"

namespace atom_core {
namespace {

constexpr double kUnmeasured = 0.25;  // of the score, for a side
constexpr int kLaid = 4;              // progress of what a rectangle was laid on
constexpr double kSmallPiece = 0.5;   // of the shorter side
// Of a board [m], as in config_entries.py.
constexpr double kLeastSide = 1e-3, kMostSide = 1e3, kMostRatio = 1e3;

// The score, worse where a side of the board is not measured: a plane that is a little off has
// fewer ends of layers on the border, and those fit well.
double Rank(const BoardSegment& segment) {
  return segment.score + kUnmeasured * (2 - segment.measured_size.array().isFinite().count());
}

bool IsBetter(const BoardSegment& a, const BoardSegment& b) {
  if (a.detected != b.detected) return a.detected;
  return a.detected ? Rank(a) < Rank(b) : a.progress > b.progress;
}

void Check(const Eigen::Vector3d& seed, const BoardOptions& options) {
  CheckBoardSize(options.size);
  if (!seed.allFinite()) throw std::invalid_argument("the seed must be finite");
}

Plane PlaneOf(const BoardSegment& segment) {
  const Eigen::Vector3d normal = segment.sensor_T_board.block<3, 1>(0, 2);
  return {normal, normal.dot(segment.sensor_T_board.topRightCorner<3, 1>()), segment.plane_sigma};
}

// Tells whether a piece is much shorter than the board.
bool IsSmall(const BoardSearch& search, const std::vector<int>& piece) {
  double longest = 0.0;
  for (const int i : piece) {
    const Eigen::Vector3d offset = search.At(i).position - search.At(piece.front()).position;
    longest = std::max(longest, offset.norm());
  }
  return longest < kSmallPiece * search.options.size.minCoeff();
}

// The best piece of the window on one plane.
//
// larger: gets pieces that are too large.
BoardSegment BestOnPlane(const BoardSearch& search, const Plane& plane, const Eigen::Vector3d& seed,
                         LargerPlanes* larger) {
  const BoardOptions& options = search.options;
  const std::vector<int> all =
      InliersOf(search.window, PlaneAxes(plane, seed), kThreshold * options.noise,
                kSquareShare * options.size.minCoeff());
  const std::vector<int> inliers = larger->Without(all, plane);
  const auto is_at_seed = [&](const std::vector<int>& piece) {
    const std::vector<int>& sphere = search.window.sphere;
    auto in_piece = piece.begin();
    for (const int i : sphere) {
      in_piece = std::lower_bound(in_piece, piece.end(), i);
      if (in_piece == piece.end()) return false;
      if (*in_piece == i) return true;
    }
    return false;
  };
  BoardSegment best;
  best.reason = "no plane has enough points";
  for (auto& piece : FindPieces(search.scan, search.window, inliers, plane, options.size.minCoeff(),
                                options.LongestDark())) {
    if (static_cast<int>(piece.size()) < options.least_points) break;
    if (options.at_seed && !is_at_seed(piece)) continue;
    const bool is_small = IsSmall(search, piece);
    BoardSegment segment = JudgePiece(search, std::move(piece));
    const Eigen::Vector3d middle = segment.sensor_T_board.topRightCorner<3, 1>();
    segment.score += 0.5 * (middle - seed).norm() / SeedRadius(options);
    if (!segment.too_large.empty()) larger->Add(PlaneOf(segment));
    // Scraps along a larger plane say less than that plane.
    const bool is_scrap = is_small && inliers.size() < all.size() && segment.progress < kLaid;
    if (is_scrap && segment.indices.empty()) continue;
    if (IsBetter(segment, best)) best = segment;
  }
  return best;
}

// The best piece of the window on any of the planes around the seed.
BoardSegment BestOfPlanes(BoardSearch search, const Eigen::Vector3d& seed) {
  const BoardOptions& options = search.options;
  LargerPlanes larger(search.window);
  search.larger = &larger;
  BoardSegment best;
  best.reason = "no plane around the seed";
  std::vector<int> left = search.window.sphere;
  const double threshold = kProposal * options.noise;
  for (int k = 0; k < options.most_planes; ++k) {
    Plane plane;
    if (static_cast<int>(left.size()) < options.least_points ||
        !ProposePlane(search.window, left, threshold, kLeastCosine * seed.norm(), &plane)) {
      break;
    }
    const BoardSegment segment = BestOnPlane(search, plane, seed, &larger);
    if (IsBetter(segment, best)) best = segment;
    std::vector<int> rest = OffPlane(search.window, left, plane, kThreshold * options.noise);
    if (rest.size() == left.size()) break;
    left = std::move(rest);
  }
  return best;
}

}  // namespace

void CheckBoardSize(const Eigen::Vector2d& size) {
  const double least = size.minCoeff(), most = size.maxCoeff();
  if (size.allFinite() && least >= kLeastSide && most <= std::min(kMostSide, kMostRatio * least)) {
    return;
  }
  throw std::invalid_argument("the board's sides must be from 1 mm to 1 km long, no strip");
}

double SeedRadius(const BoardOptions& options) { return options.seed_radius * options.size.norm(); }

BoardSegment SegmentBoard(const Scan& scan, const Eigen::Vector3d& seed,
                          const BoardOptions& options) {
  Check(seed, options);
  if (!scan.has_layers) return SegmentCloudBoard(scan, seed, options);
  BoardSegment none;
  const Window window = CutWindow(scan, seed, options);
  if (static_cast<int>(window.sphere.size()) < options.least_points) {
    none.reason = Text("only %.0f points within %.2f m of the seed, %.0f are needed",
                       window.sphere.size(), SeedRadius(options), options.least_points);
    return none;
  }
  return BestOfPlanes({scan, window, options}, seed);
}

}  // namespace atom_core
