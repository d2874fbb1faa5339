#include "logic/tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

namespace atom_rviz {
namespace {

using atom_calibration::CalibrationState;
using atom_calibration::CollectionState;
using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::PatternState;
using atom_calibration::ResidualSummary;
using atom_calibration::SensorState;

std::string formatted(const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

Cell seed_cell(const SensorState& sensor) {
  if (sensor.modality == "rgb") return {"", Tone::kFaint, "cameras need no seed"};
  if (sensor.manual_seed.empty()) return {"automatic", Tone::kPlain, ""};
  std::string text;
  for (const double value : sensor.manual_seed) {
    text +=
        (text.empty() ? "" : ", ") + formatted(sensor.modality == "depth" ? "%.0f" : "%.2f", value);
  }
  return {text, Tone::kPlain, sensor.modality == "depth" ? "set by hand, px" : "set by hand, m"};
}

Cell age_cell(const SensorState& sensor, double now_s) {
  if (sensor.stamp.isZero()) return {"no data yet", Tone::kBad, "nothing came on " + sensor.topic};
  const double age_s = now_s - sensor.stamp.toSec();
  if (age_s > kOld_s) {
    return {formatted("%.0f s", age_s), Tone::kBad, "nothing came for a while on " + sensor.topic};
  }
  return {formatted("%.1f s", std::max(age_s, 0.0)), Tone::kPlain, ""};
}

Row sensor_row(const SensorState& sensor, const PatternState* pattern, double now_s) {
  const bool detected = pattern && pattern->detected;
  const std::string reason = pattern ? pattern->reason : "no labels came yet";
  const Cell sees = detected ? Cell{std::to_string(pattern->points), Tone::kGood, ""}
                             : Cell{"no", pattern ? Tone::kBad : Tone::kFaint, reason};
  return {sensor.name,
          {{sensor.name, Tone::kPlain, sensor.modality + " on " + sensor.topic},
           {pattern ? pattern->pattern_name : "", Tone::kPlain, ""},
           sees,
           seed_cell(sensor),
           age_cell(sensor, now_s),
           {detected ? pattern->view : reason, Tone::kPlain, reason}}};
}

Cell detection_cell(const CollectionState& collection, const std::string& sensor) {
  unsigned points = 0;
  std::string hint;
  for (const auto& detection : collection.detections) {
    if (detection.sensor != sensor) continue;
    points += detection.points;
    hint += (hint.empty() ? "" : "\n") + detection.pattern_name + ": " +
            std::to_string(detection.points);
  }
  if (hint.empty()) return {"-", Tone::kFaint, sensor + " saw nothing"};
  return {std::to_string(points), Tone::kGood, hint};
}

std::vector<std::string> sensors_across(const CollectionStates& collections,
                                        const CollectorState& state) {
  std::vector<std::string> names;
  for (const auto& sensor : state.sensors) names.push_back(sensor.name);
  for (const auto& collection : collections.collections) {
    for (const auto& detection : collection.detections) {
      if (std::find(names.begin(), names.end(), detection.sensor) == names.end()) {
        names.push_back(detection.sensor);
      }
    }
  }
  return names;
}

std::string size_text(double value, const std::string& unit) {
  if (!std::isfinite(value)) return "-";
  return unit == "m" ? formatted("%.2f", 1000.0 * value) : formatted("%.3f", value);
}

}  // namespace

Table sensor_table(const CollectorState& state, double now_s) {
  Table table{{"sensor", "pattern", "sees", "seed", "age", "why not"}, {}};
  for (const auto& sensor : state.sensors) {
    for (const auto& pattern : sensor.patterns) {
      table.rows.push_back(sensor_row(sensor, &pattern, now_s));
    }
    if (sensor.patterns.empty()) table.rows.push_back(sensor_row(sensor, nullptr, now_s));
  }
  return table;
}

Table collection_table(const CollectionStates& collections, const CollectorState& state) {
  const std::vector<std::string> sensors = sensors_across(collections, state);
  Table table{{"collection"}, {}};
  table.header.insert(table.header.end(), sensors.begin(), sensors.end());
  for (const auto& collection : collections.collections) {
    Row row{collection.name,
            {{collection.name, Tone::kPlain,
              "data from " + formatted("%.3f", collection.stamp.toSec()) + " s"}}};
    for (const auto& sensor : sensors) row.cells.push_back(detection_cell(collection, sensor));
    table.rows.push_back(row);
  }
  return table;
}

Table residual_table(const CalibrationState& state) {
  Table table{{"sensor", "kind", "count", "rms", "at the start", "unit"}, {}};
  for (const ResidualSummary& part : state.residuals) {
    const bool known = part.count > 0 && std::isfinite(part.rms);
    const bool compared = known && std::isfinite(part.rms_initial);
    const Tone tone = !compared                      ? Tone::kPlain
                      : part.rms <= part.rms_initial ? Tone::kGood
                                                     : Tone::kBad;
    table.rows.push_back(
        {part.sensor,
         {{part.sensor, Tone::kPlain, ""},
          {part.kind, Tone::kPlain, ""},
          {std::to_string(part.count), Tone::kPlain, ""},
          {known ? size_text(part.rms, part.unit) : "-", tone, ""},
          {part.count > 0 ? size_text(part.rms_initial, part.unit) : "-", Tone::kFaint, ""},
          {part.unit == "m" ? "mm" : part.unit, Tone::kFaint, ""}}});
  }
  return table;
}

std::vector<Choice> collection_choices(const CalibrationState& state) {
  std::vector<Choice> choices;
  if (state.collections.empty()) return choices;
  choices.push_back({"", "all collections"});
  for (const std::string& key : state.collections) choices.push_back({key, "collection " + key});
  return choices;
}

int chosen(const std::vector<Choice>& choices, const std::string& key) {
  const auto found = std::find_if(choices.begin(), choices.end(),
                                  [&key](const Choice& choice) { return choice.key == key; });
  return found == choices.end() ? 0 : static_cast<int>(found - choices.begin());
}

bool takes_seed(const CollectorState& state, const std::string& sensor) {
  return std::any_of(state.sensors.begin(), state.sensors.end(), [&](const SensorState& entry) {
    return entry.name == sensor && entry.modality != "rgb";
  });
}

std::string collector_line(const CollectorState& state) {
  return std::to_string(state.collections) +
         (state.collections == 1 ? " collection in " : " collections in ") + state.dataset_folder +
         (state.automatic ? ", automatic" : "");
}

std::string calibration_line(const CalibrationState& state) {
  std::string line = state.running ? "running" : state.status;
  line +=
      ": iteration " + std::to_string(state.iteration) + ", cost " + formatted("%.6g", state.cost);
  return state.message.empty() ? line : line + ". " + state.message;
}

}  // namespace atom_rviz
