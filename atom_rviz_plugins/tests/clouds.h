// Clouds for the tests.
#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Core>
#include <cstring>
#include <string>
#include <vector>

namespace atom_rviz {

/// A cloud with fields x, y, z, and between them a byte that is not used and an `intensity` that
/// counts 100, 101, ...; rows end with padding of 5 bytes.
inline sensor_msgs::PointCloud2 cloud_of(const std::vector<Eigen::Vector3f>& points,
                                         unsigned width) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.frame_id = "lidar";
  cloud.header.stamp.fromNSec(1234567890123456789ull);
  const char* names[4] = {"x", "y", "z", "intensity"};
  const unsigned offsets[4] = {0, 4, 9, 13};
  for (int i = 0; i < 4; ++i) {
    sensor_msgs::PointField field;
    field.name = names[i];
    field.offset = offsets[i];
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.point_step = 17;
  cloud.width = width;
  cloud.height = width ? points.size() / width : 0;
  cloud.row_step = width * cloud.point_step + 5;
  cloud.data.assign(std::size_t{cloud.row_step} * cloud.height, 0xEE);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::uint8_t* record =
        cloud.data.data() + i / width * cloud.row_step + i % width * cloud.point_step;
    const float values[4] = {points[i].x(), points[i].y(), points[i].z(), 100.0f + i};
    for (int k = 0; k < 4; ++k) std::memcpy(record + offsets[k], &values[k], sizeof(float));
  }
  return cloud;
}

}  // namespace atom_rviz
