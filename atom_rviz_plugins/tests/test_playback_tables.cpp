// The panel's page for correcting labels, from messages.
#include <gtest/gtest.h>

#include <limits>

#include "logic/playback_tables.h"
#include "table_laws.h"

namespace atom_rviz {
namespace {

using atom_calibration::CollectionState;
using atom_calibration::CollectionStates;
using atom_calibration::LabelState;
using atom_calibration::PlaybackState;
using atom_calibration::SensorDetection;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

LabelState label_of(const std::string& sensor, const std::string& modality, unsigned points) {
  LabelState label;
  label.sensor = sensor;
  label.modality = modality;
  label.pattern_name = "board";
  label.detected = points > 0;
  label.points = points;
  label.unit = modality == "rgb" ? "px" : "m";
  label.rms = label.worst = kNan;
  label.worst_item = -1;
  return label;
}

PlaybackState state_of(const std::vector<LabelState>& labels) {
  PlaybackState state;
  state.dataset = "data/dataset.json";
  state.collection = "001";
  state.number = 2;
  state.collections = 3;
  state.labels = labels;
  return state;
}

TEST(LabelTable, TellsFiguresInTheUnitsOfTheModality) {
  LabelState corners = label_of("cam", "rgb", 88);
  corners.rms = 0.4321;
  corners.worst = 1.5;
  corners.worst_item = 17;
  LabelState points = label_of("lidar", "lidar3d", 300);
  points.border_points = 24;
  points.rms = 0.01234;
  points.worst = 0.05;
  points.worst_item = 4711;
  const Table table = label_table(state_of({corners, points}));
  expect_rectangular(table);
  ASSERT_EQ(table.rows.size(), 2u);
  EXPECT_EQ(table.rows[0].cells[2].text, "") << "corners have no border";
  EXPECT_EQ(table.rows[0].cells[3].text, "0.432 px");
  EXPECT_EQ(table.rows[0].cells[4].hint, "corner 17: 1.50 px");
  EXPECT_EQ(table.rows[1].cells[2].text, "24");
  EXPECT_EQ(table.rows[1].cells[3].text, "12.3 mm");
  EXPECT_EQ(table.rows[1].cells[4].text, "50.0 mm");
  EXPECT_EQ(table.rows[1].cells[4].hint, "point 4711: 50.0 mm");
}

TEST(LabelTable, WhatIsBadIsRedAndNamed) {
  LabelState corners = label_of("cam", "rgb", 88);
  corners.rms = 1.9;
  corners.worst = 14.82;
  corners.worst_item = 41;
  corners.grade = "wrong";
  LabelState fine = corners;
  fine.grade = "good";
  const Table table = label_table(state_of({corners, fine}));
  EXPECT_EQ(table.rows[0].cells[4].tone, Tone::kBad);
  EXPECT_EQ(table.rows[0].cells[5].text, "corner 41: 14.8 px");
  EXPECT_EQ(table.rows[0].cells[5].tone, Tone::kBad);
  EXPECT_EQ(table.rows[1].cells[4].tone, Tone::kGood);
  EXPECT_EQ(table.rows[1].cells[5].text, "");
}

TEST(LabelTable, SaysWhatIsAbsentCorrectedOrUnreadable) {
  LabelState corrected = label_of("a", "depth", 50);
  corrected.corrected = true;
  LabelState unreadable = label_of("b", "lidar3d", 50);
  unreadable.corrected = true;
  unreadable.problem = "the file is absent";
  const Table table = label_table(state_of({corrected, unreadable, label_of("c", "rgb", 0)}));
  expect_rectangular(table);
  EXPECT_EQ(table.rows[0].cells[5].text, "corrected");
  EXPECT_EQ(table.rows[0].cells[3].text, "-") << "points on a line have no plane";
  EXPECT_EQ(table.rows[1].cells[5].text, "the file is absent");
  EXPECT_EQ(table.rows[1].cells[5].tone, Tone::kBad);
  EXPECT_EQ(table.rows[2].cells[1].text, "-");
  EXPECT_EQ(table.rows[2].cells[3].text, "");
}

TEST(LabelTable, RowsOfOneSensorAreToldApart) {
  LabelState second = label_of("cam", "rgb", 5);
  second.pattern_name = "other";
  const PlaybackState state = state_of({label_of("cam", "rgb", 88), second});
  const Table table = label_table(state);
  expect_rectangular(table);
  EXPECT_EQ(table.rows[1].cells[1].text, "other") << "several patterns are named";
  ASSERT_NE(table.rows[0].key, table.rows[1].key);
  ASSERT_TRUE(label_of_row(state, table.rows[1].key));
  EXPECT_EQ(label_of_row(state, table.rows[1].key)->pattern_name, "other");
  EXPECT_FALSE(label_of_row(state, ""));
  EXPECT_FALSE(label_of_row(state, "2"));
}

TEST(PlaybackTable, SensorsStandInTheOrderOfTheLabelsAndTheShownCollectionStandsOut) {
  CollectionStates collections;
  for (const char* name : {"000", "001"}) {
    CollectionState collection;
    collection.name = name;
    SensorDetection detection;
    detection.sensor = "lidar";
    detection.pattern_name = "board";
    detection.points = 7;
    collection.detections.push_back(detection);
    collections.collections.push_back(collection);
  }
  LabelState other = label_of("cam", "rgb", 5);
  other.pattern_name = "other";
  const Table table = playback_table(
      collections, state_of({label_of("cam", "rgb", 9), other, label_of("lidar", "lidar3d", 7)}));
  expect_rectangular(table);
  EXPECT_EQ(table.header, (std::vector<std::string>{"collection", "cam", "lidar"}));
  ASSERT_EQ(table.rows.size(), 2u);
  EXPECT_EQ(table.rows[0].cells[0].tone, Tone::kPlain);
  EXPECT_EQ(table.rows[1].cells[0].tone, Tone::kGood);
  EXPECT_EQ(table.rows[1].key, "001") << "services know it by this name";
  EXPECT_EQ(table.rows[1].cells[2].text, "7");
}

TEST(PlaybackLine, TellsWhereOneIsAndWhatIsNotSaved) {
  PlaybackState state = state_of({});
  EXPECT_EQ(playback_line(state), "Collection 001 (2 of 3) of data/dataset.json");
  state.unsaved = true;
  EXPECT_EQ(playback_line(state), "Collection 001 (2 of 3) of data/dataset.json, not saved");
}

TEST(PlaybackButtons, AreThereForWhatCanBeDone) {
  PlaybackState state = state_of({label_of("cam", "rgb", 9), label_of("lidar", "lidar3d", 0)});
  PlaybackButtons can = playback_buttons(state, "");
  EXPECT_TRUE(can.turn);
  EXPECT_FALSE(can.undo || can.redo || can.reset || can.save || can.delete_label);
  EXPECT_TRUE(playback_buttons(state, "0").delete_label);
  EXPECT_FALSE(playback_buttons(state, "1").delete_label) << "there is none";
  state.collections = 1;
  state.undo_steps = 1;
  state.unsaved = true;
  state.labels[0].corrected = true;
  can = playback_buttons(state, "");
  EXPECT_FALSE(can.turn);
  EXPECT_TRUE(can.undo && can.reset && can.save);
  EXPECT_FALSE(can.redo);
  state.redo_steps = 2;
  EXPECT_TRUE(playback_buttons(state, "").redo);
}

}  // namespace
}  // namespace atom_rviz
