/// \file
/// What is measured of a board's size, in a scan with layers, against what is configured.

#ifndef ATOM_CORE_CPP_BOARD_SIZE_H_
#define ATOM_CORE_CPP_BOARD_SIZE_H_

#include <string>
#include <vector>

#include "atom_core/board_rectangle.h"
#include "board_surface.h"

namespace atom_core {

// How far from the configured size [of a side] a measured one may be: the tolerance and some sigmas
// of what is measured, but no more than the largest error, however uncertain it is.
constexpr double kSizeTolerance = 0.03;
constexpr double kSizeSigmas = 3.0;
constexpr double kMostSizeError = 0.07;
constexpr double kMostCutError = 0.035;  // where the view cuts the board: one size is all there is

/// Returns what all reasons say of the size of a plane: width and height [m] beside the board's.
std::string SizeText(const Eigen::Vector2d& measured, const Eigen::Vector2d& configured);

/// Adds to the reason of a piece that is no board how large it is, unless the reason says so.
void TellSize(const BoardSearch& search, const std::vector<int>& piece, BoardSegment* segment);

/// Returns the reason why a plane whose measured size [m] is not the board's is none; a side that
/// is not seen is NaN.
std::string SizeReason(const Eigen::Vector2d& measured, const BoardOptions& options);

/// Measures the distances of opposite sides, and tells whether they may be the board's.
///
/// \param segment gets the size, and the reason why it is not.
bool SizeFits(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
              const Outline& outline, BoardSegment* segment);

/// Tells whether a board that fits is also told from larger and smaller ones: where the lowest or
/// the highest layer of the scan meets it, or the next layer passes far away, nothing shows where
/// it ends beyond, and only two opposite sides tell its size.
///
/// \param segment gets the reason why it is not told.
bool IsToldBySize(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                  const Outline& outline, BoardSegment* segment);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_SIZE_H_
