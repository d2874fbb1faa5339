/// \file
/// Camera models: projection of points to distorted pixels with analytic derivatives.
///
/// The fast twin of atom_core/geometry/camera.py, which explains the models and what happens to
/// points behind a camera and outside its field of view.

#ifndef ATOM_CORE_CAMERA_H_
#define ATOM_CORE_CAMERA_H_

#include <Eigen/Core>
#include <array>

namespace atom_core {

enum class DistortionModel { kNone, kPlumbBob, kRationalPolynomial, kEquidistant };

struct Camera {
  DistortionModel model = DistortionModel::kNone;
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  /// k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4 for equidistant; zero where the model has none.
  std::array<double, 8> coefficients{};
  /// Square of the normalised radius from which on the distortion stops growing.
  double limit_square = 0.0;
  /// Depth, metres, below which and behind the camera 1/z goes on along its tangent.
  double near_m = 0.0;

  /// Projects a point.
  ///
  /// \param point (3,) in the optical frame, metres.
  /// \param by_point derivative of the pixel (2, 3), px/m; may be null.
  /// \return the pixel (2,).
  Eigen::Vector2d Project(const Eigen::Vector3d& point,
                          Eigen::Matrix<double, 2, 3>* by_point) const;
};

/// Twelve numbers of a camera's intrinsics; atom_core/geometry/intrinsics.py says which.
using Intrinsics = Eigen::Matrix<double, 12, 1>;

/// A camera whose intrinsics are estimated.
struct MovableCamera {
  Camera start;
  double width_px = 0.0, height_px = 0.0;
  /// By how much a value changes with its number; of fx and fy, their value at the start.
  Intrinsics scale = Intrinsics::Zero();
  /// Largest logarithm by which a focal length changes.
  double most_log = 0.0;

  /// The camera at the numbers (12,).
  Camera At(const Intrinsics& numbers) const;

  /// Projects a point.
  ///
  /// \param camera this one at some numbers.
  /// \param point (3,) in the optical frame, metres.
  /// \param by_point derivative of the pixel (2, 3), px/m.
  /// \param by_number derivative of the pixel (2, 12) by the numbers, px.
  /// \return the pixel (2,).
  Eigen::Vector2d Project(const Camera& camera, const Eigen::Vector3d& point,
                          Eigen::Matrix<double, 2, 3>* by_point,
                          Eigen::Matrix<double, 2, 12>* by_number) const;
};

}  // namespace atom_core

#endif  // ATOM_CORE_CAMERA_H_
