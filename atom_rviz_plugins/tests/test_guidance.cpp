// Maps of views, bars of residuals and names on the screen, as the panel and the view draw them.
#include <gtest/gtest.h>

#include <limits>

#include "logic/guess_tables.h"
#include "logic/guidance.h"
#include "logic/label_places.h"
#include "logic/residual_bars.h"
#include "table_laws.h"

namespace atom_rviz {
namespace {

using atom_calibration::CalibrationState;
using atom_calibration::CollectionStates;
using atom_calibration::CollectorState;
using atom_calibration::GuessState;
using atom_calibration::ResidualBar;
using atom_calibration::SensorGuess;
using atom_calibration::SensorGuidance;
using atom_calibration::ViewedBoard;

ViewedBoard board_at(float left, float distance_m, float tilt_deg) {
  ViewedBoard board;
  board.left = left;
  board.top = 0.25f;
  board.right = left + 0.25f;
  board.bottom = 0.75f;
  board.distance_m = distance_m;
  board.tilt_deg = tilt_deg;
  return board;
}

TEST(Guidance, HasTheBoardsOfEachSensorAndTheOneThatIsSeenNow) {
  CollectionStates collections;
  SensorGuidance guidance;
  guidance.sensor = "cam";
  guidance.aspect = 1.5f;
  guidance.boards = {board_at(0.0f, 2.0f, 30.0f),
                     board_at(0.5f, std::numeric_limits<float>::quiet_NaN(), 10.0f)};
  guidance.missing = {"near"};
  guidance.sentence = "still missing: near";
  collections.guidance = {guidance};
  CollectorState state;
  state.sensors.resize(1);
  state.sensors[0].name = "cam";
  state.sensors[0].patterns.resize(1);
  state.sensors[0].patterns[0].board = {board_at(0.25f, 1.0f, 0.0f)};
  const auto rows = guidance_rows(collections, state);
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].boards.size(), 2u);
  EXPECT_EQ(rows[0].distances_m.size(), 1u) << "an unknown one is not drawn";
  EXPECT_EQ(rows[0].tilts_deg.size(), 2u);
  ASSERT_EQ(rows[0].now.size(), 1u);
  EXPECT_FLOAT_EQ(rows[0].now[0].left, 0.25);
  EXPECT_NE(rows[0].hint.find("2 boards, still missing: near"), std::string::npos);
  EXPECT_NE(rows[0].hint.find("10 to 30 deg"), std::string::npos);
}

TEST(Guidance, WordsTakeTheRoomThereIsAndNeverLoseThatSomethingIsMissing) {
  GuidanceRow row;
  row.missing = {"6 more boards", "near", "left", "tilted"};
  EXPECT_EQ(short_words(row, 80), "6 more boards, near, left, tilted");
  EXPECT_EQ(short_words(row, 24), "6 more boards, near + 2");
  EXPECT_EQ(short_words(row, 5), "6 more boards + 3");
  row.enough = true;
  EXPECT_EQ(short_words(row, 5), "enough");
}

TEST(Guidance, AMapKeepsTheShapeOfItsView) {
  const Box map = fitted({10, 20, 110, 60}, 1.0);
  EXPECT_DOUBLE_EQ(map.width(), 40.0);
  EXPECT_DOUBLE_EQ(map.height(), 40.0);
  EXPECT_DOUBLE_EQ(map.left, 40.0);
  const Box box = placed({0.5, 0.0, 1.0, 0.25}, map);
  EXPECT_DOUBLE_EQ(box.left, 60.0);
  EXPECT_DOUBLE_EQ(box.bottom, 30.0);
}

ResidualBar bar_of(const std::string& sensor, const std::string& collection, double rms) {
  ResidualBar bar;
  bar.sensor = sensor;
  bar.collection = collection;
  bar.unit = "m";
  bar.count = 10;
  bar.rms = rms;
  bar.grade = "good";
  return bar;
}

CalibrationState state_with_bars() {
  CalibrationState state;
  state.collections = {"000", "001", "002"};
  state.bars = {bar_of("a", "000", 0.01), bar_of("a", "001", 0.02), bar_of("b", "002", 0.5)};
  state.bars.push_back(bar_of("a", "002", std::numeric_limits<double>::quiet_NaN()));
  state.bars.back().left_out = true;
  state.bars.back().count = 0;
  return state;
}

TEST(Bars, EachSensorHasItsOwnScale) {
  const BarChart chart = bar_chart(state_with_bars());
  ASSERT_EQ(chart.bars.size(), 6u);
  EXPECT_DOUBLE_EQ(chart.bars[0].height, 0.5);
  EXPECT_DOUBLE_EQ(chart.bars[1].height, 1.0);
  EXPECT_TRUE(chart.bars[2].left_out);
  EXPECT_FALSE(chart.bars[3].seen);
  EXPECT_DOUBLE_EQ(chart.bars[5].height, 1.0) << "the other sensor's";
}

TEST(Bars, AClickFindsWhatItHits) {
  const BarChart chart = bar_chart(state_with_bars());
  const Box room{100, 0, 160, 40};
  const Bar* hit = bar_at(chart, room, 125.0, 10.0);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->sensor, "a");
  EXPECT_EQ(hit->collection, "001");
  ASSERT_TRUE(bar_at(chart, room, 159.0, 10.0)) << "what is left out can be taken in again";
  EXPECT_FALSE(bar_at(chart, room, 105.0, 30.0)) << "b saw nothing in 000";
  EXPECT_FALSE(bar_at(chart, room, 99.0, 10.0));
  EXPECT_TRUE(bar_chart(CalibrationState()).empty());
  EXPECT_FALSE(bar_at(bar_chart(CalibrationState()), room, 125.0, 10.0));
}

TEST(Names, NoneCoversAnotherAndThoseApartStay) {
  const std::vector<ScreenLabel> labels = {
      {0, 100, 50, 20}, {200, 100, 50, 20}, {10, 105, 50, 20}, {20, 110, 50, 20}};
  const std::vector<double> shifts = shifts_down(labels);
  EXPECT_DOUBLE_EQ(shifts[0], 0.0);
  EXPECT_DOUBLE_EQ(shifts[1], 0.0);
  EXPECT_DOUBLE_EQ(shifts[2], 15.0);
  EXPECT_DOUBLE_EQ(shifts[3], 30.0);
  EXPECT_TRUE(shifts_down({}).empty());
}

TEST(Names, WithoutAPlaceStayAndMoveNoOther) {
  const double nowhere = std::numeric_limits<double>::quiet_NaN();
  const std::vector<ScreenLabel> labels = {{nowhere, nowhere, 50, 20},
                                           {nowhere, nowhere, 50, 20},
                                           {0, 100, 50, 20},
                                           {nowhere, 100, 50, 20},
                                           {0, 100, 50, 20}};
  const std::vector<double> shifts = shifts_down(labels);
  EXPECT_EQ(shifts, (std::vector<double>{0.0, 0.0, 0.0, 0.0, 20.0}));
}

TEST(GuessTable, TellsWhatWasMovedAndHowFarPointsAreOffTheBoard) {
  GuessState state;
  state.output = "first.urdf.xacro";
  SensorGuess lidar, held, still;
  lidar.sensor = "lidar";
  lidar.moved_m = 0.12;
  lidar.moved_rad = 0.1;
  lidar.off_board_m = 0.034;
  lidar.points = 1200;
  lidar.seen_by = "cam";
  held.sensor = "cam";
  held.held = true;
  held.off_board_m = still.off_board_m = std::numeric_limits<double>::quiet_NaN();
  still.sensor = "other";
  state.sensors = {lidar, held, still};
  const Table table = guess_table(state);
  expect_rectangular(table);
  EXPECT_EQ(table.rows[0].cells[1].text, "120 mm, 5.7 deg");
  EXPECT_EQ(table.rows[0].cells[2].text, "34.0 mm");
  EXPECT_NE(table.rows[0].cells[2].hint.find("1,200 points of lidar"), std::string::npos);
  EXPECT_EQ(table.rows[1].cells[1].text, "held");
  EXPECT_EQ(table.rows[1].cells[2].text, "-");
  EXPECT_EQ(table.rows[2].cells[1].text, "not moved");
  state.unsaved = true;
  EXPECT_NE(guess_line(state).find("Not saved yet"), std::string::npos);
}

}  // namespace
}  // namespace atom_rviz
