// The beams of a scan as a cloud.
#pragma once

#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>

namespace atom_rviz {

/// Every beam of a scan as a point x, y, z (FLOAT32, m) in the scan's frame, z = 0, in the order of
/// `ranges`, so that the place of a point is the index of its beam. Points are NaN where the range
/// is no return: not finite, not positive, below `range_min`, or from `range_max` on.
sensor_msgs::PointCloud2 cloud_of_scan(const sensor_msgs::LaserScan& scan);

}  // namespace atom_rviz
