/// \file
/// Boards in clouds without scan layers: by the outline in the plane and the spacing of the points.

#ifndef ATOM_CORE_CPP_CLOUD_BOARD_H_
#define ATOM_CORE_CPP_CLOUD_BOARD_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "atom_core/board_segmentation.h"
#include "board_surface.h"
#include "cloud_patch.h"

namespace atom_core {

/// Tells whether a piece of a plane, without scan layers, is the board: flat, as large as the
/// board, with its outline, and filled with points as densely as its neighbourhood.
///
/// \param search the points around the seed.
/// \param piece positions in the window.
/// \return the board with its labels, or the reason why it is none, with what was measured so far.
BoardSegment JudgeCloudPiece(const BoardSearch& search, std::vector<int> piece);

/// The first part of JudgeCloudPiece: the plane of a piece, and what lies on it.
///
/// \param segment gets what was measured, and the reason where the piece cannot be the board.
std::optional<Patch> FitCloudPiece(const BoardSearch& search, std::vector<int> piece,
                                   BoardSegment* segment);

/// The second part: the outline.
///
/// \param segment as FitCloudPiece left it.
BoardSegment JudgeCloudPatch(const BoardSearch& search, const Patch& patch, BoardSegment segment);

/// The same as SegmentBoard, for a cloud without scan layers.
BoardSegment SegmentCloudBoard(const Scan& scan, const Eigen::Vector3d& seed,
                               const BoardOptions& options);

/// The same as FindBoards, for a cloud without scan layers.
std::vector<BoardSegment> FindCloudBoards(const Scan& scan, const BoardOptions& options);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_CLOUD_BOARD_H_
