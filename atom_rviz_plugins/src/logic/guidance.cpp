#include "logic/guidance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace atom_rviz {
namespace {

using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::SensorGuidance;
using atom_calibration::SensorState;
using atom_calibration::ViewedBoard;

Box box_of(const ViewedBoard& board) { return {board.left, board.top, board.right, board.bottom}; }

std::string hint_of(const GuidanceRow& row, const std::string& sentence) {
  std::string hint =
      row.sensor + ": " + count_text(row.boards.size()) + " boards, " + sentence + ".";
  const std::string distances = range_text(row.distances_m, 1, "m");
  const std::string tilts = range_text(row.tilts_deg, 0, "deg");
  if (!distances.empty()) hint += "\nDistances: " + distances + ".";
  if (!tilts.empty()) hint += "\nTilts: " + tilts + ".";
  return hint;
}

GuidanceRow row_of(const SensorGuidance& guidance, const SensorState* sensor) {
  GuidanceRow row;
  row.sensor = guidance.sensor;
  row.colour = guidance.colour;
  row.aspect = guidance.aspect > 0.0f ? guidance.aspect : 1.0;
  for (const ViewedBoard& board : guidance.boards) {
    row.boards.push_back(box_of(board));
    if (std::isfinite(board.distance_m)) row.distances_m.push_back(board.distance_m);
    if (std::isfinite(board.tilt_deg)) row.tilts_deg.push_back(board.tilt_deg);
  }
  if (sensor) {
    for (const auto& pattern : sensor->patterns) {
      for (const ViewedBoard& board : pattern.board) row.now.push_back(box_of(board));
    }
  }
  row.missing = guidance.missing;
  row.enough = guidance.enough;
  row.hint = hint_of(row, guidance.sentence);
  return row;
}

}  // namespace

std::vector<GuidanceRow> guidance_rows(const CollectionStates& collections,
                                       const CollectorState& state) {
  std::vector<GuidanceRow> rows;
  for (const SensorGuidance& guidance : collections.guidance) {
    const auto found =
        std::find_if(state.sensors.begin(), state.sensors.end(),
                     [&](const SensorState& sensor) { return sensor.name == guidance.sensor; });
    rows.push_back(row_of(guidance, found == state.sensors.end() ? nullptr : &*found));
  }
  return rows;
}

std::string short_words(const GuidanceRow& row, std::size_t letters) {
  if (row.enough) return "enough";
  std::string words;
  for (std::size_t i = 0; i < row.missing.size(); ++i) {
    const std::string longer = (i == 0 ? "" : words + ", ") + row.missing[i];
    const std::size_t others = row.missing.size() - i - 1;
    const std::size_t tail = others > 0 ? 3 + std::to_string(others).size() : 0;
    if (i > 0 && longer.size() + tail > letters) {
      return words + " + " + std::to_string(row.missing.size() - i);
    }
    words = longer;
  }
  return words;
}

Box fitted(const Box& room, double aspect) {
  const double width = std::min(room.width(), aspect * room.height());
  const double height = width / aspect;
  const double left = room.left + (room.width() - width) / 2.0;
  const double top = room.top + (room.height() - height) / 2.0;
  return {left, top, left + width, top + height};
}

Box placed(const Box& shares, const Box& map) {
  return {map.left + shares.left * map.width(), map.top + shares.top * map.height(),
          map.left + shares.right * map.width(), map.top + shares.bottom * map.height()};
}

std::string range_text(const std::vector<double>& values, int decimals, const std::string& unit) {
  if (values.empty()) return "";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  char text[80];
  std::snprintf(text, sizeof(text), "%.*f to %.*f ", decimals, *low, decimals, *high);
  return text + unit;
}

}  // namespace atom_rviz
