/// \file
/// The calibration problem as arrays: chains of poses, residual blocks, and what a detection
/// contributes to the normal equations.
///
/// The fast twin of atom_core/problem, which is the specification. The rows of a detection depend
/// on one pose, sensor_T_pattern. They are reduced to a cost, a gradient (6,) and a Gauss-Newton
/// matrix (6, 6) by the left twist (rotation, move) of that pose in the sensor's frame.

#ifndef ATOM_CORE_CALIBRATION_PROBLEM_H_
#define ATOM_CORE_CALIBRATION_PROBLEM_H_

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "atom_core/camera.h"
#include "atom_core/planar_compression.h"

namespace atom_core {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using PixelRows = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

enum class Loss { kNone, kHuber, kCauchy };
enum class ResidualKind { kReprojection, kOrthogonal, kBorder };

/// Rows of one sensor and one kind; see atom_core/problem/residuals.py.
struct ResidualBlock {
  ResidualKind kind = ResidualKind::kOrthogonal;
  /// (n,) detection of each item, ascending.
  std::vector<std::int64_t> detection;
  /// (n, 3) corners in the pattern's frame, or points in the sensor's frame, metres.
  PointRows points;
  /// (n, 2) detected pixels; reprojection only.
  PixelRows pixels;
  /// (n, 2) of the board in its plane, metres; border only.
  PixelRows centre, half_size;
  /// Reprojection only.
  Camera camera;
};

/// sensor_T_pattern = C0 X1 C1 X2 ... of one detection.
struct PoseChain {
  std::vector<Eigen::Isometry3d> constants;
  std::vector<std::int64_t> block;
  std::vector<bool> inverted;
};

/// One pose to estimate, relative to its initial value: (R0 exp(r), t0 + t).
struct ParameterBlock {
  Eigen::Isometry3d initial = Eigen::Isometry3d::Identity();
  /// Eliminated first: no two such blocks meet in a detection.
  bool eliminated = false;

  /// \param numbers r (3,) rad and t (3,) m.
  Eigen::Isometry3d Pose(const double* numbers) const;
  /// The left twist in the parent's frame by the six numbers, at a pose of this block.
  Matrix6d Twist(const double* numbers, const Eigen::Isometry3d& pose) const;
};

/// What the rows of a detection (or a part of them) amount to at a pose.
struct Reduction {
  /// Half the sum of rho.
  double cost = 0.0;
  Vector6d gradient = Vector6d::Zero();
  Matrix6d information = Matrix6d::Zero();
};

/// Standard deviations and loss of one round; rows of a plane are compressed when no loss is used.
struct Weighting {
  Loss loss = Loss::kNone;
  /// For each residual block, (n,) in its unit.
  std::vector<Eigen::VectorXd> sigma;
  /// For each residual block, (4 m, 4) by segment; empty where it is not used.
  std::vector<PlaneRows> compressed;
};

class CalibrationProblem {
 public:
  /// \throws std::invalid_argument when lengths or indices do not fit together.
  CalibrationProblem(std::vector<ParameterBlock> parameters, std::vector<PoseChain> chains,
                     std::vector<ResidualBlock> residuals);

  const std::vector<ParameterBlock>& parameters() const { return parameters_; }
  const std::vector<PoseChain>& chains() const { return chains_; }
  const std::vector<ResidualBlock>& residuals() const { return residuals_; }

  /// Replaces the half sizes (n, 2) of a border block, metres.
  /// \throws std::invalid_argument when it is no border block or has another length.
  void SetHalfSize(std::size_t residual_block, const Eigen::Ref<const PixelRows>& half_size);

  /// Rows of one residual block that belong to one detection.
  struct Segment {
    std::size_t residual_block;
    std::size_t index;  ///< of this segment in its residual block
    std::int64_t begin, end;
  };
  /// The segments of a detection.
  const std::vector<Segment>& segments(std::size_t detection) const { return segments_[detection]; }

  Weighting MakeWeighting(Loss loss, std::vector<Eigen::VectorXd> sigma) const;

  /// Adds a segment's rows at a pose; without `information` only the cost is computed.
  void Reduce(const Segment& segment, const Weighting& weighting,
              const Eigen::Isometry3d& sensor_T_pattern, bool with_derivatives,
              Reduction* sum) const;

  /// The pose of a detection, and M (6, 6) of each of its blocks: twist by the numbers.
  ///
  /// \param numbers for each block of the chain, its six numbers.
  /// \param maps may be null.
  Eigen::Isometry3d Pose(std::size_t detection, const double* const* numbers,
                         std::vector<Matrix6d>* maps) const;

 private:
  std::vector<ParameterBlock> parameters_;
  std::vector<PoseChain> chains_;
  std::vector<ResidualBlock> residuals_;
  std::vector<std::vector<Segment>> segments_;
  std::vector<std::vector<std::int64_t>> segment_starts_;  // by residual block
};

}  // namespace atom_core

#endif  // ATOM_CORE_CALIBRATION_PROBLEM_H_
