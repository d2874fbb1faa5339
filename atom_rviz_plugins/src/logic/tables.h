// What the panel shows, as plain tables of text.
#pragma once

#include <atom_calibration/CalibrationState.h>
#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/CollectorState.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace atom_rviz {

/// How a cell is coloured.
enum class Tone { kPlain, kGood, kWeak, kBad, kFaint };

/// The tone of a grade: "good", "weak" or "wrong"; any other is plain.
Tone tone_of(const std::string& grade);

/// 0xRRGGBB; a sensor has the same in every picture.
using Colour = std::uint32_t;
constexpr Colour kNoColour = 0xFFFFFFFF;

/// A cell; `hint` is shown when the mouse rests on it, `colour` as a square before the text.
struct Cell {
  std::string text;
  Tone tone = Tone::kPlain;
  std::string hint;
  Colour colour = kNoColour;
};

/// A row; `key` is the name that services know it by: of a sensor, of a collection.
struct Row {
  std::string key;
  std::vector<Cell> cells;
};

/// Every row has as many cells as there are names in the header.
struct Table {
  std::vector<std::string> header;
  std::vector<Row> rows;
};

/// Sensors while data are collected: a row for each sensor and pattern; the pattern has a column
/// where there are several.
///
/// Labels older than `kOld_s` at `now_s` are said to be old: their sensor is silent. Stamps may be
/// of another clock, so none is older than it has been the newest for, `same_for_s` by sensor.
Table sensor_table(const atom_calibration::CollectorState& state, double now_s,
                   const std::map<std::string, double>& same_for_s = {});
constexpr double kOld_s = 3.0;
constexpr double kAhead_s = 1.0;  // stamps that lie further ahead are of another clock, too

/// The detection matrix: collections down, sensors across, in each cell the number of points or
/// corners; several patterns of a sensor are added up, and told apart by the hint.
///
/// Sensors stand in the order of `state`; those that only occur in `collections` follow.
Table collection_table(const atom_calibration::CollectionStates& collections,
                       const atom_calibration::CollectorState& state);

/// Residuals of each sensor and kind of what is shown: rms now and before, in px or mm, and how
/// well the sensor's pose is known. The colour of a number is its grade.
Table residual_table(const atom_calibration::CalibrationState& state);

/// A collection to choose; `key` is the name that services know it by, empty for all of them.
struct Choice {
  std::string key;
  std::string text;
};

/// What a calibration can show: all collections, then each; nothing before it tells.
std::vector<Choice> collection_choices(const atom_calibration::CalibrationState& state);

/// The place of the collection that is shown among these; all of them where it is unknown.
int chosen(const std::vector<Choice>& choices, const std::string& key);

/// Whether a sensor of the collector begins its labels at a seed; cameras do not.
bool takes_seed(const atom_calibration::CollectorState& state, const std::string& sensor);

/// A whole number as people read it: "65,922".
std::string count_text(std::uint64_t count);

/// A residual or a length in three digits with its unit, m as mm: "0.313 px", "9.80 mm", "124 mm".
std::string size_text(double value, const std::string& unit);

/// One line: "12 collections in FOLDER, automatic".
std::string collector_line(const atom_calibration::CollectorState& state);

/// One line: "running: iteration 3, cost 123.4" or the status and what it means.
std::string calibration_line(const atom_calibration::CalibrationState& state);

}  // namespace atom_rviz
