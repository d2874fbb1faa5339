// The calibration problem and its minimiser for Python. The arrays go over once; no call goes
// back to Python but the progress report of an iteration.

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "atom_core/assessment.h"
#include "atom_core/calibration_problem.h"
#include "atom_core/ceres_minimiser.h"
#include "bindings.h"

namespace py = pybind11;

namespace atom_core {
namespace {

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IndexArray = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
using BoolArray = py::array_t<bool, py::array::c_style | py::array::forcecast>;
using RowMatrix4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Sigmas = std::vector<Eigen::VectorXd>;

void Expect(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

Eigen::Isometry3d AsPose(const double* numbers) {
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::Map<const RowMatrix4d>(numbers);
  return pose;
}

std::vector<ParameterBlock> AsParameters(const DoubleArray& initial, const BoolArray& eliminated) {
  Expect(initial.ndim() == 3 && initial.shape(1) == 4 && initial.shape(2) == 4,
         "initial must have the shape (b, 4, 4)");
  Expect(eliminated.ndim() == 1 && eliminated.shape(0) == initial.shape(0),
         "eliminated must have the shape (b,)");
  std::vector<ParameterBlock> blocks(initial.shape(0));
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    blocks[i].initial = AsPose(initial.data() + 16 * i);
    blocks[i].eliminated = eliminated.data()[i];
  }
  return blocks;
}

/// Makes some of the blocks parts of joints.
void SetParts(const py::list& parts, std::vector<ParameterBlock>* blocks) {
  for (const auto& entry : parts) {
    const auto item = entry.cast<py::dict>();
    const auto index = item["block"].cast<std::size_t>();
    Expect(index < blocks->size(), "a part names a parameter block that does not exist");
    ParameterBlock& block = (*blocks)[index];
    const auto kind = item["kind"].cast<std::string>();
    Expect(kind == "origin" || kind == "bias" || kind == "camera" || kind == "pose",
           "a part's kind must be origin, bias, camera or pose");
    block.free = item["free"].cast<Vector6d>();
    block.prior_mean = item["prior_mean"].cast<Vector6d>();
    block.prior_weight = item["prior_weight"].cast<Vector6d>();
    if (kind == "pose") continue;
    if (kind == "camera") {
      block.kind = BlockKind::kCamera;
      block.first = item["first"].cast<int>();
      Expect(block.first == 0 || block.first == 6, "a camera's first number is 0 or 6");
      continue;
    }
    block.kind = kind == "origin" ? BlockKind::kOrigin : BlockKind::kBias;
    block.values = item["values"].cast<Vector6d>();
    if (kind == "bias") {
      block.axis = item["axis"].cast<Eigen::Vector3d>();
      block.is_prismatic = item["is_prismatic"].cast<bool>();
    }
  }
}

/// \param intrinsics (d, c) blocks of the detections' cameras, -1 for none.
void SetIntrinsics(const IndexArray& intrinsics, std::vector<PoseChain>* chains) {
  Expect(intrinsics.ndim() == 2 && intrinsics.shape(0) == static_cast<py::ssize_t>(chains->size()),
         "intrinsics must have the shape (d, c)");
  for (std::size_t d = 0; d < chains->size(); ++d) {
    for (py::ssize_t k = 0; k < intrinsics.shape(1); ++k) {
      const auto index = intrinsics.data()[d * intrinsics.shape(1) + k];
      if (index >= 0) (*chains)[d].intrinsics.push_back(index);
    }
  }
}

std::vector<PoseChain> AsChains(const DoubleArray& constants, const IndexArray& block,
                                const BoolArray& inverted) {
  Expect(constants.ndim() == 4 && constants.shape(2) == 4 && constants.shape(3) == 4,
         "constants must have the shape (d, k + 1, 4, 4)");
  Expect(block.ndim() == 2 && inverted.ndim() == 2 && block.shape(0) == constants.shape(0) &&
             inverted.shape(0) == block.shape(0) && inverted.shape(1) == block.shape(1) &&
             constants.shape(1) == block.shape(1) + 1,
         "block and inverted must have the shape (d, k)");
  const auto width = block.shape(1);
  std::vector<PoseChain> chains(block.shape(0));
  for (std::size_t d = 0; d < chains.size(); ++d) {
    const double* matrices = constants.data() + 16 * (width + 1) * d;
    chains[d].constants.push_back(AsPose(matrices));
    for (py::ssize_t k = 0; k < width; ++k) {
      const auto index = block.data()[d * width + k];
      if (index < 0) break;  // shorter chains are filled up with -1 and identities
      chains[d].block.push_back(index);
      chains[d].inverted.push_back(inverted.data()[d * width + k]);
      chains[d].constants.push_back(AsPose(matrices + 16 * (k + 1)));
    }
  }
  return chains;
}

DistortionModel AsModel(const std::string& name) {
  if (name == "none") return DistortionModel::kNone;
  if (name == "plumb_bob") return DistortionModel::kPlumbBob;
  if (name == "rational_polynomial") return DistortionModel::kRationalPolynomial;
  if (name == "equidistant") return DistortionModel::kEquidistant;
  throw std::invalid_argument("unknown distortion model " + name);
}

Camera AsCamera(const py::dict& item) {
  Camera camera;
  camera.model = AsModel(item["model"].cast<std::string>());
  camera.focal_px = item["focal_px"].cast<Eigen::Vector2d>();
  camera.centre_px = item["centre_px"].cast<Eigen::Vector2d>();
  camera.limit_square = item["limit_square"].cast<double>();
  camera.near_m = item["near_m"].cast<double>();
  const auto values = item["coefficients"].cast<std::vector<double>>();
  Expect(values.size() <= camera.coefficients.size(), "a camera has at most 8 coefficients");
  std::copy(values.begin(), values.end(), camera.coefficients.begin());
  return camera;
}

ResidualBlock AsResidualBlock(const py::dict& item) {
  ResidualBlock block;
  const auto kind = item["kind"].cast<std::string>();
  block.detection = item["detection"].cast<std::vector<std::int64_t>>();
  block.points = item["points"].cast<PointRows>();
  if (kind == "reprojection") {
    block.kind = ResidualKind::kReprojection;
    const auto camera = item["camera"].cast<py::dict>();
    block.camera = AsCamera(camera);
    if (camera.contains("number_scale")) {
      block.movable = {block.camera, camera["width"].cast<double>(),
                       camera["height"].cast<double>(), camera["number_scale"].cast<Intrinsics>(),
                       camera["most_log"].cast<double>()};
    }
    block.pixels = item["pixels"].cast<PixelRows>();
    Expect(block.pixels.rows() == block.points.rows(), "pixels must have the shape (n, 2)");
  } else if (kind == "border") {
    block.kind = ResidualKind::kBorder;
    block.centre = item["centre"].cast<PixelRows>();
    block.half_size = item["half_size"].cast<PixelRows>();
    Expect(
        block.centre.rows() == block.points.rows() && block.half_size.rows() == block.points.rows(),
        "centre and half_size must have the shape (n, 2)");
    block.steps = item["steps"].cast<PointRows>();
    block.inset = item["inset"].cast<PixelRows>();
    block.blend = item["blend"].cast<double>();
    Expect(
        block.steps.rows() == 2 * block.points.rows() && block.inset.rows() == block.points.rows(),
        "steps must have the shape (2 n, 3) and inset (n, 2)");
  } else {
    Expect(kind == "orthogonal", "kind must be reprojection, orthogonal or border");
    block.kind = ResidualKind::kOrthogonal;
    if (item.contains("deviation")) {
      block.deviation = item["deviation"].cast<Eigen::VectorXd>();
      Expect(block.deviation.size() == block.points.rows(), "deviation must have the shape (n,)");
    }
    if (item.contains("facing")) block.facing = item["facing"].cast<PointRows>();
  }
  return block;
}

std::unique_ptr<CalibrationProblem> MakeProblem(
    const DoubleArray& initial, const BoolArray& eliminated, const DoubleArray& constants,
    const IndexArray& block, const BoolArray& inverted, const IndexArray& intrinsics,
    const py::list& residual_blocks, const py::list& parts) {
  std::vector<ResidualBlock> residuals;
  for (const auto& item : residual_blocks)
    residuals.push_back(AsResidualBlock(item.cast<py::dict>()));
  std::vector<ParameterBlock> parameters = AsParameters(initial, eliminated);
  SetParts(parts, &parameters);
  std::vector<PoseChain> chains = AsChains(constants, block, inverted);
  SetIntrinsics(intrinsics, &chains);
  return std::make_unique<CalibrationProblem>(std::move(parameters), std::move(chains),
                                              std::move(residuals));
}

Loss MakeLoss(const std::string& name, double width, double step_length) {
  if (name == "none") return {LossKind::kNone, width, step_length};
  if (name == "huber") return {LossKind::kHuber, width, step_length};
  if (name == "cauchy") return {LossKind::kCauchy, width, step_length};
  throw std::invalid_argument("loss must be none, huber or cauchy");
}

Criteria MakeCriteria(double longest_turn_rad, double longest_move_m, double rounding,
                      double smallest_unit) {
  return {longest_turn_rad, longest_move_m, rounding, smallest_unit};
}

py::dict MinimiseProblem(const CalibrationProblem& problem, const Eigen::VectorXd& x, Sigmas sigmas,
                         const Loss& loss, const Criteria& criteria, int max_iterations,
                         double decrease, double relative, double radius, int threads,
                         const py::object& progress) {
  MinimiserOptions options(criteria);
  options.max_iterations = max_iterations;
  options.decrease = decrease;
  options.relative = relative;
  options.initial_trust_region_radius = radius;
  options.threads = threads;
  std::exception_ptr raised;  // must not go through Ceres
  options.progress = [&progress, &raised](int iteration, double cost, const Eigen::VectorXd& x) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) {  // Ctrl-C: stop with the best state; the caller is told so
      if (!PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) {
        try {
          throw py::error_already_set();
        } catch (...) {
          raised = std::current_exception();
        }
      }
      PyErr_Clear();
      return false;
    }
    if (progress.is_none()) return true;
    try {
      return !progress(iteration, cost, x).is(py::bool_(false));
    } catch (...) {
      raised = std::current_exception();
      return false;
    }
  };
  MinimiserResult result;
  {
    const py::gil_scoped_release release;
    const Weighting weighting = problem.MakeWeighting(loss, std::move(sigmas));
    result = Minimise(problem, weighting, x, options);
  }
  if (raised) std::rethrow_exception(raised);
  py::dict summary;
  summary["x"] = result.x;
  summary["cost"] = result.cost;
  summary["iterations"] = result.iterations;
  summary["converged"] = result.converged;
  summary["stopped"] = result.stopped;
  summary["message"] = result.message;
  return summary;
}

/// Reductions as arrays: information (m, c, c) and gradient (m, c).
template <typename Sum>
void SetReductions(const std::vector<Sum>& sums, py::dict* item) {
  const auto count = static_cast<py::ssize_t>(sums.size());
  const py::ssize_t columns = Sum::kColumns;
  py::array_t<double> information({count, columns, columns});
  py::array_t<double> gradient({count, columns});
  for (py::ssize_t i = 0; i < count; ++i) {
    Eigen::Map<decltype(sums[i].information)>(information.mutable_data(i)) = sums[i].information;
    Eigen::Map<decltype(sums[i].gradient)>(gradient.mutable_data(i)) = sums[i].gradient;
  }
  (*item)["information"] = information;
  (*item)["gradient"] = gradient;
}

/// One block's reductions as arrays.
py::dict BlockDocument(const BlockAssessment& block) {
  const auto count = static_cast<py::ssize_t>(block.detection.size());
  double curvature = 0.0, slope = 0.0;
  py::array_t<double> by_twist({block.inset.empty() ? 0 : count, py::ssize_t{6}});
  for (py::ssize_t i = 0; i < count; ++i) {
    if (block.inset.empty()) continue;
    curvature += block.inset[i].curvature;
    slope += block.inset[i].slope;
    Eigen::Map<Vector6d>(by_twist.mutable_data(i)) = block.inset[i].by_twist;
  }
  py::dict item;
  item["detection"] = py::array_t<std::int64_t>(count, block.detection.data());
  if (block.with_intrinsics.empty()) {
    SetReductions(block.reduction, &item);
  } else {
    SetReductions(block.with_intrinsics, &item);
  }
  item["across"] = block.across;
  item["by_steps"] = block.by_steps;
  item["curvature"] = curvature;
  item["slope"] = slope;
  item["by_twist"] = by_twist;
  return item;
}

py::tuple AssessProblem(const CalibrationProblem& problem, const Eigen::VectorXd& x, Sigmas sigmas,
                        const Loss& loss, bool with_insets) {
  Assessment assessment;
  {
    const py::gil_scoped_release release;
    const Weighting weighting = problem.MakeWeighting(loss, std::move(sigmas), false);
    assessment = Assess(problem, weighting, x, with_insets);
  }
  std::size_t width = 0;
  for (const PoseChain& chain : problem.chains()) width = std::max(width, chain.block.size());
  const auto detections = static_cast<py::ssize_t>(assessment.twist_jacobians.size());
  py::array_t<double> jacobians(
      {detections, static_cast<py::ssize_t>(width), py::ssize_t{6}, py::ssize_t{6}});
  std::fill(jacobians.mutable_data(), jacobians.mutable_data() + jacobians.size(), 0.0);
  using RowMatrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  for (py::ssize_t d = 0; d < detections; ++d) {
    const auto& of_chain = assessment.twist_jacobians[d];
    for (std::size_t k = 0; k < of_chain.size(); ++k) {
      Eigen::Map<RowMatrix6d>(jacobians.mutable_data(d, k)) = of_chain[k];
    }
  }
  py::list blocks;
  for (const BlockAssessment& block : assessment.blocks) blocks.append(BlockDocument(block));
  return py::make_tuple(blocks, jacobians);
}

std::vector<Eigen::VectorXd> SquaresOfProblem(const CalibrationProblem& problem,
                                              const Eigen::VectorXd& x, Sigmas sigmas) {
  const py::gil_scoped_release release;
  return SquaredNorms(problem, problem.MakeWeighting(Loss(), std::move(sigmas), false), x);
}

py::tuple RowsOfProblem(const CalibrationProblem& problem, std::size_t residual_block,
                        const Eigen::VectorXd& x) {
  Expect(residual_block < problem.residuals().size(), "there is no such residual block");
  const ResidualBlock& block = problem.residuals()[residual_block];
  const auto count = static_cast<py::ssize_t>(block.points.rows());
  const py::ssize_t dimension = block.kind == ResidualKind::kReprojection ? 2 : 1;
  py::array_t<double> residual({count, dimension});
  py::array_t<double> by_twist({count, dimension, py::ssize_t{6}});
  Eigen::Map<Eigen::VectorXd> residual_rows(residual.mutable_data(), count * dimension);
  Eigen::Map<TwistRows> twist_rows(by_twist.mutable_data(), count * dimension, 6);
  {
    const py::gil_scoped_release release;
    WriteRowsAt(problem, residual_block, x, residual_rows, twist_rows);
  }
  return py::make_tuple(residual, by_twist);
}

void BindCriteria(py::module& m) {
  py::class_<Loss>(m, "Loss", "A robust loss; its figures are those of atom_core.solvers.losses.")
      .def(py::init(&MakeLoss), py::arg("name"), py::arg("width"), py::arg("step_length"), R"(
Args:
    name: none, huber or cauchy.
    width: norm in sigmas beyond which a residual counts less.
    step_length: factor by which a step of the weighted normal equations falls short.

Raises:
    ValueError: there is no such loss.
)");
  py::class_<Criteria>(m, "Criteria", "What all solvers agree on: atom_core.solvers.criteria.")
      .def(py::init(&MakeCriteria), py::arg("longest_turn_rad"), py::arg("longest_move_m"),
           py::arg("rounding"), py::arg("smallest_unit"));
}

void BindEvaluations(py::class_<CalibrationProblem>* problem) {
  problem
      ->def("assess", &AssessProblem, py::arg("x"), py::arg("sigmas"), py::arg("loss"),
            py::arg("with_insets"), R"(What an Assessment is made from.

Returns:
    For each residual block a dict with detection (m,), information (m, 6, 6), gradient (m, 6), or
    (m, 18, 18), (m, 18) where the camera's intrinsics are estimated;
    for border blocks, with_insets, also across (n, 2), by_steps (n,), curvature, slope,
    by_twist (m, 6).
    And the twist of each detection by the numbers of its chain's blocks, (d, k, 6, 6).
)")
      .def("rows", &RowsOfProblem, py::arg("residual_block"), py::arg("x"), R"(A block's rows.

Returns:
    Residuals (n, dimension), and (n, dimension, 6) their derivatives by the left twist of each
    detection's pose; the cameras' intrinsics are those that the problem was made with.
)")
      .def("squares", &SquaresOfProblem, py::arg("x"), py::arg("sigmas"),
           "For each residual block, squared norms (n,) of the residuals in units of sigma.");
}

void BindProblem(py::module& m) {
  py::class_<CalibrationProblem> problem(m, "CalibrationProblem",
                                         R"(A calibration problem as arrays.

The fast twin of atom_core.problem.problem.Problem, which is the specification.
)");
  problem
      .def(py::init(&MakeProblem), py::arg("initial"), py::arg("eliminated"), py::arg("constants"),
           py::arg("block"), py::arg("inverted"), py::arg("intrinsics"), py::arg("residual_blocks"),
           py::arg("parts") = py::list(), R"(
Args:
    initial: (b, 4, 4) parent_T_child of the parameter blocks.
    eliminated: (b,) True for blocks that never meet one another in a detection.
    constants, block, inverted: of PoseChains.
    intrinsics: (d, c) blocks of the detections' cameras, -1 for none.
    residual_blocks: list of dict with kind, detection (n,), points (n, 3), and
        camera (dict), pixels (n, 2) for reprojection, centre, half_size (n, 2), steps (2 n, 3),
        inset (n, 2), blend for border; for orthogonal perhaps deviation (n,), added to the heights,
        and perhaps facing (m, 3), by which they are stretched.
    parts: list of dict, for blocks that are more than poses: block (index), kind (origin, bias,
        camera or pose), free (6,) 1 or 0, prior_mean, prior_weight (6,); values (6,) of the first
        two, and of a bias axis (3,) and is_prismatic; of a camera first (0 or 6), and its residual
        blocks' dict camera has number_scale (12,), most_log, width and height.

Raises:
    ValueError: shapes or indices do not fit together.
)")
      .def("minimise", &MinimiseProblem, py::arg("x"), py::arg("sigmas"), py::arg("loss"),
           py::arg("criteria"), py::arg("max_iterations"), py::arg("decrease"), py::arg("relative"),
           py::arg("radius") = 1e4, py::arg("threads") = 1, py::arg("progress") = py::none(),
           R"(Minimises with Ceres from x.

Args:
    x: (6 b,) numbers of the parameter blocks.
    sigmas: for each residual block, (n,) in its unit.
    loss: a Loss.
    criteria: Criteria.
    max_iterations: limit.
    decrease, relative: of Tolerance.
    radius: of the first trust region.
    threads: of the evaluation.
    progress: called with iteration, cost and x; False stops with the best state.

Returns:
    dict with x, cost, iterations, converged, stopped, message.
)")
      .def("set_inset", &CalibrationProblem::SetInset, py::arg("residual_block"), py::arg("inset"),
           "Replaces the inset (n, 2) [m] of a border block.")
      .def("set_points", &CalibrationProblem::SetPoints, py::arg("residual_block"),
           py::arg("points"), "Moves the points (n, 3) [m] of an orthogonal or border block.");
  BindEvaluations(&problem);
}

}  // namespace

void BindCalibration(py::module& m) {
  BindCriteria(m);
  BindProblem(m);
}

}  // namespace atom_core
