/// \file
/// What a calibration problem looks like at one vector: the reduced detections, and how the border
/// rows depend on their inset. The fast twin of atom_core/solvers/assessment.py.

#ifndef ATOM_CORE_ASSESSMENT_H_
#define ATOM_CORE_ASSESSMENT_H_

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "atom_core/calibration_problem.h"

namespace atom_core {

/// A residual block, reduced detection by detection.
struct BlockAssessment {
  /// (m,) the detections that have rows in the block, in the order of the rows.
  std::vector<std::int64_t> detection;
  /// (m,) of each of them, the information as a full matrix.
  std::vector<Reduction> reduction;
  /// (m,) the same with the camera's numbers, where its intrinsics are estimated; else empty.
  std::vector<CameraReduction> with_intrinsics;
  /// (m,) border blocks only, else empty.
  std::vector<InsetReduction> inset;
  /// (n, 2) lengths of the steps across the sides of x and of y, and (n,) the residuals'
  /// derivatives by the inset in steps, metres; border blocks only, else empty.
  PixelRows across;
  Eigen::VectorXd by_steps;
};

struct Assessment {
  /// By residual block.
  std::vector<BlockAssessment> blocks;
  /// By detection, for each parameter block of its chain: twist by the numbers.
  std::vector<std::vector<Matrix6d>> twist_jacobians;
};

/// \param x (6 b,) numbers of the parameter blocks.
/// \param with_insets false leaves the border blocks' inset and across empty.
/// \throws std::invalid_argument when x has the wrong length.
Assessment Assess(const CalibrationProblem& problem, const Weighting& weighting,
                  const Eigen::VectorXd& x, bool with_insets);

/// For each residual block, the squared norms (n,) of the residuals in units of sigma.
/// \throws std::invalid_argument when x has the wrong length.
std::vector<Eigen::VectorXd> SquaredNorms(const CalibrationProblem& problem,
                                          const Weighting& weighting, const Eigen::VectorXd& x);

/// Writes the residuals of a block (n dimension) and their derivatives by the left twist of each
/// detection's pose (n dimension, 6).
/// \throws std::invalid_argument when x has the wrong length.
void WriteRowsAt(const CalibrationProblem& problem, std::size_t residual_block,
                 const Eigen::VectorXd& x, Eigen::Ref<Eigen::VectorXd> residual,
                 Eigen::Ref<TwistRows> by_twist);

}  // namespace atom_core

#endif  // ATOM_CORE_ASSESSMENT_H_
