/// \file
/// What lies in a board's plane beside it, in a scan with layers.

#ifndef ATOM_CORE_CPP_BOARD_BESIDE_H_
#define ATOM_CORE_CPP_BOARD_BESIDE_H_

#include "board_surface.h"

namespace atom_core {

/// Tells whether the surface goes on along more than half of one side of a rectangle, as where the
/// rectangle is an end of a table.
///
/// \param segment gets the reason.
bool GoesOnBesideSide(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                      BoardSegment* segment);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_BESIDE_H_
