// The residuals of each sensor in each collection, as bars that can be clicked.
#pragma once

#include <atom_calibration/CalibrationState.h>

#include <string>
#include <vector>

#include "logic/guidance.h"
#include "logic/tables.h"

namespace atom_rviz {

/// A sensor in a collection.
struct Bar {
  std::string sensor;
  std::string collection;
  double height = 0.0;  ///< of 1, the largest bar of the sensor that is used
  Tone tone = Tone::kPlain;
  bool left_out = false;
  bool seen = false;  ///< the sensor has a detection there
  std::string hint;
};

/// Sensors down, collections across.
struct BarChart {
  std::vector<std::string> sensors;
  std::vector<Colour> colours;
  std::vector<std::string> collections;
  std::vector<Bar> bars;  ///< row after row

  bool empty() const { return bars.empty(); }
};

BarChart bar_chart(const atom_calibration::CalibrationState& state);

/// Where the bars of a chart lie in a rectangle of the screen, row after row.
std::vector<Box> bar_cells(const BarChart& chart, const Box& room);

/// The bar under a position of the screen; null: none that is seen.
const Bar* bar_at(const BarChart& chart, const Box& room, double x, double y);

}  // namespace atom_rviz
