/// \file
/// The steps by which a piece of a plane is told a board or not.

#ifndef ATOM_CORE_CPP_BOARD_JUDGEMENT_H_
#define ATOM_CORE_CPP_BOARD_JUDGEMENT_H_

#include <optional>
#include <string>
#include <vector>

#include "board_surface.h"

namespace atom_core {

/// Formats up to four numbers, for reasons.
std::string Text(const char* format, double a, double b = 0.0, double c = 0.0, double d = 0.0);

/// What a reason says where a board may be part of what is larger.
constexpr char kHoldAway[] =
    " (a board less than 5 cm before a wall is not told from it: hold it farther away)";

/// Notes that a piece is no board.
///
/// \param progress how many steps of the judgement it passed.
/// \param reason for the user.
/// \param segment gets both.
/// \return nothing, for functions that return an optional.
std::nullopt_t Reject(int progress, const std::string& reason, BoardSegment* segment);

/// Tells whether a piece is the board: a flat surface with enough layers, an outline of the
/// board's size, and returns wherever the board would give them.
///
/// \param search where the piece was found.
/// \param piece positions in the window, ascending.
/// \return the board with its labels, or the reason why it is none, with what was measured so far.
BoardSegment JudgePiece(const BoardSearch& search, std::vector<int> piece);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_BOARD_JUDGEMENT_H_
