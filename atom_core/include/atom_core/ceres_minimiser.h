/// \file
/// Minimises a calibration problem with Ceres.
///
/// A detection is one Ceres residual block of seven rows, however many corners and points it has:
/// the square root of its 6 x 6 Gauss-Newton matrix carries gradient and curvature, the seventh
/// row the rest of the cost. Where the intrinsics of a camera are estimated, the twelve numbers of
/// these join the six of the pose, and its detections are nineteen rows. Cost, gradient and
/// Gauss-Newton step are those of all rows; robust losses act on each corner and point, inside.

#ifndef ATOM_CORE_CERES_MINIMISER_H_
#define ATOM_CORE_CERES_MINIMISER_H_

#include <Eigen/Core>
#include <functional>
#include <string>

#include "atom_core/calibration_problem.h"

namespace atom_core {

/// What all solvers agree on, with the figures of solvers/criteria.py.
struct Criteria {
  /// How far a step of a block may go, rad and metres; the linearisation holds no farther.
  double longest_turn, longest_move;
  /// Relative to the cost; near it the cost cannot tell steps apart any more.
  double rounding;
  /// The least that counts as one squared sigma, for data without any noise.
  double smallest_unit;

  /// Whether the linearisation holds for a step of a block.
  bool Allow(const Vector6d& step) const {
    return step.head<3>().norm() <= longest_turn && step.tail<3>().norm() <= longest_move;
  }
};

struct MinimiserOptions {
  explicit MinimiserOptions(const Criteria& agreed) : criteria(agreed) {}

  Criteria criteria;
  int max_iterations = 200;
  int threads = 1;
  /// Enough when the model promises less than this decrease, in squared sigmas.
  double decrease = 1e-10;
  /// Or when two steps in a row lowered the cost by less than this part of it.
  double relative = 0.0;
  double initial_trust_region_radius = 1e4;
  /// Called after every iteration with its number, the cost and the numbers so far; returning
  /// false stops with the best state.
  std::function<bool(int, double, const Eigen::VectorXd&)> progress;
};

struct MinimiserResult {
  Eigen::VectorXd x;
  double cost = 0.0;
  int iterations = 0;
  bool converged = false;
  bool stopped = false;
  double trust_region_radius = 0.0;
  std::string message;
};

/// \param x (6 b,) numbers of the parameter blocks to start from.
/// \throws std::invalid_argument when x has the wrong length.
MinimiserResult Minimise(const CalibrationProblem& problem, const Weighting& weighting,
                         const Eigen::VectorXd& x, const MinimiserOptions& options);

}  // namespace atom_core

#endif  // ATOM_CORE_CERES_MINIMISER_H_
