#include "logic/playback_tables.h"

#include <algorithm>

namespace atom_rviz {
namespace {

using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::LabelState;
using atom_calibration::PlaybackState;
using atom_calibration::SensorState;

/// What is bad is named: "corner 41: 14.8 px".
std::string worst_text(const LabelState& label) {
  if (label.worst_item < 0) return "";
  const std::string item = label.modality == "rgb" ? "corner " : "point ";
  return item + std::to_string(label.worst_item) + ": " + size_text(label.worst, label.unit);
}

std::string note_of(const LabelState& label, bool bad) {
  if (!label.problem.empty()) return label.problem;
  std::string note = bad ? worst_text(label) : "";
  if (label.corrected) note += note.empty() ? "corrected" : ", corrected";
  return note;
}

Row label_row(const LabelState& label, std::size_t place, bool named) {
  const Tone tone = label.problem.empty() ? tone_of(label.grade) : Tone::kBad;
  const bool bad = tone == Tone::kWeak || tone == Tone::kBad;
  const Cell count = label.detected ? Cell{count_text(label.points), Tone::kGood, ""}
                                    : Cell{"-", Tone::kFaint, label.sensor + " has no label here"};
  const bool has_border = label.detected && label.modality != "rgb";
  const std::string note = note_of(label, bad);
  Row row{std::to_string(place),
          {{label.sensor, Tone::kPlain, label.modality + " on " + label.topic, label.colour},
           count,
           {has_border ? count_text(label.border_points) : "", Tone::kPlain, ""},
           {label.detected ? size_text(label.rms, label.unit) : "", tone, ""},
           {label.detected ? size_text(label.worst, label.unit) : "", tone, worst_text(label)},
           {note, bad ? tone : Tone::kPlain, note}}};
  if (named) row.cells.insert(row.cells.begin() + 1, Cell{label.pattern_name, Tone::kPlain, ""});
  return row;
}

}  // namespace

Table label_table(const PlaybackState& state) {
  const bool named =
      std::any_of(state.labels.begin(), state.labels.end(), [&](const LabelState& label) {
        return label.pattern_name != state.labels.front().pattern_name;
      });
  Table table{{"sensor", "points", "border", "rms", "worst", "note"}, {}};
  if (named) table.header.insert(table.header.begin() + 1, "pattern");
  for (std::size_t i = 0; i < state.labels.size(); ++i) {
    table.rows.push_back(label_row(state.labels[i], i, named));
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
