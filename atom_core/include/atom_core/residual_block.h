/// \file
/// Rows of one sensor and one kind, and what a part of them amounts to at a pose.
///
/// The fast twin of atom_core/problem/residuals.py, which is the specification. The rows of a
/// detection depend on one pose, sensor_T_pattern. They are reduced to a cost, a gradient (6,) and
/// a Gauss-Newton matrix (6, 6) by the left twist (rotation, move) of that pose in the sensor's
/// frame.

#ifndef ATOM_CORE_RESIDUAL_BLOCK_H_
#define ATOM_CORE_RESIDUAL_BLOCK_H_

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "atom_core/camera.h"
#include "atom_core/planar_compression.h"

namespace atom_core {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using TwistRows = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
using PixelRows = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

enum class LossKind { kNone, kHuber, kCauchy };

/// A robust loss of a norm in units of sigma, with the figures of solvers/losses.py.
struct Loss {
  LossKind kind = LossKind::kNone;
  /// Beyond which norm a residual counts less; not used without a loss.
  double width = 0.0;
  /// By which factor a step of the weighted normal equations falls short.
  double step_length = 1.0;
};

enum class ResidualKind { kReprojection, kOrthogonal, kBorder };

/// Rows of one sensor and one kind.
struct ResidualBlock {
  ResidualKind kind = ResidualKind::kOrthogonal;
  /// (n,) detection of each item, ascending.
  std::vector<std::int64_t> detection;
  /// (n, 3) corners in the pattern's frame, or points in the sensor's frame, metres.
  PointRows points;
  /// (n,) what is added to the heights of points, metres; orthogonal only, empty for nothing.
  Eigen::VectorXd deviation;
  /// (m, 3) of each segment, its mean ray over the cosine at which it meets its own plane;
  /// orthogonal only, empty where heights are not stretched (OrthogonalBlock in residuals.py).
  PointRows facing;
  /// (n, 2) detected pixels; reprojection only.
  PixelRows pixels;
  /// (n, 2) of the board in its plane, metres; border only.
  PixelRows centre, half_size;
  /// (2 n, 3) to the next two samples, in the sensor's frame, metres; border only.
  PointRows steps;
  /// (n, 2) how far inside the sides of x and of y the points are expected, metres; border only.
  PixelRows inset;
  /// Share of the way to a corner's ridge on which the two sides are blended; border only.
  double blend = 0.0;
  /// Reprojection only.
  Camera camera;
  /// Reprojection only, where the camera's intrinsics are estimated.
  MovableCamera movable;
};

/// Items begin..end of a residual block, all of one detection.
struct Segment {
  std::size_t residual_block;
  std::size_t index;  ///< of this segment in its residual block
  std::int64_t detection;
  std::int64_t begin, end;
};

/// What the rows of a detection (or a part of them) amount to at a pose.
template <int kSize>
struct ReductionOf {
  static constexpr int kColumns = kSize;
  /// Half the sum of rho.
  double cost = 0.0;
  Eigen::Matrix<double, kSize, 1> gradient = Eigen::Matrix<double, kSize, 1>::Zero();
  /// Lower triangle.
  Eigen::Matrix<double, kSize, kSize> information = Eigen::Matrix<double, kSize, kSize>::Zero();
};
/// By the twist.
using Reduction = ReductionOf<6>;
/// By the twist, and by the twelve numbers of the camera.
using CameraReduction = ReductionOf<18>;

/// Derivatives of a segment's cost by the inset of its points, in steps of the sampling.
struct InsetReduction {
  double curvature = 0.0;  ///< sum of weight times derivative squared
  double slope = 0.0;      ///< sum of weight times derivative times residual
  Vector6d by_twist = Vector6d::Zero();
};

/// Adds a segment's rows at a pose.
///
/// \param inverse_variance (n,) of the whole block: 1 / sigma squared.
/// \param compressed (4, 4) rows of the segment's points, weighted by 1 / sigma, or null; used for
///     orthogonal rows without a loss.
/// \param with_derivatives when false only the cost is computed.
void ReduceSegment(const ResidualBlock& block, const Segment& segment,
                   const Eigen::VectorXd& inverse_variance, const Loss& loss,
                   const Eigen::Matrix4d* compressed, const Eigen::Isometry3d& sensor_T_pattern,
                   bool with_derivatives, Reduction* sum);

/// Adds a reprojection segment's rows at a pose and at some intrinsics.
///
/// \param numbers of the camera, see Intrinsics.
void ReduceWithIntrinsics(const ResidualBlock& block, const Segment& segment,
                          const Eigen::VectorXd& inverse_variance, const Loss& loss,
                          const Eigen::Isometry3d& sensor_T_pattern, const Intrinsics& numbers,
                          CameraReduction* sum);

/// Writes the squared norms of a segment's residuals in units of sigma to squares[begin..end].
///
/// \param camera reprojection only.
void SquaredNorms(const ResidualBlock& block, const Segment& segment,
                  const Eigen::VectorXd& inverse_variance,
                  const Eigen::Isometry3d& sensor_T_pattern, const Camera& camera,
                  Eigen::VectorXd* squares);

/// Writes a segment's residuals and their derivatives by the left twist of its pose.
///
/// \param residual (2 n,) of a block of corners, (n,) of another, in its unit.
/// \param by_twist (2 n, 6) or (n, 6).
void WriteRows(const ResidualBlock& block, const Segment& segment,
               const Eigen::Isometry3d& sensor_T_pattern, Eigen::Ref<Eigen::VectorXd> residual,
               Eigen::Ref<TwistRows> by_twist);

/// Adds a border segment's derivatives by the inset.
///
/// \param across the lengths of the steps across the sides of x and of y, metres, go to the rows
///     begin..end of (n, 2).
/// \param by_steps the derivatives of the residuals, metres, go to by_steps[begin..end].
void ReduceInset(const ResidualBlock& block, const Segment& segment,
                 const Eigen::VectorXd& inverse_variance, const Loss& loss,
                 const Eigen::Isometry3d& sensor_T_pattern, PixelRows* across,
                 Eigen::VectorXd* by_steps, InsetReduction* sum);

}  // namespace atom_core

#endif  // ATOM_CORE_RESIDUAL_BLOCK_H_
