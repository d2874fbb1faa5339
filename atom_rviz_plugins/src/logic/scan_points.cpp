#include "logic/scan_points.h"

#include <cmath>
#include <cstring>
#include <limits>

namespace atom_rviz {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

bool is_return(const sensor_msgs::LaserScan& scan, float range_m) {
  return std::isfinite(range_m) && range_m > 0.0f && range_m >= scan.range_min &&
         range_m < scan.range_max;
}

}  // namespace

sensor_msgs::PointCloud2 cloud_of_scan(const sensor_msgs::LaserScan& scan) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header = scan.header;
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = cloud.point_step;
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
    cloud.point_step += sizeof(float);
  }
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(scan.ranges.size());
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.data.resize(cloud.row_step);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const float range_m = is_return(scan, scan.ranges[i]) ? scan.ranges[i] : kNan;
    const double azimuth = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
    const float point[3] = {static_cast<float>(range_m * std::cos(azimuth)),
                            static_cast<float>(range_m * std::sin(azimuth)), 0.0f * range_m};
    std::memcpy(cloud.data.data() + i * cloud.point_step, point, sizeof(point));
  }
  return cloud;
}

}  // namespace atom_rviz
