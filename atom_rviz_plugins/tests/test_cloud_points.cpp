// Coordinates of messages of clouds, and the chosen points as a cloud.
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "clouds.h"
#include "logic/cloud_points.h"

namespace atom_rviz {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

const std::vector<Eigen::Vector3f> kSix{{0, 1, 2},   {3, 4, 5},    {6, 7, 8},
                                        {9, 10, 11}, {12, 13, 14}, {15, 16, 17}};

template <typename T>
T field_of(const PointCloud2& cloud, std::size_t index, const std::string& name) {
  for (const PointField& field : cloud.fields) {
    if (field.name != name) continue;
    T value;
    std::memcpy(&value, cloud.data.data() + index * cloud.point_step + field.offset, sizeof(T));
    return value;
  }
  ADD_FAILURE() << "no field " << name;
  return T();
}

TEST(CloudPoints, OrganisedCloudIsReadRowAfterRowWithItsPadding) {
  const PointCloud2 cloud = cloud_of(kSix, 3);
  ASSERT_EQ(cloud.height, 2u);
  const CloudPoints points(cloud);
  ASSERT_EQ(points.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(points.at(i), kSix[i].cast<double>().eval()) << i;
  }
}

TEST(CloudPoints, DoublesAreReadToo) {
  PointCloud2 cloud;
  for (int axis = 0; axis < 3; ++axis) {
    PointField field;
    field.name = std::string(1, static_cast<char>('x' + axis));
    field.offset = 8 * axis;
    field.datatype = PointField::FLOAT64;
    cloud.fields.push_back(field);
  }
  cloud.width = cloud.height = 1;
  cloud.point_step = cloud.row_step = 24;
  const double xyz[3] = {0.1, 0.2, 0.3};
  cloud.data.resize(24);
  std::memcpy(cloud.data.data(), xyz, 24);
  EXPECT_EQ(CloudPoints(cloud).at(0), Eigen::Vector3d(0.1, 0.2, 0.3));
}

TEST(CloudPoints, BrokenCloudsAreRefused) {
  PointCloud2 no_z = cloud_of(kSix, 3);
  no_z.fields[2].name = "zz";
  EXPECT_THROW(CloudPoints{no_z}, std::invalid_argument);
  PointCloud2 of_integers = cloud_of(kSix, 3);
  of_integers.fields[0].datatype = PointField::INT32;
  EXPECT_THROW(CloudPoints{of_integers}, std::invalid_argument);
  PointCloud2 short_of_data = cloud_of(kSix, 3);
  short_of_data.data.resize(80);
  EXPECT_THROW(CloudPoints{short_of_data}, std::invalid_argument);
  PointCloud2 rows_overlap = cloud_of(kSix, 3);
  rows_overlap.row_step = 17;
  EXPECT_THROW(CloudPoints{rows_overlap}, std::invalid_argument);
  PointCloud2 big = cloud_of(kSix, 3);
  big.is_bigendian = true;
  EXPECT_THROW(CloudPoints{big}, std::invalid_argument);
  PointCloud2 outside = cloud_of(kSix, 3);
  outside.fields[1].offset = 14;
  EXPECT_THROW(CloudPoints{outside}, std::invalid_argument);
}

TEST(CloudPoints, EmptyCloudHasNoPoints) { EXPECT_EQ(CloudPoints(cloud_of({}, 0)).size(), 0u); }

TEST(ChosenPoints, KeepsHeaderAndFieldsAndAddsThePlaceInTheWhole) {
  const PointCloud2 cloud = cloud_of(kSix, 3);
  const PointCloud2 chosen = chosen_points(cloud, {1, 5});
  EXPECT_EQ(chosen.header.frame_id, "lidar");
  EXPECT_EQ(chosen.header.stamp, cloud.header.stamp);
  EXPECT_EQ(chosen.width, 2u);
  EXPECT_EQ(chosen.height, 1u);
  EXPECT_EQ(chosen.data.size(), 2u * chosen.point_step);
  EXPECT_EQ(CloudPoints(chosen).at(1), Eigen::Vector3d(15, 16, 17));
  EXPECT_EQ(field_of<std::uint32_t>(chosen, 0, "index"), 1u);
  EXPECT_EQ(field_of<std::uint32_t>(chosen, 1, "index"), 5u);
  EXPECT_EQ(field_of<float>(chosen, 1, "intensity"), 105.0f);
}

TEST(ChosenPoints, AnIndexOfTheCloudItselfIsKept) {
  PointCloud2 cloud = cloud_of(kSix, 3);
  cloud.fields[3].name = "index";
  const PointCloud2 chosen = chosen_points(cloud, {4});
  EXPECT_EQ(chosen.point_step, cloud.point_step);
  EXPECT_EQ(field_of<float>(chosen, 0, "index"), 104.0f);
}

TEST(ChosenPoints, IndicesBeyondFloatAreExact) {
  const unsigned many = (1u << 24) + 2;
  PointCloud2 cloud = cloud_of({{1, 2, 3}}, 1);
  cloud.fields.resize(3);
  cloud.width = many;
  cloud.point_step = 13;
  cloud.row_step = 13 * many;
  cloud.data.resize(cloud.row_step);
  const PointCloud2 chosen = chosen_points(cloud, {many - 1});
  EXPECT_EQ(field_of<std::uint32_t>(chosen, 0, "index"), many - 1);
}

TEST(ChosenPoints, NoneIsAnEmptyCloudWithTheHeader) {
  const PointCloud2 chosen = chosen_points(cloud_of(kSix, 3), {});
  EXPECT_EQ(chosen.width, 0u);
  EXPECT_EQ(chosen.header.frame_id, "lidar");
  EXPECT_TRUE(chosen.data.empty());
}

}  // namespace
}  // namespace atom_rviz
