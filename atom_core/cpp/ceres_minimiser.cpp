#include "atom_core/ceres_minimiser.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <vector>

namespace atom_core {
namespace {

/// What is expected of the six numbers of a parameter block, as six rows.
class PriorCost : public ceres::SizedCostFunction<6, 6> {
 public:
  explicit PriorCost(const ParameterBlock& block)
      : mean_(block.prior_mean), root_(block.prior_weight.cwiseSqrt()) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Vector6d> numbers(parameters[0]);
    Eigen::Map<Vector6d> rows(residuals);
    rows = root_.cwiseProduct(numbers - mean_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> jacobian(jacobians[0]);
      jacobian = root_.asDiagonal();
    }
    return true;
  }

 private:
  const Vector6d mean_, root_;
};

/// One detection as seven rows, or as 19 where its camera's intrinsics are estimated.
///
/// \tparam Sum Reduction or CameraReduction.
template <typename Sum>
class DetectionCost : public ceres::CostFunction {
 public:
  /// \param accepted for each block that the detection depends on, its numbers at the last
  ///     accepted step.
  DetectionCost(const CalibrationProblem& problem, const Weighting& weighting,
                const Criteria& criteria, std::size_t detection,
                std::vector<const double*> accepted)
      : problem_(problem),
        weighting_(weighting),
        criteria_(criteria),
        detection_(detection),
        accepted_(std::move(accepted)) {
    set_num_residuals(kRows);
    mutable_parameter_block_sizes()->assign(accepted_.size(), 6);
  }

  bool Evaluate(double const* const* numbers, double* residuals,
                double** jacobians) const override {
    if (!WithinReach(numbers)) return false;
    if (!IsKept(numbers)) Reduce(numbers);
    if (!std::isfinite(sum_.cost)) return false;
    if (jacobians == nullptr) {
      std::fill(residuals, residuals + kRows, 0.0);
      residuals[kRows - 1] = std::sqrt(2.0 * sum_.cost);
      return true;
    }
    Square root;
    Column rotated;
    SquareRoot(sum_, &root, &rotated);
    const double lengthening = Lengthening(2.0 * sum_.cost, rotated.squaredNorm());
    root /= lengthening;
    rotated *= lengthening;
    Eigen::Map<Column>(residuals, kColumns) = rotated;
    residuals[kRows - 1] = std::sqrt(std::max(0.0, 2.0 * sum_.cost - rotated.squaredNorm()));
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      if (jacobians[k] == nullptr) continue;
      Eigen::Map<RowMatrix> jacobian(jacobians[k]);
      if (k < Chain().block.size()) {
        jacobian.template topRows<kColumns>().noalias() =
            root.template leftCols<6>() * twist_jacobians_[k];
      } else {
        const ParameterBlock& camera =
            problem_.parameters()[Chain().intrinsics[k - Chain().block.size()]];
        jacobian.template topRows<kColumns>() =
            root.template middleCols<6>(6 + camera.first) * camera.free.asDiagonal();
      }
      jacobian.template bottomRows<1>().setZero();
    }
    return true;
  }

 private:
  static constexpr int kColumns = Sum::kColumns, kRows = kColumns + 1;
  using RowMatrix = Eigen::Matrix<double, kRows, 6, Eigen::RowMajor>;
  using Square = Eigen::Matrix<double, kColumns, kColumns>;
  using Column = Eigen::Matrix<double, kColumns, 1>;

  const PoseChain& Chain() const { return problem_.chains()[detection_]; }

  /// Ceres asks for the cost of a step first, and for the derivatives once it is accepted: both
  /// are found together and kept.
  void Reduce(double const* const* numbers) const {
    kept_.clear();
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      kept_.insert(kept_.end(), numbers[k], numbers[k] + 6);
    }
    twist_jacobians_.resize(Chain().block.size());
    const Eigen::Isometry3d pose = problem_.Pose(detection_, numbers, &twist_jacobians_);
    sum_ = Sum();
    if constexpr (kColumns == Reduction::kColumns) {
      for (const auto& segment : problem_.segments(detection_)) {
        problem_.Reduce(segment, weighting_, pose, true, &sum_);
      }
    } else {
      const Intrinsics intrinsics = problem_.IntrinsicsOf(detection_, numbers);
      for (const auto& segment : problem_.segments(detection_)) {
        problem_.Reduce(segment, weighting_, pose, intrinsics, &sum_);
      }
    }
  }

  bool IsKept(double const* const* numbers) const {
    if (kept_.empty()) return false;
    for (std::size_t k = 0; k < accepted_.size(); ++k) {
      if (!std::equal(numbers[k], numbers[k] + 6, kept_.begin() + 6 * k)) return false;
    }
    return true;
  }

  /// The weights of a robust loss make the cost look more curved than it is, so that every step
  /// would fall short.
  /// \param twice_cost limits it: the seven rows must still amount to the cost.
  double Lengthening(double twice_cost, double rotated_square) const {
    const double most = weighting_.loss.step_length;
    if (most <= 1.0 || rotated_square <= 0.0) return 1.0;
    return std::sqrt(std::clamp(twice_cost / rotated_square, 1.0, most));
  }

  /// The linearisation holds no farther than this; Ceres then tries a shorter step.
  bool WithinReach(double const* const* numbers) const {
    for (std::size_t k = 0; k < Chain().block.size(); ++k) {
      const Eigen::Map<const Vector6d> now(numbers[k]), before(accepted_[k]);
      if (!criteria_.Allow(now - before)) return false;
    }
    return true;
  }

  /// J (6, 6) and r (6,) with J^T J = information and J^T r = gradient.
  static void SquareRoot(const Reduction& sum, Matrix6d* root, Vector6d* rotated) {
    const Eigen::LDLT<Matrix6d, Eigen::Lower> factor(sum.information);
    const Vector6d diagonal = factor.vectorD();
    const double smallest = 1e-14 * std::max(diagonal.cwiseAbs().maxCoeff(), 1e-300);
    Vector6d scale = Vector6d::Zero();
    for (int i = 0; i < 6; ++i) {
      if (diagonal[i] > smallest) scale[i] = std::sqrt(diagonal[i]);
    }
    // Eigen applies transpositions from the right in the wrong order: make the matrix first.
    const Matrix6d permutation = factor.transpositionsP() * Matrix6d::Identity();
    const Matrix6d upper = factor.matrixU();
    *root = scale.asDiagonal() * (upper * permutation);
    Vector6d solved = factor.transpositionsP() * sum.gradient;
    factor.matrixL().solveInPlace(solved);
    for (int i = 0; i < 6; ++i) (*rotated)[i] = scale[i] > 0 ? solved[i] / scale[i] : 0.0;
  }

  /// The same with a camera's numbers. One board does not tell all of them: where a factorisation
  /// goes on with pivots that are rounding, it amplifies it, so this one ends before.
  static void SquareRoot(const CameraReduction& sum, Square* root, Column* rotated) {
    const Column size = sum.information.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Column inverse = size.cwiseInverse();
    Square left = inverse.asDiagonal() * sum.information * inverse.asDiagonal();
    Column gradient = inverse.cwiseProduct(sum.gradient);
    root->setZero();
    rotated->setZero();
    for (int k = 0; k < kColumns; ++k) {
      int pivot;
      if (!(left.diagonal().maxCoeff(&pivot) > 1e-13)) break;
      const double length = std::sqrt(left(pivot, pivot));
      const Column row = left.col(pivot) / length;
      (*rotated)[k] = gradient[pivot] / length;
      root->row(k) = row.cwiseProduct(size).transpose();
      gradient -= (*rotated)[k] * row;
      left.noalias() -= row * row.transpose();
      left.row(pivot).setZero();
      left.col(pivot).setZero();
    }
  }

  const CalibrationProblem& problem_;
  const Weighting& weighting_;
  const Criteria& criteria_;
  const std::size_t detection_;
  const std::vector<const double*> accepted_;
  // Of the last evaluation; Ceres evaluates a residual block in one thread at a time.
  mutable std::vector<double> kept_;
  mutable std::vector<Matrix6d> twist_jacobians_;
  mutable Sum sum_;
};

/// Cuts the step of one block to the length up to which the linearisation holds.
///
/// A board that wants to turn far does not hold up all others so, as it would if the whole step
/// were refused. Only for blocks that nothing but their own detections depend on.
#if CERES_VERSION_MAJOR > 2 || (CERES_VERSION_MAJOR == 2 && CERES_VERSION_MINOR >= 1)
class CutStep : public ceres::Manifold {
 public:
  explicit CutStep(const Criteria& criteria) : criteria_(criteria) {}
  int AmbientSize() const override { return 6; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* step, double* result) const override {
    return CutPlus(x, step, result);
  }
  bool PlusJacobian(const double* /*x*/, double* jacobian) const override {
    return Identity(jacobian);
  }
  bool Minus(const double* y, const double* x, double* step) const override {
    std::transform(y, y + 6, x, step, std::minus<double>());
    return true;
  }
  bool MinusJacobian(const double* /*x*/, double* jacobian) const override {
    return Identity(jacobian);
  }
#else
class CutStep : public ceres::LocalParameterization {
 public:
  explicit CutStep(const Criteria& criteria) : criteria_(criteria) {}
  int GlobalSize() const override { return 6; }
  int LocalSize() const override { return 6; }
  bool Plus(const double* x, const double* step, double* result) const override {
    return CutPlus(x, step, result);
  }
  bool ComputeJacobian(const double* /*x*/, double* jacobian) const override {
    return Identity(jacobian);
  }
#endif

 private:
  bool CutPlus(const double* x, const double* step, double* result) const {
    const Eigen::Map<const Vector6d> from(x), wanted(step);
    const double length = std::max(wanted.head<3>().norm() / criteria_.longest_turn,
                                   wanted.tail<3>().norm() / criteria_.longest_move);
    // just inside, so that rounding does not put it out of reach
    Eigen::Map<Vector6d> to(result);
    to = from + (length < 1.0 ? 1.0 : (1.0 - 1e-9) / length) * wanted;
    return true;
  }

  static bool Identity(double* jacobian) {
    Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(jacobian).setIdentity();
    return true;
  }

  const Criteria criteria_;
};

/// Decides when it is enough; what Ceres' own tolerances mean depends on the units.
class Judge : public ceres::IterationCallback {
 public:
  Judge(const MinimiserOptions& options, double rows, const Eigen::VectorXd& x)
      : options_(options), rows_(rows), x_(x) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    radius = summary.trust_region_radius;
    if (summary.iteration == 0 || summary.step_is_successful) cost_ = summary.cost;
    if (options_.progress && !options_.progress(summary.iteration, cost_, x_)) {
      stopped = true;  // an abort would leave the parameters where they began
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    // A step out of reach counts as one of infinite cost: it promises nothing either way.
    const bool out_of_reach = summary.cost_change < -0.5 * std::numeric_limits<double>::max();
    if (summary.iteration == 0 || !summary.step_is_valid || out_of_reach) {
      return ceres::SOLVER_CONTINUE;
    }
    const double promised = std::abs(summary.cost_change / summary.relative_decrease);
    if (summary.step_is_successful) {
      const double before = summary.cost + summary.cost_change;
      slow_ = summary.cost_change < options_.relative * before ? slow_ + 1 : 0;
    }
    const double unit =
        std::max(options_.criteria.smallest_unit, 2.0 * summary.cost / std::max(rows_, 1.0));
    if (slow_ >= 2 || promised < options_.decrease * unit ||
        (!summary.step_is_successful && promised < options_.criteria.rounding * summary.cost)) {
      enough = true;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    return ceres::SOLVER_CONTINUE;
  }

  bool enough = false, stopped = false;
  double radius = 0.0;

 private:
  const MinimiserOptions& options_;
  const double rows_;
  const Eigen::VectorXd& x_;
  double cost_ = 0.0;  // at x_: of the last step that was taken
  int slow_ = 0;
};

double CountRows(const CalibrationProblem& problem) {
  double rows = 0;
  for (const ResidualBlock& block : problem.residuals()) {
    const double each = block.kind == ResidualKind::kReprojection ? 2 : 1;
    rows += each * static_cast<double>(block.detection.size());
  }
  return rows;
}

ceres::Solver::Options SolverOptions(const CalibrationProblem& problem,
                                     const MinimiserOptions& options, double* x) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_iterations;
  solver.num_threads = options.threads;
  solver.logging_type = ceres::SILENT;
  solver.update_state_every_iteration = true;
  solver.max_num_consecutive_invalid_steps = 50;
  solver.initial_trust_region_radius = options.initial_trust_region_radius;
  solver.function_tolerance = solver.parameter_tolerance = solver.gradient_tolerance = 1e-16;
  auto* ordering = new ceres::ParameterBlockOrdering;
  bool any = false;
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    const bool eliminated = problem.parameters()[i].eliminated;
    any = any || eliminated;
    ordering->AddElementToGroup(x + 6 * i, eliminated ? 0 : 1);
  }
  if (any) {
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.linear_solver_ordering.reset(ordering);
  } else {
    delete ordering;
    solver.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  }
  return solver;
}

/// The six numbers of each parameter block, and what is expected of them.
void AddParameters(const CalibrationProblem& problem, const Criteria& criteria, double* x,
                   ceres::Problem* ceres_problem) {
  for (std::size_t i = 0; i < problem.parameters().size(); ++i) {
    const ParameterBlock& block = problem.parameters()[i];
    CutStep* cut = block.eliminated ? new CutStep(criteria) : nullptr;
    ceres_problem->AddParameterBlock(x + 6 * i, 6, cut);
    if (!block.prior_weight.isZero(0.0)) {
      ceres_problem->AddResidualBlock(new PriorCost(block), nullptr, x + 6 * i);
    }
  }
}

}  // namespace

MinimiserResult Minimise(const CalibrationProblem& problem, const Weighting& weighting,
                         const Eigen::VectorXd& x, const MinimiserOptions& options) {
  if (x.size() != static_cast<Eigen::Index>(6 * problem.parameters().size())) {
    throw std::invalid_argument("x needs six numbers for each parameter block");
  }
  MinimiserResult result;
  result.x = x;
  ceres::Problem ceres_problem;
  AddParameters(problem, options.criteria, result.x.data(), &ceres_problem);
  for (std::size_t d = 0; d < problem.chains().size(); ++d) {
    std::vector<double*> blocks;
    for (const auto index : problem.chains()[d].Dependencies()) {
      blocks.push_back(result.x.data() + 6 * index);
    }
    if (blocks.empty()) continue;  // everything on this chain is held
    const std::vector<const double*> accepted(blocks.begin(), blocks.end());
    const Criteria& criteria = options.criteria;
    ceres::CostFunction* cost;
    if (problem.HasIntrinsics(d)) {
      cost = new DetectionCost<CameraReduction>(problem, weighting, criteria, d, accepted);
    } else {
      cost = new DetectionCost<Reduction>(problem, weighting, criteria, d, accepted);
    }
    ceres_problem.AddResidualBlock(cost, nullptr, blocks);
  }
  ceres::Solver::Options solver = SolverOptions(problem, options, result.x.data());
  Judge judge(options, CountRows(problem), result.x);
  solver.callbacks.push_back(&judge);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &ceres_problem, &summary);
  result.cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.converged =
      !judge.stopped && (judge.enough || summary.termination_type == ceres::CONVERGENCE);
  result.stopped = judge.stopped;
  result.trust_region_radius = judge.radius;
  result.message = summary.message;
  return result;
}

}  // namespace atom_core
