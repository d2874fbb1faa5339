// The coordinates in a message of a point cloud.
#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace atom_rviz {

/// The points of a cloud by their index: row after row, invalid points counted.
///
/// Keeps a reference to the message, which has to outlive it.
class CloudPoints {
 public:
  /// Throws std::invalid_argument, with a sentence for the user: no fields x, y, z of type FLOAT32
  /// or FLOAT64, fewer data than the size demands, another byte order than the computer's.
  explicit CloudPoints(const sensor_msgs::PointCloud2& cloud);

  std::size_t size() const { return std::size_t{cloud_.width} * cloud_.height; }

  /// Coordinates in m in the cloud's frame; not finite where nothing was measured.
  Eigen::Vector3d at(std::size_t index) const;

  /// The bytes of a point's record, `point_step` of them.
  const std::uint8_t* record(std::size_t index) const;

 private:
  double coordinate(const std::uint8_t* record, int axis) const;

  const sensor_msgs::PointCloud2& cloud_;
  std::uint32_t offsets_[3] = {0, 0, 0};
  bool is_double_[3] = {false, false, false};
};

/// The chosen points as a cloud of one row with the header of the whole.
///
/// Records are copied as they are, with all fields. Unless the cloud has a field of that name
/// already, `index` (UINT32) is added: the place of the point in the whole cloud.
sensor_msgs::PointCloud2 chosen_points(const sensor_msgs::PointCloud2& cloud,
                                       const std::vector<std::uint32_t>& indices);

}  // namespace atom_rviz
