// The panel's tables from messages.
#include <gtest/gtest.h>

#include <limits>

#include "logic/tables.h"
#include "table_laws.h"

namespace atom_rviz {
namespace {

using atom_calibration::CalibrationState;
using atom_calibration::CollectionState;
using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::PatternState;
using atom_calibration::SensorDetection;
using atom_calibration::SensorState;

constexpr double kNow_s = 1000.0;

SensorState sensor_of(const std::string& name, const std::string& modality, double stamp_s) {
  SensorState sensor;
  sensor.name = name;
  sensor.modality = modality;
  sensor.topic = "/" + name + "/data";
  sensor.stamp.fromSec(stamp_s);
  return sensor;
}

PatternState pattern_of(const std::string& name, unsigned points, const std::string& reason) {
  PatternState pattern;
  pattern.pattern_name = name;
  pattern.detected = points > 0;
  pattern.points = points;
  pattern.reason = reason;
  return pattern;
}

CollectionState collection_of(const std::string& name,
                              const std::vector<std::pair<std::string, unsigned>>& detections) {
  CollectionState collection;
  collection.name = name;
  for (const auto& [sensor, points] : detections) {
    SensorDetection detection;
    detection.sensor = sensor;
    detection.pattern_name = "board";
    detection.points = points;
    collection.detections.push_back(detection);
  }
  return collection;
}

TEST(SensorTable, TellsWhatEachSensorSees) {
  CollectorState state;
  state.sensors = {sensor_of("cam", "rgb", kNow_s - 0.2), sensor_of("lidar", "lidar3d", kNow_s)};
  state.sensors[0].colour = 0x42B8A3;
  state.sensors[0].patterns = {pattern_of("board", 48, "")};
  state.sensors[0].patterns[0].possible = 54;
  state.sensors[0].patterns[0].view = "blur 0.8 px, 2.1 m, 34 deg";
  state.sensors[1].patterns = {pattern_of("board", 0, "fewer than 10 points")};
  const Table table = sensor_table(state, kNow_s);
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  EXPECT_EQ(table.header[1], "sees") << "one pattern needs no name";
  EXPECT_EQ(table.rows[0].key, "cam");
  EXPECT_EQ(table.rows[0].cells[0].colour, 0x42B8A3u);
  EXPECT_EQ(table.rows[0].cells[1].text, "48 of 54");
  EXPECT_EQ(table.rows[0].cells[1].tone, Tone::kGood);
  EXPECT_EQ(table.rows[0].cells[3].text, "0.2 s");
  EXPECT_EQ(table.rows[0].cells[4].text, "blur 0.8 px, 2.1 m, 34 deg");
  EXPECT_EQ(table.rows[1].cells[1].tone, Tone::kBad);
  EXPECT_EQ(table.rows[1].cells[4].text, "fewer than 10 points");
}

TEST(SensorTable, SilentAndOldSensorsStandOut) {
  CollectorState state;
  state.sensors = {sensor_of("never", "rgb", 0), sensor_of("old", "rgb", kNow_s - 12),
                   sensor_of("ahead", "rgb", kNow_s + 1)};
  const Table table = sensor_table(state, kNow_s);
  expect_rectangular(table);
  EXPECT_EQ(table.rows[0].cells[3].text, "no data yet");
  EXPECT_EQ(table.rows[0].cells[3].tone, Tone::kBad);
  EXPECT_NE(table.rows[0].cells[3].hint.find("/never/data"), std::string::npos);
  EXPECT_EQ(table.rows[1].cells[3].text, "12 s");
  EXPECT_EQ(table.rows[1].cells[3].tone, Tone::kBad);
  EXPECT_EQ(table.rows[2].cells[3].text, "0.0 s");
}

TEST(SensorTable, SeedsSetByHandAreShownInTheirUnit) {
  CollectorState state;
  state.sensors = {sensor_of("lidar", "lidar3d", kNow_s), sensor_of("depth", "depth", kNow_s),
                   sensor_of("other", "depth", kNow_s), sensor_of("cam", "rgb", kNow_s)};
  state.sensors[0].manual_seed = {1.5, -2.0, 0.25};
  state.sensors[1].manual_seed = {320, 240};
  const Table table = sensor_table(state, kNow_s);
  EXPECT_EQ(table.rows[0].cells[2].text, "by hand");
  EXPECT_EQ(table.rows[0].cells[2].hint, "set by hand: 1.50, -2.00, 0.25 m");
  EXPECT_EQ(table.rows[1].cells[2].hint, "set by hand: 320, 240 px");
  EXPECT_EQ(table.rows[2].cells[2].text, "automatic");
  EXPECT_EQ(table.rows[3].cells[2].text, "");
}

TEST(SensorTable, OnlyRangeSensorsOfTheCollectorTakeSeeds) {
  CollectorState state;
  state.sensors = {sensor_of("lidar", "lidar3d", 0), sensor_of("depth", "depth", 0),
                   sensor_of("cam", "rgb", 0)};
  EXPECT_TRUE(takes_seed(state, "lidar"));
  EXPECT_TRUE(takes_seed(state, "depth"));
  EXPECT_FALSE(takes_seed(state, "cam"));
  EXPECT_FALSE(takes_seed(state, ""));
}

TEST(SensorTable, EachPatternHasARow) {
  CollectorState state;
  state.sensors = {sensor_of("cam", "rgb", kNow_s)};
  state.sensors[0].patterns = {pattern_of("a", 5, ""), pattern_of("b", 0, "not seen")};
  const Table table = sensor_table(state, kNow_s);
  ASSERT_EQ(table.rows.size(), 2u);
  expect_rectangular(table);
  EXPECT_EQ(table.header[1], "pattern");
  EXPECT_EQ(table.rows[1].cells[1].text, "b");
  EXPECT_EQ(table.rows[1].key, "cam");
}

TEST(CollectionTable, IsTheDetectionMatrix) {
  CollectorState state;
  state.sensors = {sensor_of("cam", "rgb", 0), sensor_of("lidar", "lidar3d", 0)};
  CollectionStates collections;
  collections.collections = {collection_of("000", {{"lidar", 812}, {"cam", 48}}),
                             collection_of("001", {{"cam", 40}})};
  const Table table = collection_table(collections, state);
  expect_rectangular(table);
  EXPECT_EQ(table.header, (std::vector<std::string>{"collection", "cam", "lidar"}));
  EXPECT_EQ(table.rows[0].cells[2].text, "812");
  EXPECT_EQ(table.rows[1].key, "001");
  EXPECT_EQ(table.rows[1].cells[1].text, "40");
  EXPECT_EQ(table.rows[1].cells[2].text, "-");
  EXPECT_EQ(table.rows[1].cells[2].tone, Tone::kFaint);
}

TEST(CollectionTable, SensorsOfOldCollectionsAndSeveralPatternsAreNotLost) {
  CollectionStates collections;
  collections.collections = {collection_of("000", {{"gone", 3}, {"gone", 4}})};
  const Table table = collection_table(collections, CollectorState());
  EXPECT_EQ(table.header, (std::vector<std::string>{"collection", "gone"}));
  EXPECT_EQ(table.rows[0].cells[1].text, "7");
  EXPECT_EQ(table.rows[0].cells[1].hint, "board: 3\nboard: 4");
}

TEST(CollectionTable, DetectionWithoutPointsIsStillOne) {
  CollectionStates collections;
  collections.collections = {collection_of("000", {{"cam", 0}})};
  EXPECT_EQ(collection_table(collections, CollectorState()).rows[0].cells[1].text, "0");
}

atom_calibration::ResidualSummary residual_of(const std::string& unit, unsigned count, double rms,
                                              double rms_initial) {
  atom_calibration::ResidualSummary part;
  part.sensor = "s";
  part.kind = "k";
  part.unit = unit;
  part.count = count;
  part.rms = rms;
  part.rms_initial = rms_initial;
  return part;
}

TEST(ResidualTable, HasThreeDigitsTheUnitAndTheToneOfTheGrade) {
  CalibrationState state;
  state.residuals = {residual_of("m", 65922, 0.01234, 0.2), residual_of("px", 5, 0.3456, 0.1)};
  state.residuals[0].grade = "good";
  state.residuals[1].grade = "weak";
  const Table table = residual_table(state);
  expect_rectangular(table);
  EXPECT_EQ(table.rows[0].cells[2].text, "12.3 mm");
  EXPECT_EQ(table.rows[0].cells[2].tone, Tone::kGood);
  EXPECT_EQ(table.rows[0].cells[3].text, "200 mm");
  EXPECT_EQ(table.rows[0].cells[2].hint, "65,922 points: good");
  EXPECT_EQ(table.rows[1].cells[2].text, "0.346 px");
  EXPECT_EQ(table.rows[1].cells[2].tone, Tone::kWeak);
  state.residuals[1].grade = "wrong";
  EXPECT_EQ(residual_table(state).rows[1].cells[2].tone, Tone::kBad);
}

TEST(ResidualTable, LowerThanBeforeIsNotGoodByItself) {
  CalibrationState state;
  state.residuals = {residual_of("m", 10, 0.110, 0.4)};
  EXPECT_EQ(residual_table(state).rows[0].cells[2].tone, Tone::kPlain) << "not judged";
}

TEST(ResidualTable, TellsOncePerSensorHowWellItsPoseIsKnown) {
  CalibrationState state;
  state.residuals = {residual_of("m", 10, 0.01, 0.2), residual_of("m", 10, 0.01, 0.2),
                     residual_of("px", 10, 0.3, 2.0)};
  state.residuals[2].sensor = "held";
  state.sigmas.resize(2);
  state.sigmas[0].sensor = "s";
  state.sigmas[0].translation_m = 0.0004;
  state.sigmas[0].rotation_rad = 0.001;
  state.sigmas[1].sensor = "held";
  state.sigmas[1].held = true;
  const Table table = residual_table(state);
  EXPECT_EQ(table.rows[0].cells[4].text, "0.400 mm, 0.057 deg");
  EXPECT_EQ(table.rows[1].cells[4].text, "");
  EXPECT_EQ(table.rows[2].cells[4].text, "held");
  state.sigmas[0].grade = "weak";
  state.sigmas[0].sentence = "only 4 boards";
  const Cell weak = residual_table(state).rows[0].cells[4];
  EXPECT_EQ(weak.tone, Tone::kWeak);
  EXPECT_EQ(weak.hint.find("weak: only 4 boards"), 0u);
}

TEST(ResidualTable, UnknownFiguresAreDashes) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CalibrationState state;
  state.residuals = {residual_of("px", 0, 0.0, 0.0), residual_of("px", 3, 1.0, nan)};
  const Table table = residual_table(state);
  EXPECT_EQ(table.rows[0].cells[2].text, "-");
  EXPECT_EQ(table.rows[0].cells[3].text, "-");
  EXPECT_EQ(table.rows[1].cells[2].text, "1.00 px");
  EXPECT_EQ(table.rows[1].cells[3].text, "-");
}

TEST(Numbers, AreAsPeopleReadThem) {
  EXPECT_EQ(count_text(0), "0");
  EXPECT_EQ(count_text(999), "999");
  EXPECT_EQ(count_text(1658), "1,658");
  EXPECT_EQ(count_text(1234567), "1,234,567");
  EXPECT_EQ(size_text(0.0000421, "m"), "0.042 mm");
  EXPECT_EQ(size_text(0.00652, "m"), "6.52 mm");
  EXPECT_EQ(size_text(0.0999, "m"), "99.9 mm");
  EXPECT_EQ(size_text(0.12, "m"), "120 mm");
  EXPECT_EQ(size_text(0.9999, "px"), "1.00 px") << "rounded, not 0.100e1 nor 1.000";
}

TEST(Choices, AreAllCollectionsAndEach) {
  CalibrationState state;
  EXPECT_TRUE(collection_choices(state).empty()) << "before the first iteration";
  state.collections = {"000", "007"};
  const auto choices = collection_choices(state);
  ASSERT_EQ(choices.size(), 3u);
  EXPECT_EQ(choices[0].key, "");
  EXPECT_EQ(choices[0].text, "all collections");
  EXPECT_EQ(choices[2].key, "007");
  EXPECT_EQ(choices[2].text, "collection 007");
  EXPECT_EQ(chosen(choices, ""), 0);
  EXPECT_EQ(chosen(choices, "007"), 2);
  EXPECT_EQ(chosen(choices, "gone"), 0);
}

TEST(Lines, SayHowItStands) {
  CollectorState collector;
  collector.collections = 1;
  collector.dataset_folder = "data";
  EXPECT_EQ(collector_line(collector), "1 collection in data");
  collector.collections = 2;
  collector.automatic = true;
  EXPECT_EQ(collector_line(collector), "2 collections in data, automatic");
  CalibrationState calibration;
  calibration.running = true;
  calibration.iteration = 3;
  calibration.cost = 1234.5;
  EXPECT_EQ(calibration_line(calibration), "Running: iteration 3, cost 1234.5");
  calibration.running = false;
  calibration.status = "converged";
  calibration.message = "Seven sensors.";
  EXPECT_EQ(calibration_line(calibration), "CONVERGED: Seven sensors.");
  calibration.grade = "weak";
  EXPECT_EQ(calibration_line(calibration), "WEAK: Seven sensors.") << "the verdict wins";
}

}  // namespace
}  // namespace atom_rviz
