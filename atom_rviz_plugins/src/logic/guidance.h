// Where in its view each sensor has seen boards, and what is still missing, ready to be drawn.
#pragma once

#include <atom_calibration/CollectionStates.h>
#include <atom_calibration/CollectorState.h>

#include <string>
#include <vector>

#include "logic/tables.h"

namespace atom_rviz {

/// A rectangle; of a view its sides are shares, 0 left and top.
struct Box {
  double left = 0.0;
  double top = 0.0;
  double right = 0.0;
  double bottom = 0.0;

  double width() const { return right - left; }
  double height() const { return bottom - top; }
};

/// What the panel draws of one sensor.
struct GuidanceRow {
  std::string sensor;
  Colour colour = kNoColour;
  double aspect = 1.0;              ///< width of the view by its height
  std::vector<Box> boards;          ///< of all collections
  std::vector<Box> now;             ///< what it sees at the moment
  std::vector<double> distances_m;  ///< of the boards, those that are known
  std::vector<double> tilts_deg;
  std::vector<std::string> missing;
  bool enough = false;
  std::string hint;  ///< the whole sentence, and the figures
};

/// A row for each sensor, in the order of the collector.
std::vector<GuidanceRow> guidance_rows(const atom_calibration::CollectionStates& collections,
                                       const atom_calibration::CollectorState& state);

/// "enough", or what is missing in as many letters as there is room for: "near, left + 2".
std::string short_words(const GuidanceRow& row, std::size_t letters);

/// The largest rectangle of an aspect within another one, in its middle.
Box fitted(const Box& room, double aspect);

/// A box of the view as it lies in a rectangle of the screen.
Box placed(const Box& shares, const Box& map);

/// "1.2 to 3.4 m"; empty without values.
std::string range_text(const std::vector<double>& values, int decimals, const std::string& unit);

}  // namespace atom_rviz
