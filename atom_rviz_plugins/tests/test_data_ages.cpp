// How long ago data came: by their stamps, and by when the stamps changed.
#include <gtest/gtest.h>

#include "logic/data_ages.h"
#include "logic/tables.h"

namespace atom_rviz {
namespace {

constexpr double kStamp_s = 100.0;  // of a recording that is played without /clock
constexpr double kToday_s = 1.8e9;

atom_calibration::CollectorState state_at(double stamp_s) {
  atom_calibration::CollectorState state;
  atom_calibration::SensorState sensor;
  sensor.name = "lidar";
  sensor.modality = "lidar3d";
  sensor.stamp = ros::Time(stamp_s);
  state.sensors.push_back(sensor);
  return state;
}

Cell age_of(const atom_calibration::CollectorState& state, double now_s, const DataAges& ages,
            double clock_s) {
  return sensor_table(state, now_s, ages.at(clock_s)).rows.front().cells[3];
}

TEST(DataAges, DataThatComeAreNotOldWhateverTheirClockSays) {
  DataAges ages;
  ages.note(state_at(kStamp_s), 10.0);
  ages.note(state_at(kStamp_s + 0.2), 10.4);
  const Cell age = age_of(state_at(kStamp_s + 0.2), kToday_s, ages, 10.5);
  EXPECT_EQ(age.text, "0.1 s");
  EXPECT_EQ(age.tone, Tone::kPlain);
}

TEST(DataAges, DataThatHaveCeasedToComeAreOld) {
  DataAges ages;
  for (double clock_s : {10.0, 12.0, 14.0}) ages.note(state_at(kStamp_s), clock_s);
  const Cell age = age_of(state_at(kStamp_s), kToday_s, ages, 15.0);
  EXPECT_EQ(age.text, "5 s");
  EXPECT_EQ(age.tone, Tone::kBad);
}

TEST(DataAges, WhereNoClockGoesTheyAreOldAllTheSame) {
  DataAges ages;
  ages.note(state_at(kStamp_s), 10.0);
  EXPECT_EQ(age_of(state_at(kStamp_s), 0.0, ages, 14.0).text, "4 s") << "/use_sim_time, no /clock";
}

TEST(DataAges, WhileARecordingIsPausedNothingGetsOld) {
  DataAges ages;
  ages.note(state_at(kStamp_s), 10.0);
  EXPECT_EQ(age_of(state_at(kStamp_s), kStamp_s + 0.3, ages, 500.0).text, "0.3 s");
}

}  // namespace
}  // namespace atom_rviz
