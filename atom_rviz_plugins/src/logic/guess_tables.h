// What the panel shows while a first guess is made.
#pragma once

#include <atom_calibration/GuessState.h>

#include <string>

#include "logic/tables.h"

namespace atom_rviz {

/// The sensors: how far each was moved, and how far its points are off the board's plane.
Table guess_table(const atom_calibration::GuessState& state);

/// One line: where it is saved, and whether something is not.
std::string guess_line(const atom_calibration::GuessState& state);

}  // namespace atom_rviz
