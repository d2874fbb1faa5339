/// \file
/// Boards that touch something larger, as one that leans at a wall or stands on
/// the floor.

#ifndef ATOM_CORE_CPP_BOARD_CONTACT_H_
#define ATOM_CORE_CPP_BOARD_CONTACT_H_

#include <set>

#include "board_surface.h"

namespace atom_core {

/// Tells whether a rectangle reaches into a larger plane that it touches. Such
/// a plane hides no part of a board: where it begins, the board ends, and what
/// is seen must then be all of it.
///
/// \param segment gets the reason.
bool ReachesIntoLarger(const BoardSearch &search, const Surface &surface, const RectanglePose &pose,
                       BoardSegment *segment);

/// Returns the layers of which a part of what lies on the board belongs to a larger plane: along
/// the line in which the two meet, the rest may, too.
///
/// \param margin beyond the outline [m].
std::set<int> LayersInDoubt(const BoardSearch &search, const Surface &surface,
                            const RectanglePose &pose, double margin);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_CONTACT_H_
