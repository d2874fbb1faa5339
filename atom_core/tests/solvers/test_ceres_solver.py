"""The native solver is the fast twin of the specification: same equations, same answer."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.calibration.start.disturb import disturbed
from atom_core.geometry import camera as camera_models
from atom_core.geometry import intrinsics, rectangle
from atom_core.geometry.camera import Camera
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import read_measurements
from atom_core.problem.residuals import BorderBlock
from atom_core.solvers import ceres_solver, losses
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.ceres_solver import CeresSolver
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt
from atom_core.synthetic import Noise, arm, paper_cell, scenes

pytest.importorskip("atom_core._core", reason="native module is not built: make build")

K = np.array([[900.0, 0, 640.0], [0, 890.0, 400.0], [0, 0, 1]])
MODELS = {
    "none": [],
    "plumb_bob": [-0.2, 0.05, 0.001, -0.002, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02],
    "equidistant": [-0.03, 0.01, -0.004, 0.001],
}
JOINTS = {
    "shoulder_lift": {"origin_x": 0.01, "origin_yaw": 0.01},
    "telescope": {"position_bias": 0.01},
    "elbow": {"position_bias": 0.02},
    "wrist_2": {"origin_roll": 0.01, "origin_z": 0.02},
}
SCENES = {
    "random_scene": lambda: scenes.random_scene(1, collections=6),
    "shared_edge": lambda: scenes.shared_edge(1, collections=6),
    "hand_eye": lambda: scenes.hand_eye(1, collections=6),
    "board_on_arm": lambda: scenes.board_on_arm(1, collections=6),
    "two_patterns": lambda: scenes.two_patterns(1, collections=6),
    "lidar_only": lambda: scenes.lidar_only(1, collections=6),
    "joints_above_a_camera": lambda: arm.camera_on_arm(1, errors=JOINTS, collections=12),
    "joints_above_a_board": lambda: arm.board_on_arm(1, errors=JOINTS, collections=12),
}
for _model in MODELS:
    SCENES[_model] = lambda model=_model: scenes.two_cameras(
        1, camera=Camera(1280, 800, K, MODELS[model], model), collections=4
    )


# the distortion that boards in the middle of an image tell, and less than it has
TOLD = {
    "none": ("fx", "fy", "cx", "cy"),
    "plumb_bob": ("fx", "fy", "cx", "cy", "k1", "p1", "p2"),
    "rational_polynomial": ("fx", "fy", "cx", "cy", "p2", "k4"),
    "equidistant": ("fx", "cy", "k1"),
}
for _model in MODELS:
    SCENES[f"intrinsics of {_model}"] = lambda model=_model: scenes.two_cameras(
        1, camera=Camera(1280, 800, K, MODELS[model], model), collections=12
    )


SCENES["range sensors and intrinsics of plumb_bob"] = SCENES["random_scene"]


def told(dataset, scene):
    """Return the intrinsics that are free in a scene."""
    if "intrinsics" not in scene:
        return {}
    cameras = [s.name for s in dataset.sensors.values() if s.modality == "rgb"]
    return dict.fromkeys(cameras, TOLD[scene.split()[-1]])


def problem_of(dataset, disturbance=(0.05, 0.05), scene=""):
    free = replace(free_edges(dataset, CalibrationOptions()), intrinsics=told(dataset, scene))
    dataset = disturbed(dataset, free, *disturbance, np.random.default_rng(0))
    measurements, _ = read_measurements(dataset)
    boards = initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


@pytest.mark.sampled(20)
@pytest.mark.parametrize("loss", losses.LOSSES)
@pytest.mark.parametrize("scene", SCENES)
def test_normal_equations_are_those_of_the_specification(scene, loss):
    problem = problem_of(SCENES[scene]().dataset, scene=scene)
    sigmas = problem.initial_sigmas
    x = 0.05 * np.random.default_rng(1).standard_normal(problem.parameters.size)
    ours = CeresSolver(problem).equations(x, sigmas, loss)
    theirs = LevenbergMarquardt(problem).equations(x, sigmas, loss)
    for name in ("shared", "cross", "local", "gradient_shared", "gradient_local"):
        a, b = getattr(ours, name), getattr(theirs, name)
        scale = max(np.max(np.abs(b)), 1e-12) if b.size else 1.0
        np.testing.assert_allclose(a / scale, b / scale, atol=1e-10, err_msg=name)


@pytest.mark.sampled(20)
@pytest.mark.parametrize("loss", losses.LOSSES)
@pytest.mark.parametrize("scene", SCENES)
def test_squares_and_inset_columns_are_those_of_the_specification(scene, loss):
    problem = problem_of(SCENES[scene]().dataset, scene=scene)
    rng = np.random.default_rng(1)
    insets = {
        i: rng.uniform(0.0, 0.01, (block.count, 2))
        for i, block in enumerate(problem.residual_blocks)
        if isinstance(block, BorderBlock)
    }
    solvers = [CeresSolver(problem), LevenbergMarquardt(problem)]
    for solver in solvers:
        solver.take_insets(problem.with_insets(insets))
    sigmas, x = problem.initial_sigmas, 0.05 * rng.standard_normal(problem.parameters.size)
    for ours, theirs in zip(*(solver.squares(x, sigmas) for solver in solvers)):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
    ours, theirs = (solver.assess(x, sigmas, loss).columns for solver in solvers)
    assert [c.block for c in ours] == [c.block for c in theirs] == list(insets)
    for a, b in zip(ours, theirs):
        np.testing.assert_array_equal(a.detection, b.detection)
        for name in ("across", "by_steps", "curvature", "slope", "by_twist"):
            value = getattr(b, name)
            scale = np.max(np.abs(value))
            np.testing.assert_allclose(getattr(a, name), value, atol=1e-9 * scale, err_msg=name)


@pytest.mark.parametrize("scene", SCENES)
def test_rows_are_those_of_the_specification(scene):
    problem = problem_of(SCENES[scene]().dataset, scene=scene)
    x = 0.05 * np.random.default_rng(1).standard_normal(problem.parameters.size)
    poses = problem.poses(x)
    ours, theirs = (
        list(s(problem).linearised_blocks(x, poses)) for s in (CeresSolver, LevenbergMarquardt)
    )
    assert len(ours) == len(theirs) == len(problem.residual_blocks)
    for block, (residual, by_state), (value, derivative) in zip(
        problem.residual_blocks, ours, theirs
    ):
        np.testing.assert_allclose(residual, value, rtol=1e-9, atol=1e-9, err_msg=block.sensor)
        scale = np.max(np.abs(derivative))
        np.testing.assert_allclose(by_state, derivative, atol=1e-9 * scale, err_msg=block.sensor)


def test_points_behind_and_beside_the_camera_too():
    camera = Camera(1280, 800, K, MODELS["plumb_bob"], "plumb_bob")
    problem = problem_of(scenes.two_cameras(1, camera=camera, collections=4).dataset)
    x = np.random.default_rng(3).standard_normal(problem.parameters.size)
    sigmas = problem.initial_sigmas
    ours, theirs = (
        s(problem).equations(x, sigmas, "none") for s in (CeresSolver, LevenbergMarquardt)
    )
    scale = np.max(np.abs(theirs.local))
    np.testing.assert_allclose(ours.local / scale, theirs.local / scale, atol=1e-9)


@pytest.mark.sampled(8)
@pytest.mark.parametrize("loss", losses.LOSSES)
@pytest.mark.parametrize("scene", SCENES)
def test_the_minimum_is_that_of_the_specification(scene, loss):
    problem = problem_of(SCENES[scene]().dataset, scene=scene)
    sigmas, zero = problem.initial_sigmas, np.zeros(problem.parameters.size)
    start = LevenbergMarquardt(problem).minimise(zero, sigmas, losses.NONE, 200).x
    ours = CeresSolver(problem).minimise(start, sigmas, loss, 200)
    theirs = LevenbergMarquardt(problem).minimise(start, sigmas, loss, 200)
    assert ours.converged and theirs.converged
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-9)
    assert ours.cost == pytest.approx(
        losses.total_cost(loss, LevenbergMarquardt(problem).squares(ours.x, sigmas))
    )
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-6)


def test_the_whole_calibration_agrees_to_a_micrometre():
    scene = paper_cell(0, "train", Noise(), (0.1, 0.1))
    for options in (SolverOptions(), SolverOptions(weights="atom", loss="none")):
        found = {}
        for name in ("ceres", "scipy"):
            result = calibrate(scene.dataset, CalibrationOptions(solver=options, solver_name=name))
            assert result.status == "converged"
            transforms = next(iter(result.dataset.collections.values())).transforms
            found[name] = np.array([transforms[s.edge][:3] for s in scene.dataset.sensors.values()])
        np.testing.assert_allclose(found["ceres"], found["scipy"], atol=1e-6)


def test_convergence_is_not_claimed_when_iterations_run_out():
    problem = problem_of(scenes.random_scene(0).dataset)
    end = CeresSolver(problem).minimise(
        np.zeros(problem.parameters.size), problem.initial_sigmas, losses.NONE, 1
    )
    assert not end.converged


@pytest.mark.parametrize(("promised", "is_near"), [(1e-8, True), (1e-3, False)])
def test_where_no_step_lowers_the_cost_a_newton_step_of_no_weight_is_none(
    monkeypatch, promised, is_near
):
    """As with a line scanner whose distances have kinks: 1e-8 is a ten-thousandth of a sigma."""
    problem = problem_of(scenes.random_scene(0).dataset)
    solver = CeresSolver(problem)
    x = np.zeros(problem.parameters.size)
    monkeypatch.setattr(solver, "equations", lambda *_: Promise(promised))
    end = solver.minimise(x, problem.initial_sigmas, losses.NONE, 200)
    assert end.converged == is_near


class Promise:
    """Equations that promise the same decrease of the cost, however far the solver goes."""

    def __init__(self, decrease):
        self._decrease = decrease

    def newton_decrease(self):
        return self._decrease


def test_the_cost_never_rises():
    problem = problem_of(scenes.random_scene(0).dataset)
    sigmas, x = problem.initial_sigmas, np.zeros(problem.parameters.size)
    solver, costs = CeresSolver(problem), []
    for _ in range(5):
        costs.append(losses.total_cost(losses.CAUCHY, solver.squares(x, sigmas)))
        x = solver.minimise(x, sigmas, losses.CAUCHY, 1).x
    assert all(later <= earlier for earlier, later in zip(costs, costs[1:]))


def test_progress_is_reported_and_can_stop_with_the_best_state():
    problem = problem_of(scenes.random_scene(0).dataset)
    seen = []

    def stop_after_two(iteration, cost, x):
        seen.append(cost)
        return iteration < 2

    end = CeresSolver(problem)._native.minimise(
        np.zeros(problem.parameters.size),
        list(problem.initial_sigmas),
        ceres_solver._loss("none"),
        ceres_solver._criteria(),
        100,
        1e-10,
        0.0,
        progress=stop_after_two,
    )
    assert end["stopped"] and not end["converged"]
    assert end["cost"] == pytest.approx(seen[-1]) and seen[-1] < seen[0]


def one_row(**change):
    return {"kind": "orthogonal", "detection": [0], "points": np.zeros((1, 3)), **change}


@pytest.mark.parametrize(
    "change, message",
    [
        ({"initial": np.zeros((2, 3, 3))}, "initial"),
        ({"residual_blocks": [one_row(kind="sphere")]}, "kind must be"),
        ({"residual_blocks": [one_row(detection=[9])]}, "detection that does not exist"),
        ({"block": np.array([[7]])}, "parameter block that does not exist"),
        ({"intrinsics": np.array([[7]])}, "parameter block that does not exist"),
        ({"intrinsics": np.array([[0]])}, "intrinsics stand beside the chain"),
        ({"intrinsics": np.zeros((2, 1), dtype=int)}, "intrinsics must have the shape"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(change, message):
    from atom_core import native

    arguments = {
        "initial": np.eye(4)[None],
        "eliminated": np.array([False]),
        "constants": np.tile(np.eye(4), (1, 2, 1, 1)),
        "block": np.array([[0]]),
        "inverted": np.array([[False]]),
        "intrinsics": np.zeros((1, 0), dtype=int),
        "residual_blocks": [one_row()],
    }
    with pytest.raises(ValueError, match=message):
        native.require("a test").CalibrationProblem(**{**arguments, **change})


# ------------------------------------------------------------------------ constants


def test_the_longest_step_is_said_once(monkeypatch):
    problem = problem_of(scenes.random_scene(1, collections=6).dataset, (0.1, 0.1))
    sigmas, zero = problem.initial_sigmas, np.zeros(problem.parameters.size)

    def first_step():
        end = CeresSolver(problem).minimise(zero, sigmas, losses.NONE, 1)
        return np.max(np.linalg.norm(problem.parameters.by_block(end.x)[:, 3:], axis=1))

    assert first_step() > 0.05
    monkeypatch.setattr(ceres_solver, "LONGEST_MOVE_M", 0.01)
    assert first_step() <= 0.01


@pytest.mark.parametrize("loss", [losses.HUBER, losses.CAUCHY])
def test_the_width_of_a_loss_is_said_once(loss, monkeypatch):
    problem = problem_of(scenes.random_scene(1, collections=6).dataset)
    sigmas, x = problem.initial_sigmas, np.zeros(problem.parameters.size)
    before = CeresSolver(problem).equations(x, sigmas, loss).shared
    monkeypatch.setattr(losses, f"_{loss.upper()}_WIDTH", 0.7)
    ours = CeresSolver(problem).equations(x, sigmas, loss).shared
    theirs = LevenbergMarquardt(problem).equations(x, sigmas, loss).shared
    scale = np.max(np.abs(theirs))
    np.testing.assert_allclose(ours / scale, theirs / scale, atol=1e-10)
    assert np.max(np.abs(ours - before)) > 1e-3 * scale


@pytest.mark.parametrize(
    "module, name, value",
    [(rectangle, "BLEND", 0.1), (camera_models, "NEAR_M", 2.0), (intrinsics, "MOST_LOG", 0.01)],
)
def test_a_constant_of_the_residuals_goes_over(module, name, value, monkeypatch):
    scene = "range sensors and intrinsics of plumb_bob"
    problem = problem_of(SCENES[scene]().dataset, scene=scene)
    x = 0.05 * np.random.default_rng(1).standard_normal(problem.parameters.size)
    sigmas = problem.initial_sigmas
    before = CeresSolver(problem).squares(x, sigmas)
    for place in (module, ceres_solver):
        monkeypatch.setattr(place, name, value)
    ours, theirs = (s(problem).squares(x, sigmas) for s in (CeresSolver, LevenbergMarquardt))
    for a, b in zip(ours, theirs):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)
    assert any(not np.allclose(a, b) for a, b in zip(ours, before))
