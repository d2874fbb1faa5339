// Scans as clouds.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "logic/cloud_points.h"
#include "logic/scan_points.h"

namespace atom_rviz {
namespace {

const float kQuarter = static_cast<float>(M_PI / 2);

sensor_msgs::LaserScan scan_of(const std::vector<float>& ranges, float step) {
  sensor_msgs::LaserScan scan;
  scan.header.frame_id = "scanner";
  scan.header.stamp.fromNSec(1234567890123456789ull);
  scan.angle_increment = step;
  scan.range_min = 0.1f;
  scan.range_max = 9.0f;
  scan.ranges = ranges;
  return scan;
}

TEST(CloudOfScan, BeamsFollowTheSensorsRotation) {
  for (const float sign : {1.0f, -1.0f}) {
    const auto cloud = cloud_of_scan(scan_of({2, 3, 4}, sign * kQuarter));
    const CloudPoints points(cloud);
    ASSERT_EQ(points.size(), 3u);
    EXPECT_TRUE(points.at(0).isApprox(Eigen::Vector3d(2, 0, 0), 1e-6));
    EXPECT_TRUE(points.at(1).isApprox(Eigen::Vector3d(0, sign * 3, 0), 1e-6));
    EXPECT_TRUE(points.at(2).isApprox(Eigen::Vector3d(-4, 0, 0), 1e-6));
  }
}

TEST(CloudOfScan, WhatIsNoReturnKeepsItsPlace) {
  const float infinite = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto cloud =
      cloud_of_scan(scan_of({2, infinite, -infinite, nan, 0, 0.05f, 9, -1, 5}, 0.5f));
  const CloudPoints points(cloud);
  ASSERT_EQ(points.size(), 9u);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points.at(i).allFinite(), i == 0 || i == 8) << i;
    EXPECT_EQ(points.at(i).hasNaN(), i != 0 && i != 8) << i;
  }
}

TEST(CloudOfScan, HeaderIsTheScans) {
  const auto scan = scan_of({2, 3}, 0.5f);
  EXPECT_EQ(cloud_of_scan(scan).header, scan.header);
}

TEST(CloudOfScan, WithoutRangesItIsEmpty) {
  EXPECT_EQ(CloudPoints(cloud_of_scan(scan_of({}, 0.5f))).size(), 0u);
}

}  // namespace
}  // namespace atom_rviz
