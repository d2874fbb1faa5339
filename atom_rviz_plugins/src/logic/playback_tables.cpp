#include "logic/playback_tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace atom_rviz {
namespace {

using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::LabelState;
using atom_calibration::PlaybackState;
using atom_calibration::SensorState;

constexpr double kMillimetres = 1000.0;  // in a metre

std::string figure_text(double value, const std::string& unit) {
  if (!std::isfinite(value)) return "-";
  char text[40];
  std::snprintf(text, sizeof(text), "%.2f", unit == "m" ? kMillimetres * value : value);
  return text;
}

std::string item_hint(const LabelState& label) {
  if (label.worst_item < 0) return "";
  const std::string number = std::to_string(label.worst_item);
  return label.modality == "rgb" ? "corner " + number : "point " + number;
}

Row label_row(const LabelState& label, std::size_t place) {
  const Cell count = label.detected ? Cell{std::to_string(label.points), Tone::kGood, ""}
                                    : Cell{"-", Tone::kFaint, label.sensor + " has no label here"};
  const bool has_border = label.detected && label.modality != "rgb";
  const std::string unit = label.unit == "m" ? "mm" : label.unit;
  const std::string note = !label.problem.empty() ? label.problem
                           : label.corrected      ? "corrected"
                                                  : "";
  return {
      std::to_string(place),
      {{label.sensor, Tone::kPlain, label.modality + " on " + label.topic},
       {label.pattern_name, Tone::kPlain, ""},
       count,
       {has_border ? std::to_string(label.border_points) : "", Tone::kPlain, ""},
       {label.detected ? figure_text(label.rms, label.unit) : "", Tone::kPlain, ""},
       {label.detected ? figure_text(label.worst, label.unit) : "", Tone::kPlain, item_hint(label)},
       {unit, Tone::kFaint, ""},
       {note, label.problem.empty() ? Tone::kPlain : Tone::kBad, note}}};
}

}  // namespace

Table label_table(const PlaybackState& state) {
  Table table{{"sensor", "pattern", "points", "border", "rms", "worst", "unit", "note"}, {}};
  for (std::size_t i = 0; i < state.labels.size(); ++i) {
    table.rows.push_back(label_row(state.labels[i], i));
  }
  return table;
}

const LabelState* label_of_row(const PlaybackState& state, const std::string& key) {
  for (std::size_t i = 0; i < state.labels.size(); ++i) {
    if (std::to_string(i) == key) return &state.labels[i];
  }
  return nullptr;
}

Table playback_table(const CollectionStates& collections, const PlaybackState& state) {
  CollectorState across;
  for (const LabelState& label : state.labels) {
    const auto known = [&label](const SensorState& sensor) { return sensor.name == label.sensor; };
    if (std::any_of(across.sensors.begin(), across.sensors.end(), known)) continue;
    SensorState sensor;
    sensor.name = label.sensor;
    across.sensors.push_back(sensor);
  }
  Table table = collection_table(collections, across);
  for (Row& row : table.rows) {
    if (row.key != state.collection) continue;
    row.cells.front().text += " (shown)";
    row.cells.front().tone = Tone::kGood;
  }
  return table;
}

std::string playback_line(const PlaybackState& state) {
  return "Collection " + state.collection + " (" + std::to_string(state.number) + " of " +
         std::to_string(state.collections) + ") of " + state.dataset +
         (state.unsaved ? ", not saved" : "");
}

PlaybackButtons playback_buttons(const PlaybackState& state, const std::string& selected) {
  const LabelState* label = label_of_row(state, selected);
  const bool corrected =
      std::any_of(state.labels.begin(), state.labels.end(),
                  [](const LabelState& entry) { return static_cast<bool>(entry.corrected); });
  PlaybackButtons buttons;
  buttons.turn = state.collections > 1;
  buttons.undo = state.undo_steps > 0;
  buttons.redo = state.redo_steps > 0;
  buttons.reset = corrected;
  buttons.save = state.unsaved;
  buttons.delete_label = label && label->detected;
  return buttons;
}

}  // namespace atom_rviz
