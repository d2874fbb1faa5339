// Which points of a cloud are seen where in the 3D view.
#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "logic/image_view.h"

namespace atom_rviz {

/// How a view draws a cloud. Matrices as in OpenGL: the eye looks along -z, clip coordinates of
/// what is seen lie in -w ... w.
struct Projection {
  Eigen::Matrix4d eye_T_cloud = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d clip_T_eye = Eigen::Matrix4d::Identity();
  Size2 widget;  ///< of the view, screen pixels
};

/// A rectangle that was dragged, from one corner to the opposite one, in screen pixels.
struct Rectangle {
  Point2 from;
  Point2 to;
};

/// Indices, rising, of the points that are drawn inside the rectangle, in whatever order its
/// corners are. Points that are not finite, behind the eye or outside the view are left out.
///
/// With `depth_window_m` > 0 only those that are at most so much farther from the eye (along its
/// line of sight) than the nearest one: a board without the wall that shines through between its
/// points. Throws as CloudPoints.
std::vector<std::uint32_t> points_in_rectangle(const sensor_msgs::PointCloud2& cloud,
                                               const Projection& projection,
                                               const Rectangle& rectangle, double depth_window_m);

/// A point that was hit by a click.
struct PointHit {
  std::uint32_t index = 0;
  Eigen::Vector3d point;     ///< in the cloud's frame, m
  double distance_px = 0.0;  ///< from the click
  double depth_m = 0.0;      ///< from the eye
};

/// Which of two hits is meant: the one nearer to the click; of those within two pixels of each
/// other the one nearer to the eye.
bool is_better(const PointHit& hit, const PointHit& other);

/// The point that a click within `radius_px` of it means; none when there is no point.
/// Throws as CloudPoints.
std::optional<PointHit> point_at(const sensor_msgs::PointCloud2& cloud,
                                 const Projection& projection, Point2 click, double radius_px);

}  // namespace atom_rviz
