// Rectangles and clicks in the 3D view.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "clouds.h"
#include "logic/point_picking.h"

namespace atom_rviz {
namespace {

const float kNoReturn = std::numeric_limits<float>::quiet_NaN();
using Indices = std::vector<std::uint32_t>;

/// An eye at the origin of the cloud that looks along x, z up, 90 degrees wide; 200 x 200 pixels:
/// the point (d, y, z) is seen at (100 - 100 y / d, 100 - 100 z / d).
Projection looking_along_x() {
  Projection projection;
  projection.eye_T_cloud << 0, -1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0, 0, 1;
  const double near = 0.01;
  projection.clip_T_eye << 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, -2 * near, 0, 0, -1, 0;
  projection.widget = {200, 200};
  return projection;
}

TEST(PointsInRectangle, AreThoseDrawnInItInWhateverDirectionItIsDragged) {
  const auto cloud = cloud_of({{2, 0, 0}, {2, 1, 0}, {2, -1, 0}, {2, 0, 1}}, 4);
  const Projection projection = looking_along_x();
  // At (100, 100), (50, 100), (150, 100), (100, 50).
  const Indices expected{0, 1};
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{40, 90}, {110, 110}}, 0), expected);
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{110, 110}, {40, 90}}, 0), expected);
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{110, 90}, {40, 110}}, 0), expected);
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{0, 0}, {200, 200}}, 0).size(), 4u);
  EXPECT_TRUE(points_in_rectangle(cloud, projection, {{0, 0}, {20, 20}}, 0).empty());
}

TEST(PointsInRectangle, EdgesBelongToIt) {
  const auto cloud = cloud_of({{2, 0, 0}}, 1);
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), {{100, 100}, {120, 120}}, 0).size(), 1u);
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), {{101, 100}, {120, 120}}, 0).size(), 0u);
}

TEST(PointsInRectangle, IndicesCountInvalidPointsOfAnOrganisedCloud) {
  const auto cloud =
      cloud_of({{kNoReturn, kNoReturn, kNoReturn}, {2, 0, 0}, {2, kNoReturn, 0}, {2, 0.1f, 0}}, 2);
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), {{0, 0}, {200, 200}}, 0),
            (Indices{1, 3}));
}

TEST(PointsInRectangle, WhatIsBehindTheEyeOrOutsideTheViewIsNotSeen) {
  const float infinity = std::numeric_limits<float>::infinity();
  const auto cloud =
      cloud_of({{-2, 0, 0}, {0, 0, 0}, {1, 5, 0}, {0.001f, 0, 0}, {infinity, 0, 0}, {3, 0, 0}}, 6);
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), {{-1e9, -1e9}, {1e9, 1e9}}, 0),
            (Indices{5}));
}

TEST(PointsInRectangle, DepthWindowKeepsTheBoardAndLeavesTheWall) {
  const auto cloud = cloud_of({{2, 0, 0}, {2.1f, 0.1f, 0}, {5, 0.1f, 0.1f}}, 3);
  const Rectangle all{{0, 0}, {200, 200}};
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), all, 0.5), (Indices{0, 1}));
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), all, 0.05), (Indices{0}));
  EXPECT_EQ(points_in_rectangle(cloud, looking_along_x(), all, 0).size(), 3u);
}

TEST(PointsInRectangle, PoseOfTheCloudCounts) {
  Projection projection = looking_along_x();
  Eigen::Isometry3d eye_from = Eigen::Isometry3d::Identity();
  eye_from.translate(Eigen::Vector3d(0, 2, 0));  // the cloud stands 2 m to the left
  projection.eye_T_cloud = projection.eye_T_cloud * eye_from.matrix();
  const auto cloud = cloud_of({{4, 0, 0}}, 1);
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{49, 99}, {51, 101}}, 0).size(), 1u);
}

TEST(PointsInRectangle, ParallelViewsWorkToo) {
  Projection projection = looking_along_x();
  projection.clip_T_eye.setIdentity();
  projection.clip_T_eye(0, 0) = projection.clip_T_eye(1, 1) = 0.25;  // 8 m are 200 px
  projection.clip_T_eye(2, 2) = -0.01;
  const auto cloud = cloud_of({{2, 2, 0}, {50, 2, 0}, {2, 5, 0}}, 3);
  EXPECT_EQ(points_in_rectangle(cloud, projection, {{45, 95}, {55, 105}}, 0), (Indices{0, 1}));
}

TEST(PointAt, IsTheNearestToTheClick) {
  const auto cloud = cloud_of({{2, 0, 0}, {2, 0.1f, 0}, {kNoReturn, 0, 0}}, 3);  // at 100 and 95 px
  const auto hit = point_at(cloud, looking_along_x(), {96, 101}, 8);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->index, 1u);
  EXPECT_NEAR(hit->point.y(), 0.1, 1e-6);
  EXPECT_NEAR(hit->depth_m, 2.0, 1e-9);
  EXPECT_NEAR(hit->distance_px, std::sqrt(2.0), 1e-4);
}

TEST(PointAt, OfPointsAtOnePlaceTheOneInFrontIsMeant) {
  const auto cloud = cloud_of({{5, 0, 0}, {2, 0, 0.02f}}, 2);  // at (100, 100) and (100, 99)
  const auto hit = point_at(cloud, looking_along_x(), {100, 100}, 8);
  ASSERT_TRUE(hit);
  EXPECT_EQ(hit->index, 1u);
}

TEST(PointAt, EmptySpaceHitsNothing) {
  const auto cloud = cloud_of({{2, 0, 0}}, 1);
  EXPECT_FALSE(point_at(cloud, looking_along_x(), {120, 100}, 8));
  EXPECT_FALSE(point_at(cloud_of({}, 0), looking_along_x(), {100, 100}, 8));
}

TEST(IsBetter, NearerToTheClickUnlessItIsTheSamePlace) {
  PointHit far_front{0, {}, 6.0, 1.0};
  PointHit near_back{0, {}, 1.0, 5.0};
  PointHit near_front{0, {}, 2.0, 2.0};
  EXPECT_TRUE(is_better(near_back, far_front));
  EXPECT_TRUE(is_better(near_front, near_back));
  EXPECT_FALSE(is_better(near_back, near_front));
}

}  // namespace
}  // namespace atom_rviz
