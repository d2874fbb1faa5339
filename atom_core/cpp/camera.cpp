#include "atom_core/camera.h"

#include <cmath>

namespace atom_core {
namespace {

using Matrix2d = Eigen::Matrix2d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Vector2d = Eigen::Vector2d;
using Vector3d = Eigen::Vector3d;

constexpr double kNear = 0.05;  // metres; nearer and behind, 1/z goes on along its tangent

/// Radial factor and its derivative by the squared radius.
void RadialFactor(const Camera& camera, double square, double* factor, double* slope) {
  const auto& k = camera.coefficients;
  const double above = 1 + square * (k[0] + square * (k[1] + square * k[4]));
  const double above_slope = k[0] + square * (2 * k[1] + 3 * square * k[4]);
  if (camera.model != DistortionModel::kRationalPolynomial) {
    *factor = above;
    *slope = above_slope;
    return;
  }
  const double below = 1 + square * (k[5] + square * (k[6] + square * k[7]));
  const double below_slope = k[5] + square * (2 * k[6] + 3 * square * k[7]);
  *factor = above / below;
  *slope = (above_slope * below - above * below_slope) / (below * below);
}

Vector2d DistortInside(const Camera& camera, const Vector2d& ideal, Matrix2d* jacobian) {
  const double x = ideal.x(), y = ideal.y(), p1 = camera.coefficients[2];
  const double p2 = camera.coefficients[3], square = x * x + y * y;
  double factor, slope;
  RadialFactor(camera, square, &factor, &slope);
  const double mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
  *jacobian << factor + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, mixed, mixed,
      factor + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  return {x * factor + 2 * p1 * x * y + p2 * (square + 2 * x * x),
          y * factor + p1 * (square + 2 * y * y) + 2 * p2 * x * y};
}

/// Outside the field of view a point is distorted as its neighbour on the limit.
Vector2d Distort(const Camera& camera, const Vector2d& ideal, Matrix2d* jacobian) {
  const double square = ideal.squaredNorm();
  if (square <= camera.limit_square) return DistortInside(camera, ideal, jacobian);
  const double shrink = std::sqrt(camera.limit_square / square);
  const Vector2d value = DistortInside(camera, shrink * ideal, jacobian) / shrink;
  const Vector2d radial = value - *jacobian * ideal;
  *jacobian += radial * (ideal / square).transpose();
  return value;
}

Vector2d ProjectPinhole(const Camera& camera, const Vector3d& point, Matrix23d* by_point) {
  const bool front = point.z() >= kNear;
  const double inverse_z = front ? 1.0 / point.z() : (2 * kNear - point.z()) / (kNear * kNear);
  const double slope = front ? -inverse_z * inverse_z : -1.0 / (kNear * kNear);
  const Vector2d ideal = point.head<2>() * inverse_z;
  if (by_point != nullptr) {
    *by_point << inverse_z, 0.0, point.x() * slope, 0.0, inverse_z, point.y() * slope;
  }
  if (camera.model == DistortionModel::kNone) return ideal;
  Matrix2d by_ideal;
  const Vector2d distorted = Distort(camera, ideal, &by_ideal);
  if (by_point != nullptr) *by_point = (by_ideal * *by_point).eval();
  return distorted;
}

Vector2d ProjectEquidistant(const Camera& camera, const Vector3d& point, Matrix23d* by_point) {
  const auto& k = camera.coefficients;
  const double radius = std::hypot(point.x(), point.y()), z = point.z();
  if (radius < 1e-9 * std::abs(z)) {  // on the optical axis the image is x / z
    if (by_point != nullptr) {
      *by_point << 1 / z, 0, -point.x() / (z * z), 0, 1 / z, -point.y() / (z * z);
    }
    return point.head<2>() / z;
  }
  const double angle = std::atan2(radius, z), square = angle * angle;
  const double value =
      angle * (1 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))));
  const double slope =
      1 + square * (3 * k[0] + square * (5 * k[1] + square * (7 * k[2] + 9 * k[3] * square)));
  const double scale = value / radius;
  if (by_point != nullptr) {
    const double distance_square = radius * radius + z * z;
    const double by_radius = (slope * z / distance_square - scale) / radius;
    const Vector2d outward = point.head<2>() / radius;
    by_point->leftCols<2>() = point.head<2>() * by_radius * outward.transpose();
    by_point->col(2) = -point.head<2>() * slope / distance_square;
    by_point->leftCols<2>().diagonal().array() += scale;
  }
  return point.head<2>() * scale;
}

}  // namespace

Vector2d Camera::Project(const Vector3d& point, Matrix23d* by_point) const {
  const Vector2d normalised = model == DistortionModel::kEquidistant
                                  ? ProjectEquidistant(*this, point, by_point)
                                  : ProjectPinhole(*this, point, by_point);
  if (by_point != nullptr) *by_point = (focal_px.asDiagonal() * *by_point).eval();
  return normalised.cwiseProduct(focal_px) + centre_px;
}

}  // namespace atom_core
