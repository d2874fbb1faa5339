#include "atom_core/residual_block.h"

#include <array>
#include <cmath>

#include "skew.h"

namespace atom_core {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Sums rho / 2 of squared norms in units of sigma, and gives rho' of each.
class RobustSum {
 public:
  explicit RobustSum(const Loss& loss)
      : kind_(loss.kind), width_(loss.width), width_square_(loss.width * loss.width) {}

  /// Adds a squared norm; returns its weight rho'.
  double Add(double square) {
    if (kind_ == LossKind::kCauchy) {
      // The sum of logarithms is the logarithm of a product, which is much cheaper.
      const double factor = 1.0 + square / width_square_;
      product_ *= factor;
      if (product_ > kLargeProduct) TakeLogarithm();
      return 1.0 / factor;
    }
    if (kind_ == LossKind::kHuber && square > width_square_) {
      const double norm = std::sqrt(square);
      half_rho_ += width_ * norm - 0.5 * width_ * width_;
      return width_ / norm;
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
    if (kind_ != LossKind::kCauchy) return;
    half_rho_ += 0.5 * width_ * width_ * std::log(product_);
    product_ = 1.0;
  }

  const LossKind kind_;
  const double width_, width_square_;
  double half_rho_ = 0.0, product_ = 1.0;
};

/// The same for four norms at once, where most of the time goes.
class RobustLanes {
 public:
  using Lanes = Eigen::Array4d;

  explicit RobustLanes(const Loss& loss)
      : kind_(loss.kind),
        width_(loss.width),
        width_square_(loss.width * loss.width),
        inverse_width_square_(1.0 / (loss.width * loss.width)) {}

  Lanes Add(const Lanes& square) {
    if (kind_ == LossKind::kCauchy) {
      const Lanes factor = 1.0 + square * inverse_width_square_;
      product_ *= factor;
      if ((product_ > kLargeProduct).any()) TakeLogarithm();
      return factor.inverse();
    }
    if (kind_ == LossKind::kHuber) {
      const Lanes norm = square.max(width_square_).sqrt();
      const Lanes weight = width_ * norm.inverse();
      // Within the width: norm = width, weight = 1, and the square alone counts.
      half_rho_ += width_ * (norm - width_) + 0.5 * square.min(width_square_);
      return weight;
    }
    half_rho_ += 0.5 * square;
    return Lanes::Ones();
  }

  double Total() {
    TakeLogarithm();
    return half_rho_.sum();
  }

 private:
  static constexpr double kLargeProduct = 1e100;

  void TakeLogarithm() {
    if (kind_ != LossKind::kCauchy) return;
    half_rho_ += 0.5 * width_ * width_ * product_.log();
    product_.setOnes();
  }

  const LossKind kind_;
  const double width_, width_square_, inverse_width_square_;
  Lanes half_rho_ = Lanes::Zero(), product_ = Lanes::Ones();
};

void AddRow(const Vector6d& row, double value, double weight, Reduction* sum) {
  sum->gradient += (weight * value) * row;
  sum->information.noalias() += (weight * row) * row.transpose();
}

void ReduceReprojection(const ResidualBlock& block, const Segment& segment,
                        const VectorXd& inverse_variance, const Loss& loss, const Isometry3d& pose,
                        bool with_derivatives, Reduction* sum) {
  Eigen::Matrix<double, 2, 3> by_point;
  RobustSum robust(loss);
  for (auto i = segment.begin; i < segment.end; ++i) {
    const Vector3d point = pose * block.points.row(i).transpose();
    const Vector2d error = block.camera.Project(point, with_derivatives ? &by_point : nullptr) -
                           block.pixels.row(i).transpose();
    const double inverse = inverse_variance[i];
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

/// The board's plane (n, d) in the sensor's frame, and how steeply the rays of a detection meet it.
///
/// n . q + d is the height of a point q over it. A residual is that times the stretch
/// (OrthogonalBlock in problem/residuals.py).
class BoardPlane {
 public:
  BoardPlane(const ResidualBlock& block, const Segment& segment, const Isometry3d& pose)
      : block_(block) {
    const Vector3d normal = pose.linear().col(2);
    plane_ << normal, -normal.dot(pose.translation());
    if (block.facing.rows() == 0) return;
    const Vector3d facing = block.facing.row(static_cast<Eigen::Index>(segment.index));
    const double steep = normal.dot(facing);
    stretch_ = 2.0 / (1.0 + steep * steep);
    by_turn_ = (-steep * stretch_ * stretch_) * normal.cross(facing);
  }

  /// What the residuals of points are linear in; without what is added to their heights.
  Eigen::Vector4d Stretched() const { return stretch_ * plane_; }

  double Residual(std::int64_t i) const { return stretch_ * Height(i); }

  /// By the left twist of the pose.
  Vector6d Row(std::int64_t i) const {
    const Vector3d point = block_.points.row(i).transpose(), normal = stretch_ * plane_.head<3>();
    Vector6d row;
    row << Height(i) * by_turn_ - point.cross(normal), -normal;
    return row;
  }

  /// Adds rows that are linear in the plane, given their moments (4, 4).
  void AddRows(const Eigen::Matrix4d& moments, Reduction* sum) const {
    const Vector3d normal = stretch_ * plane_.head<3>();
    Eigen::Matrix<double, 4, 6> by_twist = Eigen::Matrix<double, 4, 6>::Zero();
    by_twist.topLeftCorner<3, 3>() = -Skew(normal);
    by_twist.bottomRightCorner<1, 3>() = -normal.transpose();
    by_twist.leftCols<3>() += plane_ * by_turn_.transpose();
    const Eigen::Matrix<double, 4, 6> reached = moments * by_twist;
    sum->gradient += reached.transpose() * Stretched();
    sum->information.triangularView<Eigen::Lower>() += by_twist.transpose() * reached;
  }

 private:
  double Height(std::int64_t i) const {
    const double added = block_.deviation.size() > 0 ? block_.deviation[i] : 0.0;
    return plane_.head<3>().dot(block_.points.row(i)) + plane_[3] + added;
  }

  const ResidualBlock& block_;
  Eigen::Vector4d plane_;
  double stretch_ = 1.0;
  Vector3d by_turn_ = Vector3d::Zero();
};

/// Sums the cost of points, and their weighted moments about the plane's four numbers.
///
/// \param moments the lower triangle; may be null.
double SumHeights(const ResidualBlock& block, const Segment& segment,
                  const VectorXd& inverse_variance, const Loss& loss, const Eigen::Vector4d& plane,
                  Eigen::Matrix4d* moments) {
  using Lanes = RobustLanes::Lanes;
  using Strided = Eigen::Map<const Lanes, Eigen::Unaligned, Eigen::InnerStride<3>>;
  constexpr int kLanes = Lanes::SizeAtCompileTime;
  RobustLanes lanes(loss);
  std::array<Lanes, 10> sums;  // columns of the lower triangle
  sums.fill(Lanes::Zero());
  auto i = segment.begin;
  for (; i + kLanes <= segment.end; i += kLanes) {
    const double* numbers = block.points.data() + 3 * i;
    const Lanes x = Strided(numbers), y = Strided(numbers + 1), z = Strided(numbers + 2);
    const Lanes height = plane[0] * x + plane[1] * y + plane[2] * z + plane[3];
    const Lanes inverse = inverse_variance.segment<kLanes>(i).array();
    const Lanes weight = inverse * lanes.Add(height.square() * inverse);
    if (moments == nullptr) continue;
    const Lanes wx = weight * x, wy = weight * y, wz = weight * z;
    sums[0] += wx * x, sums[1] += wx * y, sums[2] += wx * z, sums[3] += wx;
    sums[4] += wy * y, sums[5] += wy * z, sums[6] += wy;
    sums[7] += wz * z, sums[8] += wz, sums[9] += weight;
  }
  if (moments != nullptr) {
    for (int column = 0, k = 0; column < 4; ++column) {
      for (int row = column; row < 4; ++row) (*moments)(row, column) += sums[k++].sum();
    }
  }
  RobustSum robust(loss);
  for (; i < segment.end; ++i) {
    Eigen::Vector4d point;
    point << block.points.row(i).transpose(), 1.0;
    const double height = plane.dot(point);
    const double weight = inverse_variance[i] * robust.Add(height * height * inverse_variance[i]);
    if (moments != nullptr) moments->noalias() += (weight * point) * point.transpose();
  }
  return lanes.Total() + robust.Total();
}

/// Points to whose heights something is added: noise across a line, or the board's bend.
void ReduceDeviating(const Segment& segment, const VectorXd& inverse_variance, const Loss& loss,
                     const BoardPlane& plane, bool with_derivatives, Reduction* sum) {
  RobustSum robust(loss);
  for (auto i = segment.begin; i < segment.end; ++i) {
    const double residual = plane.Residual(i), inverse = inverse_variance[i];
    const double weight = robust.Add(residual * residual * inverse);
    if (with_derivatives) AddRow(plane.Row(i), residual, weight * inverse, sum);
  }
  sum->cost += robust.Total();
}

void ReduceOrthogonal(const ResidualBlock& block, const Segment& segment,
                      const VectorXd& inverse_variance, const Loss& loss,
                      const Eigen::Matrix4d* compressed, const Isometry3d& pose,
                      bool with_derivatives, Reduction* sum) {
  const BoardPlane plane(block, segment, pose);
  if (block.deviation.size() > 0) {
    ReduceDeviating(segment, inverse_variance, loss, plane, with_derivatives, sum);
    return;
  }
  const Eigen::Vector4d stretched = plane.Stretched();
  Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
  if (loss.kind == LossKind::kNone && compressed != nullptr) {
    sum->cost += 0.5 * (*compressed * stretched).squaredNorm();
    if (with_derivatives) moments = compressed->transpose() * *compressed;
  } else {
    sum->cost += SumHeights(block, segment, inverse_variance, loss, stretched,
                            with_derivatives ? &moments : nullptr);
    moments = Eigen::Matrix4d(moments.selfadjointView<Eigen::Lower>());
  }
  if (with_derivatives) plane.AddRows(moments, sum);
}

/// Signed distance to a rectangle's border, negative inside, and its gradient; blended where two
/// sides are about equally far (blended_distance_to_rectangles in geometry/rectangle.py).
double DistanceToRectangle(const Vector2d& point, const Vector2d& centre, const Vector2d& half_size,
                           double blend, Vector2d* gradient) {
  const Vector2d offset = point - centre, beyond = offset.cwiseAbs() - half_size;
  const Vector2d outward(offset.x() < 0 ? -1 : 1, offset.y() < 0 ? -1 : 1);
  const Vector2d positive = beyond.cwiseMax(0.0);
  const double outside = positive.norm();
  if (outside > 0) {
    *gradient = outward.cwiseProduct(positive) / outside;
    return outside;
  }
  const int nearest = beyond.y() > beyond.x() ? 1 : 0;
  const double width = -blend * beyond.sum(), apart = beyond[nearest] - beyond[1 - nearest];
  if (apart >= width) {  // on the border itself, too
    gradient->setZero();
    (*gradient)[nearest] = outward[nearest];
    return beyond[nearest];
  }
  const double share = 1.0 - apart / width, by_width = blend * share * (2.0 - share) / 4.0;
  (*gradient)[nearest] = outward[nearest] * (1.0 - share / 2.0 - by_width);
  (*gradient)[1 - nearest] = outward[1 - nearest] * (share / 2.0 - by_width);
  return beyond[nearest] + width * share * share / 4.0;
}

/// Distance of a limit point to where it is expected: the border, or its inset inside of it.
class Border {
 public:
  Border(const ResidualBlock& block, const Isometry3d& pose)
      : block_(block), axes_(pose.linear().leftCols<2>()), origin_(pose.translation()) {}

  /// \param gradient in the board's plane.
  double Distance(std::int64_t i, Vector2d* gradient) const {
    const Vector2d in_plane = axes_.transpose() * (block_.points.row(i).transpose() - origin_);
    const Vector2d half_size = (block_.half_size.row(i) - block_.inset.row(i)).transpose();
    return DistanceToRectangle(in_plane, block_.centre.row(i).transpose(), half_size, block_.blend,
                               gradient);
  }

  /// The lengths of the steps across the sides of x and of y.
  Vector2d StepsAcross(std::int64_t i) const {
    return (block_.steps.middleRows<2>(2 * i) * axes_).cwiseAbs().colwise().maxCoeff();
  }

  /// By the left twist of the pose.
  Vector6d Row(std::int64_t i, const Vector2d& gradient) const {
    const Vector3d point = block_.points.row(i).transpose(), outward = axes_ * gradient;
    Vector6d row;
    row << -point.cross(outward), -outward;
    return row;
  }

 private:
  const ResidualBlock& block_;
  const Eigen::Matrix<double, 3, 2> axes_;
  const Vector3d origin_;
};

void ReduceBorder(const ResidualBlock& block, const Segment& segment,
                  const VectorXd& inverse_variance, const Loss& loss, const Isometry3d& pose,
                  bool with_derivatives, Reduction* sum) {
  const Border border(block, pose);
  RobustSum robust(loss);
  Vector2d gradient;
  for (auto i = segment.begin; i < segment.end; ++i) {
    const double distance = border.Distance(i, &gradient);
    const double inverse = inverse_variance[i];
    const double weight = robust.Add(distance * distance * inverse);
    if (with_derivatives) AddRow(border.Row(i, gradient), distance, weight * inverse, sum);
  }
  sum->cost += robust.Total();
}

}  // namespace

void ReduceSegment(const ResidualBlock& block, const Segment& segment,
                   const VectorXd& inverse_variance, const Loss& loss,
                   const Eigen::Matrix4d* compressed, const Isometry3d& sensor_T_pattern,
                   bool with_derivatives, Reduction* sum) {
  switch (block.kind) {
    case ResidualKind::kReprojection:
      ReduceReprojection(block, segment, inverse_variance, loss, sensor_T_pattern, with_derivatives,
                         sum);
      break;
    case ResidualKind::kOrthogonal:
      ReduceOrthogonal(block, segment, inverse_variance, loss, compressed, sensor_T_pattern,
                       with_derivatives, sum);
      break;
    case ResidualKind::kBorder:
      ReduceBorder(block, segment, inverse_variance, loss, sensor_T_pattern, with_derivatives, sum);
      break;
  }
}

void ReduceWithIntrinsics(const ResidualBlock& block, const Segment& segment,
                          const VectorXd& inverse_variance, const Loss& loss,
                          const Isometry3d& sensor_T_pattern, const Intrinsics& numbers,
                          CameraReduction* sum) {
  const Camera camera = block.movable.At(numbers);
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::Matrix<double, 2, 12> by_number;
  RobustSum robust(loss);
  for (auto i = segment.begin; i < segment.end; ++i) {
    const Vector3d point = sensor_T_pattern * block.points.row(i).transpose();
    const Vector2d error = block.movable.Project(camera, point, &by_point, &by_number) -
                           block.pixels.row(i).transpose();
    const double inverse = inverse_variance[i];
    const double weight = inverse * robust.Add(error.squaredNorm() * inverse);
    Eigen::Matrix<double, 2, CameraReduction::kColumns> rows;
    rows.leftCols<3>() = by_point * -Skew(point);
    rows.middleCols<3>(3) = by_point;
    rows.rightCols<12>() = by_number;
    sum->gradient.noalias() += rows.transpose() * (weight * error);
    sum->information.noalias() += rows.transpose() * (weight * rows);
  }
  sum->cost += robust.Total();
}

void SquaredNorms(const ResidualBlock& block, const Segment& segment,
                  const VectorXd& inverse_variance, const Isometry3d& sensor_T_pattern,
                  const Camera& camera, VectorXd* squares) {
  const BoardPlane plane(block, segment, sensor_T_pattern);
  const Border border(block, sensor_T_pattern);
  Vector2d gradient;
  for (auto i = segment.begin; i < segment.end; ++i) {
    double square = 0.0;
    if (block.kind == ResidualKind::kReprojection) {
      const Vector3d point = sensor_T_pattern * block.points.row(i).transpose();
      square = (camera.Project(point, nullptr) - block.pixels.row(i).transpose()).squaredNorm();
    } else if (block.kind == ResidualKind::kOrthogonal) {
      const double residual = plane.Residual(i);
      square = residual * residual;
    } else {
      const double distance = border.Distance(i, &gradient);
      square = distance * distance;
    }
    (*squares)[i] = square * inverse_variance[i];
  }
}

void WriteRows(const ResidualBlock& block, const Segment& segment, const Isometry3d& pose,
               Eigen::Ref<VectorXd> residual, Eigen::Ref<TwistRows> by_twist) {
  const BoardPlane plane(block, segment, pose);
  const Border border(block, pose);
  Vector2d gradient;
  Eigen::Matrix<double, 2, 3> by_point;
  for (auto i = segment.begin; i < segment.end; ++i) {
    if (block.kind == ResidualKind::kReprojection) {
      const Vector3d seen = pose * block.points.row(i).transpose();
      residual.segment<2>(2 * i) =
          block.camera.Project(seen, &by_point) - block.pixels.row(i).transpose();
      by_twist.middleRows<2>(2 * i) << by_point * -Skew(seen), by_point;
    } else if (block.kind == ResidualKind::kOrthogonal) {
      residual[i] = plane.Residual(i);
      by_twist.row(i) = plane.Row(i).transpose();
    } else {
      residual[i] = border.Distance(i, &gradient);
      by_twist.row(i) = border.Row(i, gradient).transpose();
    }
  }
}

void ReduceInset(const ResidualBlock& block, const Segment& segment,
                 const VectorXd& inverse_variance, const Loss& loss,
                 const Isometry3d& sensor_T_pattern, PixelRows* across, VectorXd* by_steps,
                 InsetReduction* sum) {
  const Border border(block, sensor_T_pattern);
  RobustSum robust(loss);
  Vector2d gradient;
  for (auto i = segment.begin; i < segment.end; ++i) {
    const double residual = border.Distance(i, &gradient);
    const Vector2d steps = border.StepsAcross(i);
    const double step = gradient.cwiseAbs().dot(steps);
    const double inverse = inverse_variance[i];
    const double weight = inverse * robust.Add(residual * residual * inverse);
    sum->curvature += weight * step * step;
    sum->slope += weight * step * residual;
    sum->by_twist += (weight * step) * border.Row(i, gradient);
    across->row(i) = steps.transpose();
    (*by_steps)[i] = step;
  }
}

}  // namespace atom_core
