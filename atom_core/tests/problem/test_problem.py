"""Residuals and their Jacobians through every kind of chain, and what they are at the truth."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.calibration.start.disturb import disturbed
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import MULTIPLE, board_edge
from atom_core.model.truth import with_truth
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import read_measurements
from atom_core.synthetic import Noise, arm, degenerate, paper_cell, scenes

K = np.array([[900.0, 0, 640.0], [0, 890.0, 400.0], [0, 0, 1]])
MODELS = {
    "none": [],
    "plumb_bob": [-0.2, 0.05, 0.001, -0.002, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.001, -0.002, 0.01, 0.5, -0.1, 0.02],
    "equidistant": [-0.03, 0.01, -0.004, 0.001],
}
JOINTS = {
    "shoulder_lift": dict.fromkeys(("origin_x", "origin_roll", "origin_pitch", "origin_yaw"), 0.01),
    "telescope": {"position_bias": 0.01, "origin_y": 0.01},
    "elbow": {"position_bias": 0.02},
    "wrist_3": {"origin_y": 0.01, "origin_z": 0.02},
}
SCENES = {
    "random_scene": lambda: scenes.random_scene(1, collections=4),
    "shared_edge": lambda: scenes.shared_edge(1, collections=4),
    "hand_eye": lambda: scenes.hand_eye(1, collections=4),
    "board_on_arm": lambda: scenes.board_on_arm(1, collections=4),
    "two_patterns": lambda: scenes.two_patterns(1, collections=4),
    "joints_above_a_camera": lambda: arm.camera_on_arm(1, errors=JOINTS, collections=4),
    "joints_above_a_board": lambda: arm.board_on_arm(1, errors=JOINTS, collections=4),
}
for _model in MODELS:
    SCENES[_model] = lambda model=_model: scenes.two_cameras(
        1, camera=Camera(1280, 800, K, MODELS[model], model), collections=3
    )
INTRINSICS = [
    *MODELS,
    "hand_eye",
    "random_scene",
    "joints_above_a_camera",
]  # with free intrinsics of rgb_1


def problem_of(dataset, boards=None, intrinsics=()):
    free = free_edges(dataset, CalibrationOptions(intrinsics=intrinsics))
    measurements, _ = read_measurements(dataset)
    boards = boards or initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


def stacked(problem, x, sigmas):
    rows = [(r / s[:, None]).ravel() for r, s in zip(problem.residuals(x), sigmas)]
    return np.concatenate(rows)


@pytest.mark.parametrize(
    "scene, intrinsics",
    [(scene, ()) for scene in SCENES] + [(scene, ("rgb_1",)) for scene in INTRINSICS],
)
def test_jacobian_against_central_differences(scene, intrinsics):
    problem = problem_of(SCENES[scene]().dataset, intrinsics=intrinsics)
    assert bool(problem.parameters.cameras) == bool(intrinsics)
    rng = np.random.default_rng(0)
    x = 0.03 * rng.standard_normal(problem.parameters.size)
    sigmas = problem.initial_sigmas
    analytic, h = problem.jacobian(x, sigmas).toarray(), 1e-6
    numeric = np.empty_like(analytic)
    for i in range(len(x)):
        step = np.zeros_like(x)
        step[i] = h
        ahead, behind = stacked(problem, x + step, sigmas), stacked(problem, x - step, sigmas)
        numeric[:, i] = (ahead - behind) / (2 * h)
    scale = np.max(np.abs(analytic), axis=1, keepdims=True)
    np.testing.assert_allclose(analytic / scale, numeric / scale, atol=1e-6)


def test_every_free_parameter_moves_some_residual():
    problem = problem_of(paper_cell(0).dataset)
    sigmas = problem.initial_sigmas
    jacobian = problem.jacobian(np.zeros(problem.parameters.size), sigmas)
    assert np.all(np.asarray(abs(jacobian).sum(axis=0)) > 0)


def test_residuals_vanish_at_the_truth_of_exact_measurements():
    scene = scenes.random_scene(
        2, collections=4, noise=Noise.none(), sampling=scenes.Sampling(exact_border=True)
    )
    dataset = with_truth(scene.dataset, scene.truth)
    problem = problem_of(dataset, dict(scene.truth.boards))
    for block, residual in zip(
        problem.residual_blocks, problem.residuals(np.zeros(problem.parameters.size))
    ):
        if block.modality == "depth" and block.kind == "border":
            continue  # a pixel's border is quantised
        assert np.max(np.abs(residual)) < 1e-6, (block.sensor, block.kind)


def test_constants_are_not_in_the_vector():
    dataset = paper_cell(0).dataset
    problem = problem_of(dataset)
    held = dataset.sensors[dataset.config.anchored_sensor].edge
    assert held not in [block.edge for block in problem.parameters.blocks]
    free_sensors = len(dataset.sensors) - 1
    assert problem.parameters.size == 6 * (free_sensors + len(dataset.collections))


def test_sensors_that_share_an_edge_share_one_block():
    problem = problem_of(scenes.shared_edge(0).dataset)
    names = [b.names for b in problem.parameters.blocks if b.kind == "sensor"]
    assert names == [("rgb_2", "depth_1")]


def test_a_fixed_pattern_is_one_block():
    scene = scenes.hand_eye(0)
    boards = [b for b in problem_of(scene.dataset).parameters.blocks if b.kind == "pattern"]
    assert len(boards) == 1 and boards[0].collection is None


def test_initial_boards_are_right_when_the_sensors_are():
    scene = paper_cell(3)
    dataset = with_truth(scene.dataset, scene.truth)
    free = free_edges(dataset, CalibrationOptions())
    boards = initial_boards(dataset, read_measurements(dataset)[0], free)
    errors = [
        np.linalg.norm(pose[:3, 3] - scene.truth.boards[key][:3, 3]) for key, pose in boards.items()
    ]
    assert np.median(errors) < 0.01
    assert np.max(errors) < 0.05


def test_disturbance_has_the_asked_size_and_spares_the_anchor_and_the_boards():
    scene = paper_cell(0)
    dataset, options = scene.dataset, CalibrationOptions()
    free = free_edges(dataset, options)
    moved = disturbed(dataset, free, 0.1, 0.2, np.random.default_rng(5))
    key = next(iter(dataset.collections))
    before, after = dataset.collections[key].transforms, moved.collections[key].transforms
    anchored = dataset.config.anchored_sensor
    for sensor in dataset.sensors.values():
        shift = np.linalg.norm(after[sensor.edge][:3, 3] - before[sensor.edge][:3, 3])
        turn = before[sensor.edge][:3, :3].T @ after[sensor.edge][:3, :3]
        angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
        expected = (0.0, 0.0) if sensor.name == anchored else (0.1, 0.2)
        np.testing.assert_allclose((shift, angle), expected, atol=1e-7)
    assert board_edge(dataset.patterns["pattern_1"]) not in after


def test_a_sensors_edge_is_disturbed_as_one_whatever_type_it_has():
    dataset = paper_cell(0).dataset
    edges = [sensor.edge for sensor in dataset.sensors.values()]
    typed = replace(dataset, edge_types={**dataset.edge_types, **dict.fromkeys(edges, MULTIPLE)})
    free = free_edges(dataset, CalibrationOptions())
    moved = disturbed(typed, free, 0.1, 0.2, np.random.default_rng(5))
    for edge in edges:
        for collection in moved.collections.values():
            np.testing.assert_array_equal(collection.transforms[edge], moved.first_value(edge))


def test_one_collection_is_enough_for_an_additional_tf():
    scene = degenerate.redundant_edge(0, collections=4)
    dataset = scene.dataset.selected(collections=["000"])
    measurements, _ = read_measurements(dataset)
    free = free_edges(dataset, CalibrationOptions())
    boards = initial_boards(dataset, measurements, free)
    problem = build_problem(dataset, measurements, boards, free)
    assert "post" in [name for block in problem.parameters.blocks for name in block.names]


def test_an_additional_tf_that_is_a_sensors_edge_has_one_block_and_keeps_no_other_from_its_own():
    scene = degenerate.redundant_edge(0, collections=4)
    measurements, _ = read_measurements(scene.dataset)
    free = free_edges(scene.dataset, CalibrationOptions())
    (post,) = free.additional_tfs.values()
    of_sensor = next(
        s.edge
        for s in scene.dataset.sensors.values()
        if s.edge not in free.held_edges(scene.dataset)
    )
    both = replace(free, additional_tfs={"mount": of_sensor, "post": post})
    boards = initial_boards(scene.dataset, measurements, both)
    blocks = build_problem(scene.dataset, measurements, boards, both).parameters.blocks
    edges = [getattr(block, "edge", None) for block in blocks]
    assert edges.count(of_sensor) == 1 and edges.count(post) == 1
