/// \file
/// A flat board of known size in the scan of a spinning LiDAR: its returns, and those on its
/// border.
///
/// Planes are proposed by RANSAC (PCL, with its fixed random seed) among the points around a seed.
/// The returns on a plane form runs along the layers; runs join where nothing was seen through the
/// plane between them. Each piece is refit with a threshold of three of its own standard
/// deviations, and compared with the board: a rectangle of the board's size is laid through the
/// ends of its layers, and the returns must fill it as the beams would. A wall or table is too
/// large, a person not flat or of another outline. Where a scan has no layers, the outline in the
/// plane and the local spacing of the points take their place.

#ifndef ATOM_CORE_BOARD_SEGMENTATION_H_
#define ATOM_CORE_BOARD_SEGMENTATION_H_

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "atom_core/scan_layers.h"

namespace atom_core {

/// What counts as a board.
struct BoardOptions {
  Eigen::Vector2d size = Eigen::Vector2d::Zero();  ///< width and height of the border [m]
  double noise = 0.010;          ///< standard deviation of ranges to begin with [m]
  double most_noise = 0.030;     ///< of the returns about the plane: more is not flat [m]
  double beam_width = 0.0;       ///< full angle within which a beam returns from the board [rad]
  double dark = 0.0;             ///< side of squares that may return nothing; 0: none may [m]
  double seed_radius = 0.75;     ///< planes are proposed within this many diagonals of the seed
  int most_planes = 8;           ///< proposed around a seed
  bool tells_size = true;        ///< reasons say how large a plane is that is no board
  bool at_seed = false;          ///< only what has points of the plane around the seed is looked at
  int least_layers = 4;          ///< that meet the board
  int least_points = 20;         ///< on the board
  double least_coverage = 0.70;  ///< share of the expected returns that is there or hidden
  double least_visible = 0.50;   ///< share of the expected returns that is there
  double least_in_view = 0.04;   ///< share of the board between the lowest and the highest layer
  double least_of_outline = 0.50;  ///< share of the board in the field of view, without layers
  double most_through = 0.08;      ///< share of the expected beams that pass through the rectangle
  double most_inside = 0.9;  ///< beam steps from the outline that a limit point may lie inside,
  double well_inside = 0.5;  ///< and where half of its side, four at least, are nearer
  double border_tolerance =
      0.025;  ///< RMS of the layers' ends about the border, beside beam steps [m]

  /// Returns how far returns beside a dark square are apart at most [m].
  double LongestDark() const { return 1.6 * dark; }
};

/// Refuses what is no board: sides shorter than 1 mm, longer than 1 km, or a strip 1000 times as
/// long as wide.
///
/// \param size width and height [m].
/// \throws std::invalid_argument saying so.
void CheckBoardSize(const Eigen::Vector2d& size);

/// What was found on a plane, or why it is not the board.
struct BoardSegment {
  bool detected = false;
  bool unsure = false;                      ///< labeled, not detected: the view cuts what may be it
  std::string reason;                       ///< one sentence; empty when detected
  std::vector<std::int64_t> indices;        ///< of the returns, into the cloud as given, ascending
  std::vector<std::int64_t> limit_indices;  ///< those on the border
  std::vector<int> too_large;  ///< positions in the scan of a plane's returns that reach too far
  Eigen::Matrix4d sensor_T_board = Eigen::Matrix4d::Identity();   ///< origin in the middle, x along
                                                                  ///< the width, z away from the
                                                                  ///< sensor; open to half a turn
  double plane_sigma = std::numeric_limits<double>::quiet_NaN();  ///< about the plane [m]
  double border_rms = std::numeric_limits<double>::quiet_NaN();   ///< of the layers' ends [m]
  double incidence = std::numeric_limits<double>::quiet_NaN();    ///< at the middle [rad]
  Eigen::Vector2d measured_size =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());  ///< [m]; NaN: not seen
  double spacing = std::numeric_limits<double>::quiet_NaN();  ///< of points; NaN: by layers [m]
  int layers = 0;           ///< with returns from the board; 0 where the cloud has none
  int expected_points = 0;  ///< beams that meet the rectangle
  double visible = 0.0;     ///< share of them with a return from the board
  double hidden = 0.0;      ///< share of them with a nearer return
  double through = 0.0;     ///< share of them with a farther return
  double dark = 0.0;        ///< share of them without a return, between others on the board
  double in_view = 0.0;     ///< share of the board between the lowest and the highest layer
  int progress = 0;         ///< tests passed; more is nearer to a board
  double score = std::numeric_limits<double>::infinity();  ///< of detected ones; less is better
};

/// Finds the board near a seed.
///
/// \param scan the cloud with its layers.
/// \param seed a point on or near the board, in the sensor's frame [m].
/// \param options the board's size and limits.
/// \throws std::invalid_argument when the size or the seed is not finite or the size not positive.
BoardSegment SegmentBoard(const Scan& scan, const Eigen::Vector3d& seed,
                          const BoardOptions& options);

/// Searches a whole scan for boards of the size, without a seed; the best one first. Where there is
/// none: what comes nearest to one, if anything does, not detected, with its reason.
///
/// Straight runs of returns of a possible length, between jumps of the range, are the seeds.
std::vector<BoardSegment> FindBoards(const Scan& scan, const BoardOptions& options);

/// Returns how far from a seed points take part: planes are proposed within the first radius.
double SeedRadius(const BoardOptions& options);

}  // namespace atom_core

#endif  // ATOM_CORE_BOARD_SEGMENTATION_H_
