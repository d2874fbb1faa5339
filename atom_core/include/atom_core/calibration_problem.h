/// \file
/// The calibration problem as arrays: chains of poses, and the residual blocks of the detections.
///
/// The fast twin of atom_core/problem, which is the specification.

#ifndef ATOM_CORE_CALIBRATION_PROBLEM_H_
#define ATOM_CORE_CALIBRATION_PROBLEM_H_

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "atom_core/residual_block.h"

namespace atom_core {

/// sensor_T_pattern = C0 X1 C1 X2 ... of one detection, and the blocks of its camera.
struct PoseChain {
  std::vector<Eigen::Isometry3d> constants;
  std::vector<std::int64_t> block;
  std::vector<bool> inverted;
  /// Blocks of the camera's intrinsics, where they are estimated. They move nothing.
  std::vector<std::int64_t> intrinsics;

  /// The blocks that the rows depend on: of the chain, then of the intrinsics.
  std::vector<std::int64_t> Dependencies() const;
};

/// What the six numbers of a block mean: a pose, parameters of a joint, or a camera's intrinsics.
enum class BlockKind { kPose, kOrigin, kBias, kCamera };

/// One pose to estimate, relative to its initial value: (R0 exp(r), t0 + t); or a part of a joint
/// or of a camera (atom_core/problem/joint_blocks.py, camera_blocks.py), of which only some numbers
/// are estimated.
struct ParameterBlock {
  BlockKind kind = BlockKind::kPose;
  Eigen::Isometry3d initial = Eigen::Isometry3d::Identity();
  /// Eliminated first: no two such blocks meet in a detection.
  bool eliminated = false;
  /// Of a joint: roll, pitch, yaw, x, y, z of its origin, or the bias in its place; rad, m.
  Vector6d values = Vector6d::Zero();
  /// Of a joint or a camera: 1 for the numbers that are estimated, else 0.
  Vector6d free = Vector6d::Ones();
  /// Of a joint's bias: unit vector of the motion, in the joint's frame.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  /// Of a joint's bias: a shift along the axis instead of a turn about it.
  bool is_prismatic = false;
  /// Of a camera: which of its twelve numbers is the first, 0 or 6.
  int first = 0;
  /// The numbers that are expected, and one over their variance about them; 0: any.
  Vector6d prior_mean = Vector6d::Zero(), prior_weight = Vector6d::Zero();

  /// \param numbers r (3,) rad and t (3,) m; or what the kind says.
  Eigen::Isometry3d Pose(const double* numbers) const;
  /// The left twist in the parent's frame by the six numbers, at a pose of this block.
  Matrix6d Twist(const double* numbers, const Eigen::Isometry3d& pose) const;
};

/// Standard deviations and loss of one round; rows of a plane are compressed when no loss is used.
struct Weighting {
  Loss loss;
  /// For each residual block, (n,): 1 / sigma squared.
  std::vector<Eigen::VectorXd> inverse_variance;
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

  /// Replaces how far inside the sides the points of a border block are expected (n, 2), metres.
  /// \throws std::invalid_argument when it is no border block or has another length.
  void SetInset(std::size_t residual_block, PixelRows inset);

  /// Moves the points of an orthogonal or border block: (n, 3), in the sensor's frame, metres.
  /// \throws std::invalid_argument when the block has other points.
  void SetPoints(std::size_t residual_block, PointRows points);

  /// The segments of a detection.
  const std::vector<Segment>& segments(std::size_t detection) const { return segments_[detection]; }

  /// The number of segments of a residual block.
  std::size_t SegmentCount(std::size_t residual_block) const {
    return segment_starts_[residual_block].size();
  }

  /// \param sigma for each residual block, (n,) in its unit.
  /// \param compress false where the weights serve a single evaluation only.
  /// \throws std::invalid_argument when the arrays of sigmas do not fit the residual blocks.
  Weighting MakeWeighting(Loss loss, std::vector<Eigen::VectorXd> sigma,
                          bool compress = true) const;

  /// Adds a segment's rows at a pose; without derivatives only the cost is computed.
  void Reduce(const Segment& segment, const Weighting& weighting,
              const Eigen::Isometry3d& sensor_T_pattern, bool with_derivatives,
              Reduction* sum) const;

  /// Whether the intrinsics of a detection's camera are estimated.
  bool HasIntrinsics(std::size_t detection) const { return !chains_[detection].intrinsics.empty(); }

  /// The numbers of a detection's camera.
  ///
  /// \param numbers for each block that the detection depends on, its six numbers.
  Intrinsics IntrinsicsOf(std::size_t detection, const double* const* numbers) const;

  /// Adds a segment's rows at a pose and at some intrinsics; of detections that have them.
  void Reduce(const Segment& segment, const Weighting& weighting,
              const Eigen::Isometry3d& sensor_T_pattern, const Intrinsics& numbers,
              CameraReduction* sum) const;

  /// For each block that a detection depends on, its six numbers in x (6 b,).
  /// \throws std::invalid_argument when x has another length.
  std::vector<const double*> NumbersOf(std::size_t detection, const Eigen::VectorXd& x) const;

  /// The pose of a detection, and J (6, 6) of each block of its chain: twist by the numbers.
  ///
  /// \param numbers for each block of the chain, its six numbers.
  /// \param jacobians may be null.
  Eigen::Isometry3d Pose(std::size_t detection, const double* const* numbers,
                         std::vector<Matrix6d>* jacobians) const;
  /// The same at the numbers (6 b,) of all parameter blocks.
  /// \throws std::invalid_argument when x has another length.
  Eigen::Isometry3d Pose(std::size_t detection, const Eigen::VectorXd& x,
                         std::vector<Matrix6d>* jacobians) const;

 private:
  std::vector<ParameterBlock> parameters_;
  std::vector<PoseChain> chains_;
  std::vector<ResidualBlock> residuals_;
  std::vector<std::vector<Segment>> segments_;
  std::vector<std::vector<std::int64_t>> segment_starts_;  // by residual block
};

}  // namespace atom_core

#endif  // ATOM_CORE_CALIBRATION_PROBLEM_H_
