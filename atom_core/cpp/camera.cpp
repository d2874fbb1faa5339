#include "atom_core/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace atom_core {
namespace {

using Matrix2d = Eigen::Matrix2d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Vector2d = Eigen::Vector2d;
using Vector3d = Eigen::Vector3d;

/// 1 / z; nearer than near_m and behind the camera, along its tangent there.
double InverseDepth(double z, double near_m) {
  return z >= near_m ? 1.0 / z : (2 * near_m - z) / (near_m * near_m);
}

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
  const double near_m = camera.near_m, inverse_z = InverseDepth(point.z(), near_m);
  const double slope = point.z() >= near_m ? -inverse_z * inverse_z : -1.0 / (near_m * near_m);
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

using ByCoefficient = Eigen::Matrix<double, 2, 8>;

/// Of the normalised image by the coefficients (2, 8), for a point inside the field of view.
ByCoefficient PolynomialByCoefficient(const Camera& camera, const Vector2d& ideal) {
  const double x = ideal.x(), y = ideal.y(), square = ideal.squaredNorm();
  double below = 1.0, factor = 1.0, slope;
  if (camera.model == DistortionModel::kRationalPolynomial) {
    const auto& k = camera.coefficients;
    below = 1 + square * (k[5] + square * (k[6] + square * k[7]));
    RadialFactor(camera, square, &factor, &slope);
  }
  ByCoefficient result;
  const Vector2d radial = ideal * (square / below);
  result.col(0) = radial;
  result.col(1) = radial * square;
  result.col(2) << 2 * x * y, square + 2 * y * y;
  result.col(3) << square + 2 * x * x, 2 * x * y;
  result.col(4) = radial * (square * square);
  result.col(5) = -factor * result.col(0);
  result.col(6) = -factor * result.col(1);
  result.col(7) = -factor * result.col(4);
  return result;
}

ByCoefficient ByCoefficients(const Camera& camera, const Vector3d& point) {
  if (camera.model == DistortionModel::kNone) return ByCoefficient::Zero();
  if (camera.model == DistortionModel::kEquidistant) {
    ByCoefficient result = ByCoefficient::Zero();
    const double radius = std::hypot(point.x(), point.y());
    if (radius < 1e-9 * std::abs(point.z())) return result;
    const double angle = std::atan2(radius, point.z());
    double power = angle;
    for (int i = 0; i < 4; ++i) {
      power *= angle * angle;
      result.col(i) = point.head<2>() * (power / radius);
    }
    return result;
  }
  const Vector2d ideal = point.head<2>() * InverseDepth(point.z(), camera.near_m);
  const double square = ideal.squaredNorm();
  if (square <= camera.limit_square) return PolynomialByCoefficient(camera, ideal);
  const double shrink = std::sqrt(camera.limit_square / square);
  return PolynomialByCoefficient(camera, shrink * ideal) / shrink;
}

/// r^2 (normalised) of the farthest image corner and a little more.
double RadiusLimitSquare(const Camera& camera, double width_px, double height_px) {
  if (camera.model == DistortionModel::kNone || camera.model == DistortionModel::kEquidistant) {
    return std::numeric_limits<double>::infinity();
  }
  double largest = 0.0;
  for (const double x : {0.0, width_px}) {
    for (const double y : {0.0, height_px}) {
      const Vector2d ideal = (Vector2d(x, y) - camera.centre_px).cwiseQuotient(camera.focal_px);
      largest = std::max(largest, ideal.squaredNorm());
    }
  }
  constexpr int kSteps = 281;
  const double corner = std::sqrt(largest), step = 2.8 / (kSteps - 1);
  int end = kSteps - 1;
  for (int i = 0; i < kSteps; ++i) {
    const double radius = corner * (0.2 + i * step), square = radius * radius;
    double factor, slope;
    RadialFactor(camera, square, &factor, &slope);
    if (!(factor + 2 * square * slope > 0.05)) {
      end = i - 1;
      break;
    }
    if (radius * factor >= 1.1 * corner) {
      end = i;
      break;
    }
  }
  const double radius = corner * (0.2 + std::max(end, 0) * step);
  return radius * radius;
}

}  // namespace

Camera MovableCamera::At(const Intrinsics& numbers) const {
  Camera camera = start;
  for (int i = 0; i < 2; ++i) {
    camera.focal_px[i] *= std::exp(std::clamp(numbers[i], -most_log, most_log));
  }
  camera.centre_px += start.focal_px.cwiseProduct(numbers.segment<2>(2));
  for (int i = 0; i < 8; ++i) camera.coefficients[i] += scale[4 + i] * numbers[4 + i];
  camera.limit_square = RadiusLimitSquare(camera, width_px, height_px);
  return camera;
}

Vector2d MovableCamera::Project(const Camera& camera, const Vector3d& point, Matrix23d* by_point,
                                Eigen::Matrix<double, 2, 12>* by_number) const {
  const Vector2d pixel = camera.Project(point, by_point);
  const Vector2d from_centre = pixel - camera.centre_px;
  by_number->leftCols<2>() = from_centre.asDiagonal();
  by_number->middleCols<2>(2) = start.focal_px.asDiagonal();
  by_number->rightCols<8>() =
      camera.focal_px.asDiagonal() * ByCoefficients(camera, point) * scale.tail<8>().asDiagonal();
  return pixel;
}

Vector2d Camera::Project(const Vector3d& point, Matrix23d* by_point) const {
  const Vector2d normalised = model == DistortionModel::kEquidistant
                                  ? ProjectEquidistant(*this, point, by_point)
                                  : ProjectPinhole(*this, point, by_point);
  if (by_point != nullptr) *by_point = (focal_px.asDiagonal() * *by_point).eval();
  return normalised.cwiseProduct(focal_px) + centre_px;
}

}  // namespace atom_core
