/// \file
/// What of a board's rectangle gives returns, in a scan with layers.

#ifndef ATOM_CORE_CPP_BOARD_FILLING_H_
#define ATOM_CORE_CPP_BOARD_FILLING_H_

#include <set>

#include "board_surface.h"

namespace atom_core {

/// Measures what is seen of a rectangle, and tells whether that is a board.
///
/// \param segment gets the shares, and the reason why it is none.
bool FillsRectangle(const BoardSearch& search, const Surface& surface, const RectanglePose& pose,
                    BoardSegment* segment);

/// Returns the layers of which more beams pass through the rectangle, or by a margin outside it
/// [m], than return from there: they meet posts that carry the board, not the board.
std::set<int> OpenLayers(const BoardSearch& search, const Surface& surface,
                         const RectanglePose& pose, double margin);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_FILLING_H_
