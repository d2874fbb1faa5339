#include "logic/guess_tables.h"

#include <cmath>
#include <cstdio>

namespace atom_rviz {
namespace {

using atom_calibration::GuessState;
using atom_calibration::SensorGuess;

constexpr double kDegreesPerRadian = 57.29577951308232;

Cell moved_cell(const SensorGuess& guess) {
  if (guess.held) return {"held", Tone::kFaint, guess.sensor + " is anchored and has no marker"};
  if (guess.moved_m == 0.0 && guess.moved_rad == 0.0) return {"not moved", Tone::kFaint, ""};
  char degrees[40];
  std::snprintf(degrees, sizeof(degrees), "%.1f deg", kDegreesPerRadian * guess.moved_rad);
  return {size_text(guess.moved_m, "m") + ", " + degrees, Tone::kPlain, "since the start"};
}

Cell board_cell(const SensorGuess& guess) {
  if (!std::isfinite(guess.off_board_m)) return {"-", Tone::kFaint, "no board is seen by both"};
  return {size_text(guess.off_board_m, "m"), Tone::kPlain,
          "median distance of " + count_text(guess.points) + " points of " + guess.sensor +
              " from the plane of the board that " + guess.seen_by + " sees"};
}

}  // namespace

Table guess_table(const GuessState& state) {
  Table table{{"sensor", "moved", "points off the board", "seen by"}, {}};
  for (const SensorGuess& guess : state.sensors) {
    table.rows.push_back({guess.sensor,
                          {{guess.sensor, Tone::kPlain, "", guess.colour},
                           moved_cell(guess),
                           board_cell(guess),
                           {guess.seen_by, Tone::kFaint, ""}}});
  }
  return table;
}

std::string guess_line(const GuessState& state) {
  return (state.unsaved ? "Not saved yet; it goes to " : "Nothing is left to save in ") +
         state.output;
}

}  // namespace atom_rviz
