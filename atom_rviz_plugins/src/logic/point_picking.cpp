#include "logic/point_picking.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "logic/cloud_points.h"

namespace atom_rviz {
namespace {

constexpr double kSamePlace_px = 2.0;

struct Seen {
  Point2 place;
  double depth_m;
};

std::optional<Seen> seen_at(const Projection& projection, const Eigen::Vector3d& point) {
  if (!point.allFinite()) return {};
  const Eigen::Vector4d eye = projection.eye_T_cloud * point.homogeneous();
  const Eigen::Vector4d clip = projection.clip_T_eye * eye;
  const double w = clip.w();
  if (!(w > 0.0) || clip.z() < -w || std::abs(clip.x()) > w || std::abs(clip.y()) > w) return {};
  return Seen{{(0.5 + clip.x() / w / 2) * projection.widget.width,
               (0.5 - clip.y() / w / 2) * projection.widget.height},
              -eye.z()};
}

}  // namespace

std::vector<std::uint32_t> points_in_rectangle(const sensor_msgs::PointCloud2& cloud,
                                               const Projection& projection,
                                               const Rectangle& rectangle, double depth_window_m) {
  const CloudPoints points(cloud);
  const auto [left, right] = std::minmax(rectangle.from.x, rectangle.to.x);
  const auto [top, bottom] = std::minmax(rectangle.from.y, rectangle.to.y);
  std::vector<std::uint32_t> indices;
  std::vector<double> depths_m;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::optional<Seen> seen = seen_at(projection, points.at(i));
    if (!seen || seen->place.x < left || seen->place.x > right || seen->place.y < top ||
        seen->place.y > bottom) {
      continue;
    }
    indices.push_back(static_cast<std::uint32_t>(i));
    depths_m.push_back(seen->depth_m);
  }
  if (depth_window_m <= 0.0 || indices.empty()) return indices;
  const double farthest_m = *std::min_element(depths_m.begin(), depths_m.end()) + depth_window_m;
  std::vector<std::uint32_t> near;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (depths_m[i] <= farthest_m) near.push_back(indices[i]);
  }
  return near;
}

bool is_better(const PointHit& hit, const PointHit& other) {
  if (std::abs(hit.distance_px - other.distance_px) <= kSamePlace_px) {
    return hit.depth_m < other.depth_m;
  }
  return hit.distance_px < other.distance_px;
}

std::optional<PointHit> point_at(const sensor_msgs::PointCloud2& cloud,
                                 const Projection& projection, Point2 click, double radius_px) {
  const CloudPoints points(cloud);
  std::vector<PointHit> hits;
  double nearest_px = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d point = points.at(i);
    const std::optional<Seen> seen = seen_at(projection, point);
    if (!seen) continue;
    const double distance_px = std::hypot(seen->place.x - click.x, seen->place.y - click.y);
    if (distance_px > radius_px) continue;
    hits.push_back({static_cast<std::uint32_t>(i), point, distance_px, seen->depth_m});
    nearest_px = std::min(nearest_px, distance_px);
  }
  // Not by is_better from one to the next: being within two pixels of each other is not transitive.
  std::optional<PointHit> best;
  for (const PointHit& hit : hits) {
    if (hit.distance_px > nearest_px + kSamePlace_px) continue;
    if (!best || hit.depth_m < best->depth_m) best = hit;
  }
  return best;
}

}  // namespace atom_rviz
