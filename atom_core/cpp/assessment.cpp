#include "atom_core/assessment.h"

namespace atom_core {

Assessment Assess(const CalibrationProblem& problem, const Weighting& weighting,
                  const Eigen::VectorXd& x, bool with_insets) {
  Assessment result;
  result.blocks.resize(problem.residuals().size());
  for (std::size_t b = 0; b < result.blocks.size(); ++b) {
    BlockAssessment& block = result.blocks[b];
    const ResidualBlock& rows = problem.residuals()[b];
    block.detection.resize(problem.SegmentCount(b));
    block.reduction.resize(problem.SegmentCount(b));
    if (with_insets && rows.kind == ResidualKind::kBorder) {
      block.inset.resize(problem.SegmentCount(b));
      block.across.resize(rows.points.rows(), 2);
      block.by_steps.resize(rows.points.rows());
    }
  }
  result.twist_jacobians.resize(problem.chains().size());
  for (std::size_t d = 0; d < problem.chains().size(); ++d) {
    const Eigen::Isometry3d pose = problem.Pose(d, x, &result.twist_jacobians[d]);
    for (const Segment& segment : problem.segments(d)) {
      BlockAssessment& block = result.blocks[segment.residual_block];
      block.detection[segment.index] = segment.detection;
      if (problem.HasIntrinsics(d)) {
        block.with_intrinsics.resize(block.detection.size());
        const auto numbers = problem.NumbersOf(d, x);
        problem.Reduce(segment, weighting, pose, problem.IntrinsicsOf(d, numbers.data()),
                       &block.with_intrinsics[segment.index]);
        continue;
      }
      Reduction& reduction = block.reduction[segment.index];
      problem.Reduce(segment, weighting, pose, true, &reduction);
      reduction.information = Matrix6d(reduction.information.selfadjointView<Eigen::Lower>());
      if (block.inset.empty()) continue;
      ReduceInset(problem.residuals()[segment.residual_block], segment,
                  weighting.inverse_variance[segment.residual_block], weighting.loss, pose,
                  &block.across, &block.by_steps, &block.inset[segment.index]);
    }
  }
  return result;
}

std::vector<Eigen::VectorXd> SquaredNorms(const CalibrationProblem& problem,
                                          const Weighting& weighting, const Eigen::VectorXd& x) {
  std::vector<Eigen::VectorXd> squares;
  for (const ResidualBlock& block : problem.residuals()) {
    squares.emplace_back(block.points.rows());
  }
  for (std::size_t d = 0; d < problem.chains().size(); ++d) {
    const auto numbers = problem.NumbersOf(d, x);
    const Eigen::Isometry3d pose = problem.Pose(d, numbers.data(), nullptr);
    for (const Segment& segment : problem.segments(d)) {
      const ResidualBlock& rows = problem.residuals()[segment.residual_block];
      const Camera camera = problem.HasIntrinsics(d)
                                ? rows.movable.At(problem.IntrinsicsOf(d, numbers.data()))
                                : rows.camera;
      SquaredNorms(rows, segment, weighting.inverse_variance[segment.residual_block], pose, camera,
                   &squares[segment.residual_block]);
    }
  }
  return squares;
}

void WriteRowsAt(const CalibrationProblem& problem, std::size_t residual_block,
                 const Eigen::VectorXd& x, Eigen::Ref<Eigen::VectorXd> residual,
                 Eigen::Ref<TwistRows> by_twist) {
  for (std::size_t d = 0; d < problem.chains().size(); ++d) {
    for (const Segment& segment : problem.segments(d)) {
      if (segment.residual_block != residual_block) continue;
      WriteRows(problem.residuals()[residual_block], segment, problem.Pose(d, x, nullptr), residual,
                by_twist);
    }
  }
}

}  // namespace atom_core
