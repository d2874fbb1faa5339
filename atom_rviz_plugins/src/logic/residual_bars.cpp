#include "logic/residual_bars.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace atom_rviz {
namespace {

using atom_calibration::CalibrationState;
using atom_calibration::ResidualBar;

constexpr double kLeast = 0.08;  // of the height: a bar that is seen can be clicked

Bar bar_of(const ResidualBar& part, double largest) {
  Bar bar;
  bar.sensor = part.sensor;
  bar.collection = part.collection;
  bar.left_out = part.left_out;
  bar.seen = part.count > 0 || part.left_out;
  bar.tone = tone_of(part.grade);
  const bool known = part.count > 0 && std::isfinite(part.rms) && largest > 0.0;
  if (bar.seen) bar.height = known ? std::clamp(part.rms / largest, kLeast, 1.0) : kLeast;
  if (part.left_out) {
    bar.height = 1.0;
    bar.hint = part.sensor + " in " + part.collection + " is left out; a click takes it in again";
  } else if (bar.seen) {
    bar.hint = part.sensor + " in " + part.collection + ": " + size_text(part.rms, part.unit) +
               "; a click leaves it out and solves again";
  }
  return bar;
}

}  // namespace

BarChart bar_chart(const CalibrationState& state) {
  BarChart chart;
  chart.collections = state.collections;
  std::map<std::string, double> largest;
  for (const ResidualBar& part : state.bars) {
    if (std::find(chart.sensors.begin(), chart.sensors.end(), part.sensor) == chart.sensors.end()) {
      chart.sensors.push_back(part.sensor);
    }
    if (!part.left_out && std::isfinite(part.rms)) {
      largest[part.sensor] = std::max(largest[part.sensor], part.rms);
    }
  }
  for (const std::string& sensor : chart.sensors) {
    Colour colour = kNoColour;
    for (const auto& row : state.residuals) {
      if (row.sensor == sensor) colour = row.colour;
    }
    chart.colours.push_back(colour);
    for (const std::string& collection : chart.collections) {
      const auto found =
          std::find_if(state.bars.begin(), state.bars.end(), [&](const ResidualBar& part) {
            return part.sensor == sensor && part.collection == collection;
          });
      Bar none;
      none.sensor = sensor;
      none.collection = collection;
      chart.bars.push_back(found == state.bars.end() ? none : bar_of(*found, largest[sensor]));
    }
  }
  return chart;
}

std::vector<Box> bar_cells(const BarChart& chart, const Box& room) {
  std::vector<Box> cells;
  const double rows = static_cast<double>(chart.sensors.size());
  const double columns = static_cast<double>(chart.collections.size());
  for (std::size_t i = 0; i < chart.bars.size(); ++i) {
    const double row = static_cast<double>(i / chart.collections.size());
    const double column = static_cast<double>(i % chart.collections.size());
    cells.push_back({room.left + column * room.width() / columns,
                     room.top + row * room.height() / rows,
                     room.left + (column + 1.0) * room.width() / columns,
                     room.top + (row + 1.0) * room.height() / rows});
  }
  return cells;
}

const Bar* bar_at(const BarChart& chart, const Box& room, double x, double y) {
  const std::vector<Box> cells = bar_cells(chart, room);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Box& cell = cells[i];
    const bool inside = x >= cell.left && x < cell.right && y >= cell.top && y < cell.bottom;
    if (inside) return chart.bars[i].seen ? &chart.bars[i] : nullptr;
  }
  return nullptr;
}

}  // namespace atom_rviz
