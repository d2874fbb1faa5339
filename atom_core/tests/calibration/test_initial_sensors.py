"""Sensors placed from the data alone, whatever the description says; and bad descriptions."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.start.hand_eye import MovingView, solve_hand_eye
from atom_core.calibration.start.initial_sensors import _turn
from atom_core.calibration.start.pose_votes import Statement, consensus
from atom_core.calibration.start.starts import estimate_sensors
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import rigid_fit
from atom_core.model.config import EdgeConfig
from atom_core.model.transforms import Edge
from atom_core.solvers.base import SolverOptions
from atom_core.synthetic import Noise, disturbed, paper_cell, scenes

FAR = (3.0, 2.0)  # metres and radians: nothing of the description is left
NO_GUESS = CalibrationOptions(initial_guess="none")
OUTLINE = np.array([[-0.5, -0.4, 0], [0.5, -0.4, 0], [0.5, 0.4, 0], [-0.5, 0.4, 0]])
HALF_TURN = se3.transform(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))


def random_pose(rng, metres=2.0):
    return se3.random_move(metres * rng.random(), np.pi * rng.random(), rng)


def edge_errors(dataset, truth):
    """Return (n, 2): metres and radians of every calibrated edge."""
    rows = []
    for edge, true in truth.edges.items():
        found = dataset.first_value(edge)
        turn = se3.rotation_angle(found[:3, :3].T @ true[:3, :3])
        rows.append((np.linalg.norm(found[:3, 3] - true[:3, 3]), turn))
    return np.array(rows)


def test_a_rigid_motion_is_found_from_points():
    rng = np.random.default_rng(0)
    motion, points = random_pose(rng), rng.standard_normal((8, 3))
    found = rigid_fit(points, se3.apply(motion, points), rng.random(8))
    np.testing.assert_allclose(found, motion, atol=1e-12)


def test_consensus_finds_the_motion_among_ambiguous_and_wrong_statements():
    rng = np.random.default_rng(1)
    motion = random_pose(rng)
    statements = []
    for i in range(8):
        source = random_pose(rng)
        target = motion @ source if i < 5 else random_pose(rng)
        both = np.stack([source @ HALF_TURN, source])
        statements.append(Statement(both, np.stack([target @ HALF_TURN, target]), OUTLINE))
    best, *others = consensus(statements)
    np.testing.assert_allclose(best.pose, motion, atol=1e-9)
    assert best.support == pytest.approx(5.0, abs=0.01)
    assert all(other.support < 3.0 for other in others)


def test_one_symmetric_statement_leaves_two_answers():
    rng = np.random.default_rng(2)
    source, target = random_pose(rng), random_pose(rng)
    both = np.stack([source, source @ HALF_TURN])
    first, second = consensus([Statement(both, target[None], OUTLINE)])
    assert first.support == pytest.approx(second.support)


def moving_views(rng, X, F, axes):
    views = []
    for _ in range(8):
        turn = se3.rotation_from_rotation_vector(axes @ rng.uniform(-1, 1, axes.shape[1]))
        G = se3.transform(turn, rng.uniform(-1, 1, 3))
        H = se3.inverse(G @ X) @ F
        views.append(MovingView(G, np.stack([H @ HALF_TURN, H])))
    return views


def test_hand_eye_is_found_with_ambiguous_poses():
    rng = np.random.default_rng(3)
    X, F = random_pose(rng), random_pose(rng)
    found = solve_hand_eye(moving_views(rng, X, F, np.eye(3)), OUTLINE)
    # the board's half turn is a matter of convention here, X is not
    np.testing.assert_allclose(found, X, atol=1e-6)


def test_hand_eye_without_motion_is_not_found():
    rng = np.random.default_rng(4)
    views = moving_views(rng, random_pose(rng), random_pose(rng), np.eye(3))
    assert solve_hand_eye(views[:2], OUTLINE) is None


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    "scene",
    [
        paper_cell,
        scenes.random_scene,
        scenes.lidar_only,
        scenes.shared_edge,
        scenes.two_patterns,
        scenes.two_cameras,
        scenes.hand_eye,
        scenes.board_on_arm,
        scenes.hand_beside_others,
    ],
)
def test_sensors_are_placed_from_the_boards_they_share(scene):
    simulated = scene(0, disturbance=FAR)
    error = edge_errors(estimate_sensors(simulated.dataset), simulated.truth)
    assert np.max(error[:, 0]) < 0.25 and np.max(error[:, 1]) < 0.25


def test_an_arm_before_a_board_that_is_carried_is_placed_by_the_cameras_beside_it():
    """Nothing is held, and no board stays: the other cameras take the place of one that does."""
    scene = scenes.hand_beside_others(1, collections=14, disturbance=FAR)
    error = edge_errors(estimate_sensors(scene.dataset), scene.truth)
    assert np.max(error[:, 0]) < 0.25 and np.max(error[:, 1]) < 0.25
    result = calibrate(scene.dataset, NO_GUESS)
    assert result.status == "converged" and not any("do not tell" in w for w in result.warnings)
    assert np.max(edge_errors(result.dataset, scene.truth)[:, 0]) < 0.01


def test_sensors_that_do_not_turn_place_nothing_by_their_motion():
    """Two that stand still say nothing of each other but by boards that a third one has placed."""
    still = [MovingView(np.eye(4), np.eye(4)[None])] * 5
    turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, 0.5]))
    about_one_axis = [*still, MovingView(turn, np.eye(4)[None])]
    assert not _turn(still) and not _turn(about_one_axis)
    tilt = se3.from_rpy(np.zeros(3), np.array([0.3, 0.0, 0.0]))
    assert _turn([*about_one_axis, MovingView(tilt, np.eye(4)[None])])


def test_the_description_is_not_used():
    starts = [
        estimate_sensors(scenes.random_scene(1, disturbance=FAR).dataset),
        estimate_sensors(scenes.random_scene(1).dataset),
    ]
    for sensor in starts[0].sensors.values():
        first, second = (s.first_value(sensor.edge) for s in starts)
        np.testing.assert_allclose(first, second, atol=1e-9)


@pytest.mark.parametrize("held", ["rgb_2", "lidar_1"])
def test_whichever_sensor_is_held_stays_and_the_others_follow(held):
    scene = scenes.random_scene(2, disturbance=FAR)
    sensors = scene.dataset.sensors
    true = {sensors[held].edge: scene.truth.edges[sensors[held].edge]}
    dataset = scene.dataset.with_transforms(dict.fromkeys(scene.dataset.collections, true))
    config = replace(dataset.config, anchored_sensor=held)
    error = edge_errors(estimate_sensors(replace(dataset, config=config)), scene.truth)
    assert np.max(error[:, 0]) < 0.25
    assert error[list(scene.truth.edges).index(sensors[held].edge), 0] == 0.0


def test_boards_that_are_held_place_every_sensor():
    scene = scenes.random_scene(3)
    solved = calibrate(scene.dataset).dataset
    rng = np.random.default_rng(0)
    lost = {edge: se3.random_move(*FAR, rng) @ true for edge, true in scene.truth.edges.items()}
    dataset = solved.with_transforms(dict.fromkeys(solved.collections, lost))
    options = CalibrationOptions(anchor_patterns=True, ignore_anchored_sensor=True)
    assert np.max(edge_errors(estimate_sensors(dataset, options), scene.truth)[:, 0]) < 0.25


@pytest.mark.long
@pytest.mark.sampled(1)
@pytest.mark.parametrize("disturbance", [(0.0, 0.0), FAR])
def test_no_guess_and_a_good_guess_give_the_same_answer(disturbance):
    scene = paper_cell(3, "train", Noise(), disturbance)
    found = calibrate(scene.dataset, NO_GUESS)
    good = calibrate(paper_cell(3).dataset)
    assert found.status == good.status == "converged"
    for edge in scene.truth.edges:
        apart = found.dataset.first_value(edge) - good.dataset.first_value(edge)
        assert np.max(np.abs(apart)) < 1e-6


@pytest.mark.long
def test_gross_errors_do_not_mislead_the_start():
    scene = paper_cell(4, "train", Noise(gross_fraction=0.1), FAR)
    result = calibrate(scene.dataset, NO_GUESS)
    assert result.status == "converged"
    assert np.max(edge_errors(result.dataset, scene.truth)[:, 0]) < 0.005


def test_a_description_that_is_metres_off_is_left_and_said():
    scene = paper_cell(1, "train", Noise(), FAR)
    result = calibrate(scene.dataset)
    assert result.status == "converged"
    assert np.max(edge_errors(result.dataset, scene.truth)[:, 0]) < 0.005
    assert any("placed from the shared boards instead" in w for w in result.warnings)


@pytest.mark.parametrize("loss", ["cauchy", "none"])
def test_boards_that_stand_wrong_and_pull_the_sensors_away_are_placed_anew(loss):
    """Two mirrored boards: only a robust loss lets go of them, so that they can be seen."""
    dataset = scenes.random_scene(0, collections=12).dataset
    options = CalibrationOptions(solver=SolverOptions(loss=loss))
    good = calibrate(dataset, options).dataset
    found = calibrate(dataset, replace(options, noisy_initial_guess=(0.5, 0.5))).dataset
    for sensor in dataset.sensors.values():
        apart = found.first_value(sensor.edge) - good.first_value(sensor.edge)
        assert np.max(np.abs(apart)) < 1e-6


@pytest.mark.long
def test_a_board_that_turned_round_on_its_way_does_not_stop_the_solver():
    """The numbers of a pose become singular at a full turn; they are counted anew before it."""
    scene = paper_cell(5)
    far = disturbed(scene, FAR, np.random.default_rng([5, 900]))
    result = calibrate(far.dataset)
    assert result.status == "converged", result.message
    turns = np.linalg.norm(result.summary.x.reshape(-1, 6)[:, :3], axis=1)
    assert np.max(turns) < np.pi
    assert np.max(edge_errors(result.dataset, scene.truth)[:, 0]) < 0.005


def test_a_good_description_is_not_doubted():
    result = calibrate(paper_cell(1, "train", Noise(gross_fraction=0.1), (0.1, 0.1)).dataset)
    assert not any("shared boards" in warning for warning in result.warnings)


def test_what_the_boards_leave_ambiguous_is_named():
    result = calibrate(scenes.random_scene(5, collections=3, disturbance=FAR).dataset, NO_GUESS)
    assert result.status == "rank_deficient"
    (weak,) = result.weak_directions
    assert weak.parameters == ("lidar_1 pose",)
    assert "at two places, equally good" in weak.why


def test_sensors_that_nothing_connects_are_named():
    with pytest.raises(CalibrationError, match=r"\{rgb_1, rgb_2\}; \{rgb_3, lidar_1\}"):
        estimate_sensors(scenes.disconnected(0).dataset)


def test_what_the_motion_does_not_tell_starts_from_the_description():
    dataset = scenes.hand_eye(0, collections=2).dataset
    result = calibrate(dataset, NO_GUESS)
    assert any("'rgb_1': the data alone do not tell" in w for w in result.warnings)


def test_an_additional_tf_starts_from_the_description():
    dataset = scenes.hand_eye(0, collections=12).dataset
    edge = Edge("world", "rig_base")
    entry = EdgeConfig(parent_link=edge.parent, child_link=edge.child)
    config = replace(dataset.config, additional_tfs={"base": entry})
    result = calibrate(replace(dataset, config=config), NO_GUESS)
    assert any("additional tf 'base'" in w and "description" in w for w in result.warnings)


@pytest.mark.sampled(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 20))]
)
def test_cells_are_found_without_a_guess_and_from_a_bad_one(seed):
    """`make bench` takes a hundred of each, and rigs of other kinds."""
    for disturbance, options in (((0.5, 0.5), CalibrationOptions()), (FAR, NO_GUESS)):
        scene = paper_cell(1000 + seed, "train", Noise(), disturbance)
        result = calibrate(scene.dataset, options)
        assert result.status == "converged"
        assert np.max(edge_errors(result.dataset, scene.truth)[:, 0]) < 0.006
