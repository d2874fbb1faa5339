#include "logic/polygon_drawing.h"

#include <cmath>

namespace atom_rviz {
namespace {

constexpr double kSameCorner_px = 1e-6;
constexpr double kLeastArea_px2 = 1e-3;

double distance_px(Point2 a, Point2 b) { return std::hypot(a.x - b.x, a.y - b.y); }

}  // namespace

double area_px2(const std::vector<Point2>& polygon) {
  double twice = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Point2& a = polygon[i];
    const Point2& b = polygon[(i + 1) % polygon.size()];
    twice += a.x * b.y - b.x * a.y;
  }
  return std::abs(twice) / 2;
}

PolygonDrawing::Outcome PolygonDrawing::add(Point2 corner, double closing_radius_px) {
  if (corners_.size() >= 3 && distance_px(corner, corners_.front()) <= closing_radius_px) {
    return close();
  }
  if (!corners_.empty() && distance_px(corner, corners_.back()) <= kSameCorner_px) {
    return Outcome::kNothing;
  }
  corners_.push_back(corner);
  return Outcome::kAdded;
}

PolygonDrawing::Outcome PolygonDrawing::close() {
  if (corners_.empty()) return Outcome::kNothing;
  if (corners_.size() < 3 || area_px2(corners_) < kLeastArea_px2) return Outcome::kTooSmall;
  closed_.swap(corners_);
  corners_.clear();
  return Outcome::kClosed;
}

PolygonDrawing::Outcome PolygonDrawing::take_back() {
  if (corners_.empty()) return Outcome::kNothing;
  corners_.pop_back();
  return corners_.empty() ? Outcome::kCancelled : Outcome::kTakenBack;
}

PolygonDrawing::Outcome PolygonDrawing::cancel() {
  if (corners_.empty()) return Outcome::kNothing;
  corners_.clear();
  return Outcome::kCancelled;
}

}  // namespace atom_rviz
