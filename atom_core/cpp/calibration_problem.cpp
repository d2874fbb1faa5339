#include "atom_core/calibration_problem.h"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace atom_core {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHuberWidth = 1.345, kCauchyWidth = 2.385;  // solvers/losses.py
constexpr double kSmallAngle = 1e-4;

Matrix3d Skew(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

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

/// Sums rho / 2 of squared norms in units of sigma, and gives rho' of each.
class RobustSum {
 public:
  explicit RobustSum(Loss loss) : loss_(loss) {}

  /// Adds a squared norm; returns its weight rho'.
  double Add(double square) {
    if (loss_ == Loss::kCauchy) {
      // The sum of logarithms is the logarithm of a product, which is much cheaper.
      const double factor = 1.0 + square / (kCauchyWidth * kCauchyWidth);
      product_ *= factor;
      if (product_ > kLargeProduct) TakeLogarithm();
      return 1.0 / factor;
    }
    if (loss_ == Loss::kHuber && square > kHuberWidth * kHuberWidth) {
      const double norm = std::sqrt(square);
      half_rho_ += kHuberWidth * norm - 0.5 * kHuberWidth * kHuberWidth;
      return kHuberWidth / norm;
    }
    half_rho_ += 0.5 * square;
    return 1.0;
  }

  double Total() {
    TakeLogarithm();
    return half_rho_;
  }

 private:
  static constexpr double kLargeProduct = 1e100;

  void TakeLogarithm() {
    half_rho_ += 0.5 * kCauchyWidth * kCauchyWidth * std::log(product_);
    product_ = 1.0;
  }

  const Loss loss_;
  double half_rho_ = 0.0, product_ = 1.0;
};

void AddRow(const Vector6d& row, double value, double weight, Reduction* sum) {
  sum->gradient += (weight * value) * row;
  sum->information.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
}

void ReduceReprojection(const ResidualBlock& block, const CalibrationProblem::Segment& segment,
                        const Eigen::VectorXd& sigma, Loss loss, const Isometry3d& pose,
                        bool with_derivatives, Reduction* sum) {
  Eigen::Matrix<double, 2, 3> by_point;
  RobustSum robust(loss);
  for (auto i = segment.begin; i < segment.end; ++i) {
    const Vector3d point = pose * block.points.row(i).transpose();
    const Vector2d error = block.camera.Project(point, with_derivatives ? &by_point : nullptr) -
                           block.pixels.row(i).transpose();
    const double inverse = 1.0 / (sigma[i] * sigma[i]);
    const double weight = robust.Add(error.squaredNorm() * inverse);
    if (!with_derivatives) continue;
    for (int axis = 0; axis < 2; ++axis) {
      const Vector3d gradient = by_point.row(axis).transpose();
      Vector6d row;
      row << point.cross(gradient), gradient;
      AddRow(row, error[axis], weight * inverse, sum);
    }
  }
  sum->cost += robust.Total();
}

/// Adds rows that are linear in the board's plane, given their moments (4, 4) and the plane.
void AddPlane(const Eigen::Matrix4d& moments, const Eigen::Vector4d& plane, Reduction* sum) {
  Eigen::Matrix<double, 4, 6> by_twist = Eigen::Matrix<double, 4, 6>::Zero();
  by_twist.topLeftCorner<3, 3>() = -Skew(plane.head<3>());
  by_twist.bottomRightCorner<1, 3>() = -plane.head<3>().transpose();
  const Eigen::Matrix<double, 4, 6> reached = moments * by_twist;
  sum->gradient += reached.transpose() * plane;
  sum->information.triangularView<Eigen::Lower>() += by_twist.transpose() * reached;
}

void ReduceOrthogonal(const ResidualBlock& block, const CalibrationProblem::Segment& segment,
                      const Eigen::VectorXd& sigma, Loss loss, const PlaneRows& compressed,
                      const Isometry3d& pose, bool with_derivatives, Reduction* sum) {
  Eigen::Vector4d plane;
  plane << pose.linear().col(2), -pose.linear().col(2).dot(pose.translation());
  Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
  if (loss == Loss::kNone) {
    const Eigen::Matrix4d rows = compressed.middleRows<4>(4 * segment.index);
    sum->cost += 0.5 * (rows * plane).squaredNorm();
    if (with_derivatives) moments = rows.transpose() * rows;
  } else {
    RobustSum robust(loss);
    for (auto i = segment.begin; i < segment.end; ++i) {
      Eigen::Vector4d point;
      point << block.points.row(i).transpose(), 1.0;
      const double height = plane.dot(point), inverse = 1.0 / (sigma[i] * sigma[i]);
      const double weight = robust.Add(height * height * inverse);
      if (with_derivatives) moments.noalias() += (weight * inverse * point) * point.transpose();
    }
    sum->cost += robust.Total();
  }
  if (with_derivatives) AddPlane(moments, plane, sum);
}

/// Signed distance to a rectangle's border, negative inside, and its gradient.
double BorderDistance(const Vector2d& point, const Vector2d& centre, const Vector2d& half_size,
                      Vector2d* gradient) {
  const Vector2d offset = point - centre, beyond = offset.cwiseAbs() - half_size;
  const Vector2d outward(offset.x() < 0 ? -1 : 1, offset.y() < 0 ? -1 : 1);
  const Vector2d positive = beyond.cwiseMax(0.0);
  const double outside = positive.norm();
  if (outside > 0) {
    *gradient = outward.cwiseProduct(positive) / outside;
    return outside;
  }
  const int nearest = beyond.y() > beyond.x() ? 1 : 0;
  gradient->setZero();
  (*gradient)[nearest] = outward[nearest];
  return beyond[nearest];
}

void ReduceBorder(const ResidualBlock& block, const CalibrationProblem::Segment& segment,
                  const Eigen::VectorXd& sigma, Loss loss, const Isometry3d& pose,
                  bool with_derivatives, Reduction* sum) {
  const Eigen::Matrix<double, 3, 2> axes = pose.linear().leftCols<2>();
  RobustSum robust(loss);
  for (auto i = segment.begin; i < segment.end; ++i) {
    const Vector3d point = block.points.row(i).transpose();
    const Vector2d in_plane = axes.transpose() * (point - pose.translation());
    Vector2d gradient;
    const double distance = BorderDistance(in_plane, block.centre.row(i).transpose(),
                                           block.half_size.row(i).transpose(), &gradient);
    const double inverse = 1.0 / (sigma[i] * sigma[i]);
    const double weight = robust.Add(distance * distance * inverse);
    if (!with_derivatives) continue;
    const Vector3d outward = axes * gradient;
    Vector6d row;
    row << -point.cross(outward), -outward;
    AddRow(row, distance, weight * inverse, sum);
  }
  sum->cost += robust.Total();
}

}  // namespace

Isometry3d ParameterBlock::Pose(const double* numbers) const {
  Isometry3d pose = initial;
  pose.linear() = initial.linear() * Exponential(Eigen::Map<const Vector3d>(numbers));
  pose.translation() += Eigen::Map<const Vector3d>(numbers + 3);
  return pose;
}

Matrix6d ParameterBlock::Twist(const double* numbers, const Isometry3d& pose) const {
  const Matrix3d turn = pose.linear() * RightJacobian(Eigen::Map<const Vector3d>(numbers));
  Matrix6d twist = Matrix6d::Zero();
  twist.topLeftCorner<3, 3>() = turn;
  twist.bottomLeftCorner<3, 3>() = Skew(pose.translation()) * turn;
  twist.bottomRightCorner<3, 3>().setIdentity();
  return twist;
}

CalibrationProblem::CalibrationProblem(std::vector<ParameterBlock> parameters,
                                       std::vector<PoseChain> chains,
                                       std::vector<ResidualBlock> residuals)
    : parameters_(std::move(parameters)),
      chains_(std::move(chains)),
      residuals_(std::move(residuals)),
      segments_(chains_.size()),
      segment_starts_(residuals_.size()) {
  for (const PoseChain& chain : chains_) {
    if (chain.constants.size() != chain.block.size() + 1 ||
        chain.inverted.size() != chain.block.size()) {
      throw std::invalid_argument("a chain needs one constant more than blocks");
    }
    for (const auto block : chain.block) {
      if (block < 0 || block >= static_cast<std::int64_t>(parameters_.size())) {
        throw std::invalid_argument("a chain names a parameter block that does not exist");
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
      segments_[detection[begin]].push_back({b, segment_starts_[b].size(), begin, end});
      segment_starts_[b].push_back(begin);
      begin = end;
    }
  }
}

void CalibrationProblem::SetHalfSize(std::size_t residual_block,
                                     const Eigen::Ref<const PixelRows>& half_size) {
  if (residual_block >= residuals_.size() ||
      residuals_[residual_block].kind != ResidualKind::kBorder ||
      residuals_[residual_block].half_size.rows() != half_size.rows()) {
    throw std::invalid_argument("half sizes are set for all points of a border block");
  }
  residuals_[residual_block].half_size = half_size;
}

Weighting CalibrationProblem::MakeWeighting(Loss loss, std::vector<Eigen::VectorXd> sigma) const {
  if (sigma.size() != residuals_.size()) {
    throw std::invalid_argument("one array of sigmas is needed for each residual block");
  }
  Weighting weighting{loss, std::move(sigma), std::vector<PlaneRows>(residuals_.size())};
  for (std::size_t b = 0; b < residuals_.size(); ++b) {
    if (weighting.sigma[b].size() != residuals_[b].points.rows()) {
      throw std::invalid_argument("one sigma is needed for each item of a residual block");
    }
    if (loss == Loss::kNone && residuals_[b].kind == ResidualKind::kOrthogonal) {
      weighting.compressed[b] = CompressPlanarSegments(
          residuals_[b].points, weighting.sigma[b].cwiseInverse(), segment_starts_[b]);
    }
  }
  return weighting;
}

void CalibrationProblem::Reduce(const Segment& segment, const Weighting& weighting,
                                const Isometry3d& pose, bool with_derivatives,
                                Reduction* sum) const {
  const ResidualBlock& block = residuals_[segment.residual_block];
  const Eigen::VectorXd& sigma = weighting.sigma[segment.residual_block];
  switch (block.kind) {
    case ResidualKind::kReprojection:
      ReduceReprojection(block, segment, sigma, weighting.loss, pose, with_derivatives, sum);
      break;
    case ResidualKind::kOrthogonal:
      ReduceOrthogonal(block, segment, sigma, weighting.loss,
                       weighting.compressed[segment.residual_block], pose, with_derivatives, sum);
      break;
    case ResidualKind::kBorder:
      ReduceBorder(block, segment, sigma, weighting.loss, pose, with_derivatives, sum);
      break;
  }
}

Isometry3d CalibrationProblem::Pose(std::size_t detection, const double* const* numbers,
                                    std::vector<Matrix6d>* maps) const {
  const PoseChain& chain = chains_[detection];
  Isometry3d product = chain.constants[0];
  for (std::size_t k = 0; k < chain.block.size(); ++k) {
    const ParameterBlock& block = parameters_[chain.block[k]];
    const Isometry3d pose = block.Pose(numbers[k]);
    const Isometry3d before = product;
    product = product * (chain.inverted[k] ? pose.inverse() : pose);
    if (maps != nullptr) {
      // An inverted block's change acts after it: its prefix includes the block itself.
      const Matrix6d twist = block.Twist(numbers[k], pose);
      (*maps)[k].noalias() = chain.inverted[k] ? Matrix6d(-Adjoint(product) * twist)
                                               : Matrix6d(Adjoint(before) * twist);
    }
    product = product * chain.constants[k + 1];
  }
  return product;
}

}  // namespace atom_core
