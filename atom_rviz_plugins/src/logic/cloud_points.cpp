#include "logic/cloud_points.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

namespace atom_rviz {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

const PointField* find_field(const PointCloud2& cloud, const std::string& name) {
  const auto found = std::find_if(cloud.fields.begin(), cloud.fields.end(),
                                  [&name](const PointField& field) { return field.name == name; });
  return found == cloud.fields.end() ? nullptr : &*found;
}

void check_size(const PointCloud2& cloud) {
  if (cloud.is_bigendian) throw std::invalid_argument("the cloud's numbers are big endian");
  if (cloud.width == 0 || cloud.height == 0) return;
  const std::size_t row = std::size_t{cloud.width} * cloud.point_step;
  const std::size_t needed = std::size_t{cloud.row_step} * (cloud.height - 1) + row;
  if ((cloud.height > 1 && cloud.row_step < row) || cloud.data.size() < needed) {
    throw std::invalid_argument("the cloud of " + std::to_string(cloud.width) + " x " +
                                std::to_string(cloud.height) + " points has only " +
                                std::to_string(cloud.data.size()) + " bytes of data");
  }
}

}  // namespace

CloudPoints::CloudPoints(const PointCloud2& cloud) : cloud_(cloud) {
  check_size(cloud);
  const char* names[3] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    const PointField* field = find_field(cloud, names[axis]);
    const bool is_float = field && field->datatype == PointField::FLOAT32;
    is_double_[axis] = field && field->datatype == PointField::FLOAT64;
    if (!is_float && !is_double_[axis]) {
      throw std::invalid_argument(std::string("the cloud has no field '") + names[axis] +
                                  "' of type FLOAT32 or FLOAT64");
    }
    offsets_[axis] = field->offset;
    const std::size_t end = std::size_t{field->offset} + (is_float ? 4 : 8);
    if (end > cloud.point_step) {
      throw std::invalid_argument(std::string("the cloud's field '") + names[axis] +
                                  "' does not fit into a record of " +
                                  std::to_string(cloud.point_step) + " bytes");
    }
  }
}

const std::uint8_t* CloudPoints::record(std::size_t index) const {
  const std::size_t row = index / cloud_.width;
  const std::size_t column = index % cloud_.width;
  return cloud_.data.data() + row * cloud_.row_step + column * cloud_.point_step;
}

double CloudPoints::coordinate(const std::uint8_t* record, int axis) const {
  if (is_double_[axis]) {
    double value;
    std::memcpy(&value, record + offsets_[axis], sizeof(value));
    return value;
  }
  float value;
  std::memcpy(&value, record + offsets_[axis], sizeof(value));
  return value;
}

Eigen::Vector3d CloudPoints::at(std::size_t index) const {
  const std::uint8_t* data = record(index);
  return {coordinate(data, 0), coordinate(data, 1), coordinate(data, 2)};
}

PointCloud2 chosen_points(const PointCloud2& cloud, const std::vector<std::uint32_t>& indices) {
  const CloudPoints points(cloud);
  const bool add_index = find_field(cloud, "index") == nullptr;
  PointCloud2 chosen;
  chosen.header = cloud.header;
  chosen.fields = cloud.fields;
  chosen.point_step = cloud.point_step;
  if (add_index) {
    PointField field;
    field.name = "index";
    field.offset = cloud.point_step;
    field.datatype = PointField::UINT32;
    field.count = 1;
    chosen.fields.push_back(field);
    chosen.point_step += sizeof(std::uint32_t);
  }
  chosen.width = static_cast<std::uint32_t>(indices.size());
  chosen.height = 1;
  chosen.row_step = chosen.point_step * chosen.width;
  chosen.is_dense = false;
  chosen.data.resize(chosen.row_step);
  std::uint8_t* out = chosen.data.data();
  for (const std::uint32_t index : indices) {
    std::memcpy(out, points.record(index), cloud.point_step);
    if (add_index) std::memcpy(out + cloud.point_step, &index, sizeof(index));
    out += chosen.point_step;
  }
  return chosen;
}

}  // namespace atom_rviz
