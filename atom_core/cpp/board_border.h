/// \file
/// How well the ends of layers lie on the border of a rectangle.

#ifndef ATOM_CORE_CPP_BOARD_BORDER_H_
#define ATOM_CORE_CPP_BOARD_BORDER_H_

#include <vector>

#include "atom_core/board_rectangle.h"
#include "board_surface.h"

namespace atom_core {

/// The ends of a surface's layers. Each counts for as much of the border as lies nearer to it than
/// to the next layers, in mean layers: where layers are sparse, one of them stands for more.
struct LayerBorders {
  Outline outline;
  std::vector<double> weights;  ///< of the outline's limits
  double open = 0.0;            ///< weight of the ends beyond which the surface goes on
};

/// Returns what the ends of a surface's layers say about the outline of a board.
LayerBorders FindBorders(const Surface& surface);

/// Tells whether enough ends of layers lie on the border.
///
/// \param segment gets how far they are from it, and the reason why they are not on it.
bool BorderFits(const Surface& surface, const RectanglePose& pose, const LayerBorders& borders,
                BoardSegment* segment);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_BORDER_H_
