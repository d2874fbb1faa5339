/// \file
/// Boards whose black squares are measured so much longer that they lie behind
/// the white ones.

#ifndef ATOM_CORE_CPP_BOARD_SQUARES_H_
#define ATOM_CORE_CPP_BOARD_SQUARES_H_

#include "board_surface.h"

namespace atom_core {

/// Says so in the reason of a piece that is no board, where its layers
/// alternate between a plane and places as long as squares right behind it, all
/// equally far.
///
/// \param pose where the board would be in the plane of the surface.
/// \param segment gets the reason.
void TellSquares(const BoardSearch &search, const Surface &surface, const RectanglePose &pose,
                 BoardSegment *segment);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_SQUARES_H_
