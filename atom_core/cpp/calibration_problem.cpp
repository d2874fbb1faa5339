#include "atom_core/calibration_problem.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "skew.h"

namespace atom_core {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSmallAngle = 1e-4;

/// sin(a)/a, (1 - cos(a))/a^2, (a - sin(a))/a^3.
std::array<double, 3> AngleCoefficients(double angle) {
  const double square = angle * angle;
  if (angle < kSmallAngle) return {1 - square / 6, 0.5 - square / 24, 1.0 / 6 - square / 120};
  const double half = std::sin(0.5 * angle) / angle;
  return {std::sin(angle) / angle, 2 * half * half, (angle - std::sin(angle)) / (square * angle)};
}

Matrix3d Exponential(const Vector3d& r) {
  const auto c = AngleCoefficients(r.norm());
  const Matrix3d cross = Skew(r);
  return Matrix3d::Identity() + c[0] * cross + c[1] * cross * cross;
}

Matrix3d RightJacobian(const Vector3d& r) {
  const auto c = AngleCoefficients(r.norm());
  const Matrix3d cross = Skew(r);
  return Matrix3d::Identity() - c[1] * cross + c[2] * cross * cross;
}

Matrix6d Adjoint(const Isometry3d& a_T_b) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = a_T_b.linear();
  m.bottomRightCorner<3, 3>() = a_T_b.linear();
  m.bottomLeftCorner<3, 3>() = Skew(a_T_b.translation()) * a_T_b.linear();
  return m;
}

/// Rz(yaw) Ry(pitch) Rx(roll), and the axes about which the three angles turn.
Matrix3d FromRpy(const Vector3d& rpy, Matrix3d* axes) {
  const Matrix3d about_z = Eigen::AngleAxisd(rpy[2], Vector3d::UnitZ()).toRotationMatrix();
  const Matrix3d about_yz = about_z * Eigen::AngleAxisd(rpy[1], Vector3d::UnitY());
  if (axes != nullptr) *axes << about_yz.col(0), about_z.col(1), Vector3d::UnitZ();
  return about_yz * Eigen::AngleAxisd(rpy[0], Vector3d::UnitX()).toRotationMatrix();
}

Isometry3d OriginPose(const ParameterBlock& block, const double* numbers) {
  const Vector6d values =
      block.values + block.free.cwiseProduct(Eigen::Map<const Vector6d>(numbers));
  Isometry3d pose = Isometry3d::Identity();
  pose.linear() = FromRpy(values.head<3>(), nullptr);
  pose.translation() = values.tail<3>();
  return pose;
}

Matrix6d OriginTwist(const ParameterBlock& block, const double* numbers) {
  const Vector6d values =
      block.values + block.free.cwiseProduct(Eigen::Map<const Vector6d>(numbers));
  Matrix3d axes;
  FromRpy(values.head<3>(), &axes);
  Matrix6d twist = Matrix6d::Zero();
  twist.topLeftCorner<3, 3>() = axes;
  twist.bottomLeftCorner<3, 3>() = Skew(values.tail<3>()) * axes;
  twist.bottomRightCorner<3, 3>().setIdentity();
  return twist * block.free.asDiagonal();
}

Isometry3d BiasPose(const ParameterBlock& block, const double* numbers) {
  const int place = block.is_prismatic ? 3 : 0;
  const Vector3d move = (block.values[place] + numbers[place]) * block.axis;
  Isometry3d pose = Isometry3d::Identity();
  if (block.is_prismatic) {
    pose.translation() = move;
  } else {
    pose.linear() = Exponential(move);
  }
  return pose;
}

/// The axis is the same in both frames.
Matrix6d BiasTwist(const ParameterBlock& block) {
  Matrix6d twist = Matrix6d::Zero();
  const int place = block.is_prismatic ? 3 : 0;
  twist.block<3, 1>(place, place) = block.axis;
  return twist;
}

}  // namespace

Isometry3d ParameterBlock::Pose(const double* numbers) const {
  if (kind == BlockKind::kOrigin) return OriginPose(*this, numbers);
  if (kind == BlockKind::kBias) return BiasPose(*this, numbers);
  Isometry3d pose = initial;
  pose.linear() = initial.linear() * Exponential(Eigen::Map<const Vector3d>(numbers));
  pose.translation() += Eigen::Map<const Vector3d>(numbers + 3);
  return pose;
}

Matrix6d ParameterBlock::Twist(const double* numbers, const Isometry3d& pose) const {
  if (kind == BlockKind::kOrigin) return OriginTwist(*this, numbers);
  if (kind == BlockKind::kBias) return BiasTwist(*this);
  const Matrix3d turn = pose.linear() * RightJacobian(Eigen::Map<const Vector3d>(numbers));
  Matrix6d twist = Matrix6d::Zero();
  twist.topLeftCorner<3, 3>() = turn;
  twist.bottomLeftCorner<3, 3>() = Skew(pose.translation()) * turn;
  twist.bottomRightCorner<3, 3>().setIdentity();
  return twist;
}

std::vector<std::int64_t> PoseChain::Dependencies() const {
  std::vector<std::int64_t> all = block;
  all.insert(all.end(), intrinsics.begin(), intrinsics.end());
  return all;
}

CalibrationProblem::CalibrationProblem(std::vector<ParameterBlock> parameters,
                                       std::vector<PoseChain> chains,
                                       std::vector<ResidualBlock> residuals)
    : parameters_(std::move(parameters)),
      chains_(std::move(chains)),
      residuals_(std::move(residuals)),
      segments_(chains_.size()),
      segment_starts_(residuals_.size()) {
  for (std::size_t d = 0; d < chains_.size(); ++d) {
    const PoseChain& chain = chains_[d];
    if (chain.constants.size() != chain.block.size() + 1 ||
        chain.inverted.size() != chain.block.size()) {
      throw std::invalid_argument("a chain needs one constant more than blocks");
    }
    const auto blocks = chain.Dependencies();
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      if (blocks[k] < 0 || blocks[k] >= static_cast<std::int64_t>(parameters_.size())) {
        throw std::invalid_argument("a chain names a parameter block that does not exist");
      }
      const bool is_camera = parameters_[blocks[k]].kind == BlockKind::kCamera;
      if (is_camera != (k >= chain.block.size())) {
        throw std::invalid_argument("intrinsics stand beside the chain, and nothing else does");
      }
    }
  }
  for (std::size_t b = 0; b < residuals_.size(); ++b) {
    const auto& detection = residuals_[b].detection;
    const auto count = static_cast<std::int64_t>(detection.size());
    if (residuals_[b].points.rows() != count) {
      throw std::invalid_argument("a residual block needs one point for each detection index");
    }
    for (std::int64_t begin = 0; begin < count;) {
      std::int64_t end = begin;
      while (end < count && detection[end] == detection[begin]) ++end;
      if (detection[begin] < 0 || detection[begin] >= static_cast<std::int64_t>(chains_.size())) {
        throw std::invalid_argument("a residual block names a detection that does not exist");
      }
      if (HasIntrinsics(detection[begin]) && residuals_[b].kind != ResidualKind::kReprojection) {
        throw std::invalid_argument("intrinsics belong to a detection that is no camera's");
      }
      segments_[detection[begin]].push_back(
          {b, segment_starts_[b].size(), detection[begin], begin, end});
      segment_starts_[b].push_back(begin);
      begin = end;
    }
    const auto facing = static_cast<std::size_t>(residuals_[b].facing.rows());
    if (facing != 0 && facing != segment_starts_[b].size()) {
      throw std::invalid_argument("facing needs one row for each detection of its block");
    }
  }
}

void CalibrationProblem::SetInset(std::size_t residual_block, PixelRows inset) {
  if (residual_block >= residuals_.size() ||
      residuals_[residual_block].kind != ResidualKind::kBorder ||
      residuals_[residual_block].inset.rows() != inset.rows()) {
    throw std::invalid_argument("insets are set for all points of a border block");
  }
  residuals_[residual_block].inset = std::move(inset);
}

void CalibrationProblem::SetPoints(std::size_t residual_block, PointRows points) {
  if (residual_block >= residuals_.size() ||
      residuals_[residual_block].kind == ResidualKind::kReprojection ||
      residuals_[residual_block].points.rows() != points.rows()) {
    throw std::invalid_argument("points are set for all items of an orthogonal or border block");
  }
  residuals_[residual_block].points = std::move(points);
}

Weighting CalibrationProblem::MakeWeighting(Loss loss, std::vector<Eigen::VectorXd> sigma,
                                            bool compress) const {
  if (sigma.size() != residuals_.size()) {
    throw std::invalid_argument("one array of sigmas is needed for each residual block");
  }
  Weighting weighting{loss, {}, std::vector<PlaneRows>(residuals_.size())};
  for (std::size_t b = 0; b < residuals_.size(); ++b) {
    if (sigma[b].size() != residuals_[b].points.rows()) {
      throw std::invalid_argument("one sigma is needed for each item of a residual block");
    }
    if (compress && loss.kind == LossKind::kNone &&
        residuals_[b].kind == ResidualKind::kOrthogonal && residuals_[b].deviation.size() == 0) {
      weighting.compressed[b] =
          CompressPlanarSegments(residuals_[b].points, sigma[b].cwiseInverse(), segment_starts_[b]);
    }
    sigma[b] = sigma[b].array().square().inverse();
  }
  weighting.inverse_variance = std::move(sigma);
  return weighting;
}

void CalibrationProblem::Reduce(const Segment& segment, const Weighting& weighting,
                                const Isometry3d& pose, bool with_derivatives,
                                Reduction* sum) const {
  const PlaneRows& rows = weighting.compressed[segment.residual_block];
  Eigen::Matrix4d compressed;
  if (rows.size() > 0) compressed = rows.middleRows<4>(4 * segment.index);
  ReduceSegment(residuals_[segment.residual_block], segment,
                weighting.inverse_variance[segment.residual_block], weighting.loss,
                rows.size() > 0 ? &compressed : nullptr, pose, with_derivatives, sum);
}

void CalibrationProblem::Reduce(const Segment& segment, const Weighting& weighting,
                                const Isometry3d& pose, const Intrinsics& numbers,
                                CameraReduction* sum) const {
  ReduceWithIntrinsics(residuals_[segment.residual_block], segment,
                       weighting.inverse_variance[segment.residual_block], weighting.loss, pose,
                       numbers, sum);
}

Intrinsics CalibrationProblem::IntrinsicsOf(std::size_t detection,
                                            const double* const* numbers) const {
  Intrinsics result = Intrinsics::Zero();
  const PoseChain& chain = chains_[detection];
  for (std::size_t k = 0; k < chain.intrinsics.size(); ++k) {
    const ParameterBlock& block = parameters_[chain.intrinsics[k]];
    const Eigen::Map<const Vector6d> own(numbers[chain.block.size() + k]);
    result.segment<6>(block.first) = block.free.cwiseProduct(own);
  }
  return result;
}

std::vector<const double*> CalibrationProblem::NumbersOf(std::size_t detection,
                                                         const Eigen::VectorXd& x) const {
  if (x.size() != static_cast<Eigen::Index>(6 * parameters_.size())) {
    throw std::invalid_argument("x needs six numbers for each parameter block");
  }
  std::vector<const double*> numbers;
  for (const auto index : chains_[detection].Dependencies()) {
    numbers.push_back(x.data() + 6 * index);
  }
  return numbers;
}

Isometry3d CalibrationProblem::Pose(std::size_t detection, const double* const* numbers,
                                    std::vector<Matrix6d>* jacobians) const {
  const PoseChain& chain = chains_[detection];
  Isometry3d product = chain.constants[0];
  for (std::size_t k = 0; k < chain.block.size(); ++k) {
    const ParameterBlock& block = parameters_[chain.block[k]];
    const Isometry3d pose = block.Pose(numbers[k]);
    const Isometry3d before = product;
    product = product * (chain.inverted[k] ? pose.inverse() : pose);
    if (jacobians != nullptr) {
      // An inverted block's change acts after it: its prefix includes the block itself.
      const Matrix6d twist = block.Twist(numbers[k], pose);
      (*jacobians)[k].noalias() = chain.inverted[k] ? Matrix6d(-Adjoint(product) * twist)
                                                    : Matrix6d(Adjoint(before) * twist);
    }
    product = product * chain.constants[k + 1];
  }
  return product;
}

Isometry3d CalibrationProblem::Pose(std::size_t detection, const Eigen::VectorXd& x,
                                    std::vector<Matrix6d>* jacobians) const {
  const std::vector<const double*> numbers = NumbersOf(detection, x);
  if (jacobians != nullptr) jacobians->resize(chains_[detection].block.size());
  return Pose(detection, numbers.data(), jacobians);
}

}  // namespace atom_core
