#include "logic/tables.h"

#include <algorithm>
#include <cctype>
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

constexpr double kDegrees = 57.29577951308232;  // in a radian

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
  const std::string unit = sensor.modality == "depth" ? " px" : " m";
  return {"by hand", Tone::kPlain, "set by hand: " + text + unit};
}

Cell age_cell(const SensorState& sensor, double now_s,
              const std::map<std::string, double>& same_for_s) {
  if (sensor.stamp.isZero()) return {"no data yet", Tone::kBad, "nothing came on " + sensor.topic};
  const auto same = same_for_s.find(sensor.name);
  double age_s = now_s - sensor.stamp.toSec();
  if (same != same_for_s.end() && (age_s > same->second || age_s < -kAhead_s)) age_s = same->second;
  if (age_s > kOld_s) {
    return {formatted("%.0f s", age_s), Tone::kBad, "nothing came for a while on " + sensor.topic};
  }
  return {formatted("%.1f s", std::max(age_s, 0.0)), Tone::kPlain, ""};
}

std::string seen_text(const PatternState& pattern) {
  const std::string seen = count_text(pattern.points);
  return pattern.possible > 0 ? seen + " of " + count_text(pattern.possible) : seen;
}

Row sensor_row(const SensorState& sensor, const PatternState* pattern, bool named,
               const Cell& age) {
  const bool detected = pattern && pattern->detected;
  const std::string reason = pattern ? pattern->reason : "no labels came yet";
  const std::string how = detected ? pattern->view : reason;
  const Cell sees = detected ? Cell{seen_text(*pattern), Tone::kGood, ""}
                             : Cell{"no", pattern ? Tone::kBad : Tone::kFaint, reason};
  Row row{sensor.name,
          {{sensor.name, Tone::kPlain, sensor.modality + " on " + sensor.topic, sensor.colour},
           sees,
           seed_cell(sensor),
           age,
           {how, Tone::kPlain, how}}};
  if (named) {
    const std::string name = pattern ? pattern->pattern_name : "";
    row.cells.insert(row.cells.begin() + 1, Cell{name, Tone::kPlain, ""});
  }
  return row;
}

Cell detection_cell(const CollectionState& collection, const std::string& sensor) {
  unsigned points = 0;
  std::string hint;
  for (const auto& detection : collection.detections) {
    if (detection.sensor != sensor) continue;
    points += detection.points;
    hint +=
        (hint.empty() ? "" : "\n") + detection.pattern_name + ": " + count_text(detection.points);
  }
  if (hint.empty()) return {"-", Tone::kFaint, sensor + " saw nothing"};
  return {count_text(points), Tone::kGood, hint};
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

Cell sigma_cell(const CalibrationState& state, const std::string& sensor) {
  for (const auto& sigma : state.sigmas) {
    if (sigma.sensor != sensor) continue;
    const Tone tone = tone_of(sigma.grade);
    const std::string why =
        sigma.sentence.empty() ? sensor + "'s pose" : sigma.grade + ": " + sigma.sentence;
    if (sigma.held) return {"held", tone == Tone::kPlain ? Tone::kFaint : tone, why};
    if (!std::isfinite(sigma.translation_m)) return {"-", Tone::kFaint, "not known"};
    return {size_text(sigma.translation_m, "m") + ", " +
                formatted("%.3f", kDegrees * sigma.rotation_rad) + " deg",
            tone, why + "\nStandard deviation of its pose, the largest of the three axes."};
  }
  return {};
}

}  // namespace

Tone tone_of(const std::string& grade) {
  if (grade == "good") return Tone::kGood;
  if (grade == "weak") return Tone::kWeak;
  return grade == "wrong" ? Tone::kBad : Tone::kPlain;
}

std::string count_text(std::uint64_t count) {
  std::string text = std::to_string(count);
  for (int place = static_cast<int>(text.size()) - 3; place > 0; place -= 3) {
    text.insert(static_cast<std::size_t>(place), ",");
  }
  return text;
}

std::string size_text(double value, const std::string& unit) {
  if (!std::isfinite(value)) return "-";
  const double shown = unit == "m" ? 1000.0 * value : value;
  const double size = std::abs(shown);  // three digits, as rounded
  const int decimals = size < 0.9995 ? 3 : size < 9.995 ? 2 : size < 99.95 ? 1 : 0;
  char text[40];
  std::snprintf(text, sizeof(text), "%.*f", decimals, shown);
  return text + std::string(unit == "m" ? " mm" : " " + unit);
}

Table sensor_table(const CollectorState& state, double now_s,
                   const std::map<std::string, double>& same_for_s) {
  const bool named =
      std::any_of(state.sensors.begin(), state.sensors.end(),
                  [](const SensorState& sensor) { return sensor.patterns.size() > 1; });
  Table table{{"sensor", "sees", "seed", "age", "how well"}, {}};
  if (named) table.header.insert(table.header.begin() + 1, "pattern");
  for (const auto& sensor : state.sensors) {
    const Cell age = age_cell(sensor, now_s, same_for_s);
    for (const auto& pattern : sensor.patterns) {
      table.rows.push_back(sensor_row(sensor, &pattern, named, age));
    }
    if (sensor.patterns.empty()) table.rows.push_back(sensor_row(sensor, nullptr, named, age));
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
  Table table{{"sensor", "kind", "rms", "before", "known to"}, {}};
  std::string before;
  for (const ResidualSummary& part : state.residuals) {
    const bool known = part.count > 0 && std::isfinite(part.rms);
    const std::string hint = count_text(part.count) + (part.unit == "px" ? " corners" : " points") +
                             (part.grade.empty() ? "" : ": " + part.grade);
    const Cell sigma = part.sensor == before ? Cell{} : sigma_cell(state, part.sensor);
    before = part.sensor;
    table.rows.push_back(
        {part.sensor,
         {{part.sensor, Tone::kPlain, "", part.colour},
          {part.kind, Tone::kPlain, ""},
          {known ? size_text(part.rms, part.unit) : "-", tone_of(part.grade), hint},
          {part.count > 0 ? size_text(part.rms_initial, part.unit) : "-", Tone::kFaint, ""},
          sigma}});
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
  if (state.running) {
    const std::string line = "Running: iteration " + std::to_string(state.iteration) + ", cost " +
                             formatted("%.5g", state.cost);
    return state.message.empty() ? line : line + ". " + state.message;
  }
  std::string line = state.grade.empty() ? state.status : state.grade;
  for (char& letter : line) letter = static_cast<char>(std::toupper(letter));
  return state.message.empty() ? line : line + ": " + state.message;
}

}  // namespace atom_rviz
