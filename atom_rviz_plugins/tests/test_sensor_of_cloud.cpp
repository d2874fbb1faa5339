// Which sensor a cloud belongs to.
#include <gtest/gtest.h>

#include "logic/sensor_of_cloud.h"

namespace atom_rviz {
namespace {

atom_calibration::CollectorState state_of(
    const std::vector<std::vector<std::string>>& name_modality_topic_frame) {
  atom_calibration::CollectorState state;
  for (const auto& entry : name_modality_topic_frame) {
    atom_calibration::SensorState sensor;
    sensor.name = entry[0];
    sensor.modality = entry[1];
    sensor.topic = entry[2];
    sensor.frame_id = entry[3];
    state.sensors.push_back(sensor);
  }
  return state;
}

TEST(SensorOfCloud, TopicOrWhatStandsBelowIt) {
  const auto state = state_of(
      {{"left", "lidar3d", "/left/points", "l"}, {"left_2", "lidar3d", "/left/points_2", "l"}});
  EXPECT_EQ(sensor_of_cloud(state, "/left/points", "l"), "left");
  EXPECT_EQ(sensor_of_cloud(state, "/left/points/labeled", "l"), "left");
  EXPECT_EQ(sensor_of_cloud(state, "/left/points_2", "l"), "left_2");
}

TEST(SensorOfCloud, OfTopicsBelowEachOtherTheNearestIsMeant) {
  const auto state =
      state_of({{"front", "lidar3d", "/points", "f"}, {"rear", "lidar3d", "/points/rear", "r"}});
  EXPECT_EQ(sensor_of_cloud(state, "/points/rear", "r"), "rear");
  EXPECT_EQ(sensor_of_cloud(state, "/points/rear/labeled", "r"), "rear");
  EXPECT_EQ(sensor_of_cloud(state, "/points/labeled", "f"), "front");
}

TEST(SensorOfCloud, ElseTheOnlyLidarWithTheFrame) {
  auto state = state_of({{"left", "lidar3d", "/left/points", "l"}, {"cam", "rgb", "/cam", "l"}});
  EXPECT_EQ(sensor_of_cloud(state, "/filtered", "l"), "left");
  EXPECT_EQ(sensor_of_cloud(state, "/filtered", "r"), "");
  state.sensors.push_back(state.sensors.front());
  EXPECT_EQ(sensor_of_cloud(state, "/filtered", "l"), "") << "two sensors share the frame";
}

TEST(SensorOfCloud, AScanIsACloudTooAndADepthCamerasPointsAreNot) {
  const auto state =
      state_of({{"scanner", "lidar2d", "/scan", "s"}, {"depth", "depth", "/depth/image_raw", "d"}});
  EXPECT_EQ(sensor_of_cloud(state, "/scan", "s"), "scanner");
  EXPECT_EQ(sensor_of_cloud(state, "/scan/labeled", "s"), "scanner");
  EXPECT_EQ(sensor_of_cloud(state, "/filtered", "s"), "scanner");
  EXPECT_EQ(sensor_of_cloud(state, "/depth/image_raw/labeled3d", "d"), "");
}

TEST(SensorOfCloud, NothingIsKnownBeforeTheCollectorSpeaks) {
  EXPECT_EQ(sensor_of_cloud({}, "/left/points", "l"), "");
}

}  // namespace
}  // namespace atom_rviz
