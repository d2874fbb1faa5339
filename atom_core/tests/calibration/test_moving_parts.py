"""Moving parts that are off from collection to collection: room for them in the solution."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE
from atom_core.model.transforms import Edge
from atom_core.problem.moving_blocks import MOVING, MovingBlock
from atom_core.problem.parameters import Parameters
from atom_core.report.calibration_results import calibration_results
from atom_core.solvers.choice import SOLVERS, solver_factory
from atom_core.synthetic import arm, paper_cell, scenes
from atom_core.synthetic.driving import ODOMETRY, vehicle_before_a_board
from atom_core.synthetic.mistakes import (
    with_edge_off,
    with_scaled_boards,
    with_scaled_focal_length,
)
from atom_core.synthetic.realism import PLAIN

DEG = float(np.radians(1.0))
ESTIMATED = CalibrationOptions(moving_edge_sigma={"flange": None})


def of_an_arm(seed, sigma_m, sigma_rad, kind="hand_eye", collections=20):
    realism = replace(PLAIN, moving_edge_sigma_m=sigma_m, moving_edge_sigma_rad=sigma_rad)
    return getattr(scenes, kind)(seed, collections=collections, realism=realism)


class Outcome(NamedTuple):
    off_m: float
    in_sigmas: np.ndarray
    part: object


def outcome(scene, options, solver="ceres"):
    result = calibrate(scene.dataset, replace(options, solver_name=solver))
    assert result.status in ("converged", "inconsistent"), result.message
    (edge,) = [e for e in calibration_results(result, solver).edges if not e.anchored]
    truth, now = scene.truth.edges[edge.edge], edge.parent_T_child
    off = now[:3, 3] - truth[:3, 3]
    turn = se3.rotation_vector_from_rotation(now[:3, :3] @ truth[:3, :3].T)
    in_sigmas = np.concatenate([off / edge.sigma_translation_m, turn / edge.sigma_rotation_rad])
    part = next(iter(result.free.moving.values()), None)
    return Outcome(float(np.linalg.norm(off)), in_sigmas, part)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["hand_eye", "board_on_arm"])
def test_the_spread_of_an_arm_is_estimated_and_the_sensor_is_nearer(kind, solver):
    scene = of_an_arm(1, 0.003, 0.3 * DEG, kind)
    without = outcome(scene, CalibrationOptions(), solver)
    found = outcome(scene, ESTIMATED, solver)
    assert found.part.sigma_m == pytest.approx(0.003, rel=0.2)
    assert found.part.sigma_rad == pytest.approx(0.3 * DEG, rel=0.2)
    assert found.off_m < 0.3 * without.off_m
    assert np.all(np.abs(found.in_sigmas) < 3.0)


@pytest.mark.long
@pytest.mark.parametrize("sigma_m, sigma_rad", [(0.001, 0.0), (0.003, 0.3 * DEG)])
def test_ten_arms(sigma_m, sigma_rad):
    scenes_ = [of_an_arm(seed, sigma_m, sigma_rad, collections=30) for seed in range(10)]
    found = [outcome(scene, ESTIMATED) for scene in scenes_]
    without = [outcome(scene, CalibrationOptions()).off_m for scene in scenes_]
    near = [abs(f.part.sigma_m / sigma_m - 1.0) < 0.2 for f in found]
    if sigma_rad > 0.0:
        near = [n and abs(f.part.sigma_rad / sigma_rad - 1.0) < 0.2 for n, f in zip(near, found)]
    assert sum(near) >= 9
    assert np.mean([f.off_m for f in found]) < 0.5 * np.mean(without)
    held = np.mean(np.abs([f.in_sigmas for f in found]) < 1.96)
    assert 0.90 <= held <= 0.99


def test_a_given_spread_is_taken_as_it_is_and_gives_much_the_same():
    scene = of_an_arm(2, 0.003, 0.3 * DEG)
    given = CalibrationOptions(moving_edge_sigma={"flange": (0.003, 0.3 * DEG)})
    one, other = outcome(scene, given), outcome(scene, ESTIMATED)
    assert (one.part.sigma_m, one.part.is_estimated) == (0.003, False)
    assert one.off_m == pytest.approx(other.off_m, rel=0.3)


def test_the_two_solvers_find_the_same_minimum():
    scene = of_an_arm(0, 0.001, 0.1 * DEG, collections=12)
    given = CalibrationOptions(moving_edge_sigma={"flange": (0.001, 0.1 * DEG)})
    result = calibrate(scene.dataset, given)
    solvers = [solver_factory(name)(result.problem) for name in SOLVERS]
    start, sigmas = np.zeros(result.problem.parameters.size), result.summary.sigmas
    one, other = (s.minimise(start, sigmas, "cauchy", 200) for s in solvers)
    assert one.converged and other.converged
    assert one.cost == pytest.approx(other.cost, rel=1e-9)
    np.testing.assert_allclose(one.x, other.x, atol=1e-7)
    for equations in (s.equations(one.x, sigmas, "cauchy") for s in solvers):
        assert np.max(np.abs(equations.gradient_local)) < 1e-2 * np.max(equations.local) ** 0.5


def test_what_is_expected_of_a_part_does_not_depend_on_where_its_numbers_begin():
    rng, edge = np.random.default_rng(0), Edge("base", "flange")
    given = se3.from_rpy(rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3))
    initial = se3.moved(given, se3.random_move(0.002, 0.004, rng))
    block = MovingBlock(edge, MOVING, "000", ("flange",), initial, given, 0.001, 0.002)
    parameters = Parameters([block])
    np.testing.assert_allclose(block.pose(block.prior_mean), given, atol=1e-12)
    assert parameters.prior_cost(block.prior_mean) == pytest.approx(0.0, abs=1e-20)
    x, step = rng.normal(0.0, 0.003, 6), 1e-7
    by_hand = [
        (parameters.prior_cost(x + d) - parameters.prior_cost(x - d)) / (2.0 * step)
        for d in step * np.eye(6)
    ]
    np.testing.assert_allclose(parameters.prior_gradient(x), by_hand, rtol=1e-5)


def test_an_arm_that_is_where_it_says_changes_nothing():
    scene = scenes.hand_eye(0, collections=20)
    without, found = (calibrate(scene.dataset, o) for o in (CalibrationOptions(), ESTIMATED))
    (part,) = found.free.moving.values()
    assert part.sigma_m < 2e-4 and part.sigma_rad < 0.02 * DEG
    edge = scene.dataset.sensors["rgb_1"].edge
    apart = found.dataset.first_value(edge) - without.dataset.first_value(edge)
    assert np.max(np.abs(apart)) < 3e-4


def test_auto_gives_the_arm_room_where_it_is_off_and_only_there():
    auto = CalibrationOptions(model_errors="auto")
    off = calibrate(of_an_arm(3, 0.003, 0.3 * DEG).dataset, auto)
    assert off.status == "converged" and off.moving == ()
    (part,) = off.free.moving.values()
    assert part.is_estimated and part.sigma_m == pytest.approx(0.003, rel=0.2)
    assert calibrate(scenes.hand_eye(0, collections=20).dataset, auto).free.moving == {}


def test_a_pose_of_another_time_is_named_and_does_no_harm():
    scene = of_an_arm(1, 0.001, 0.1 * DEG)
    key, dataset = "005", scene.dataset
    wrong = dict(dataset.collections[key].transforms)
    (hand,) = (edge for edge in wrong if edge.child == "flange")
    wrong[hand] = wrong[hand] @ se3.transform(np.eye(3), np.array([0.05, 0.0, 0.0]))
    collection = replace(dataset.collections[key], transforms=wrong)
    collections = {**dataset.collections, key: collection}
    mistaken = replace(scene, dataset=replace(dataset, collections=collections))
    result = calibrate(mistaken.dataset, ESTIMATED)
    (part,) = result.free.moving.values()
    assert part.far == {key} and part.sigma_m == pytest.approx(0.001, rel=0.2)
    assert any(f"is far off in collection {key}" in warning for warning in result.warnings)
    assert np.all(np.abs(outcome(mistaken, ESTIMATED).in_sigmas) < 3.0)


def test_with_few_collections_the_spread_is_left_and_that_is_said():
    scene = of_an_arm(0, 0.001, 0.0, collections=3)
    result = calibrate(scene.dataset, ESTIMATED)
    assert result.free.moving == {}
    assert any("3 collections tell how far it is off" in warning for warning in result.warnings)


# ------------------------------------------------------------- two cameras, one of them on an arm


def with_an_arm(scene, sigma_m, on=("rgb_2",), seed=0):
    """Return the dataset with sensors on a frame that a collection has off by N(0, sigma_m)."""
    dataset, rng = scene.dataset, np.random.default_rng(seed)
    sensors = dict(dataset.sensors)
    arm = Edge(sensors[on[0]].edge.parent, "arm")
    old = {name: sensors[name].edge for name in on}
    new = {name: Edge("arm", edge.child) for name, edge in old.items()}
    sensors.update({name: replace(sensors[name], edge=edge) for name, edge in new.items()})
    collections = {}
    for key, collection in dataset.collections.items():
        shift = se3.transform(np.eye(3), rng.normal(0.0, sigma_m, 3))
        transforms = {e: m for e, m in collection.transforms.items() if e not in old.values()}
        transforms.update({new[n]: collection.transforms[old[n]] for n in on})
        transforms[arm] = shift
        collections[key] = replace(collection, transforms=transforms)
    types = {**dataset.edge_types, arm: MULTIPLE}
    return replace(dataset, sensors=sensors, collections=collections, edge_types=types)


def test_a_board_that_a_still_camera_sees_tells_how_far_the_arm_of_the_other_is_off():
    dataset = with_an_arm(scenes.two_cameras(0, collections=25), 0.004)
    result = calibrate(
        dataset, CalibrationOptions(moving_edge_sigma={"arm": None}, anchor_sensors=("rgb_1",))
    )
    (part,) = result.free.moving.values()
    assert result.status == "converged", result.message
    assert part.sigma_m == pytest.approx(0.004, rel=0.25)


def test_where_every_board_is_seen_past_the_arm_only_it_is_refused():
    dataset = with_an_arm(scenes.two_cameras(0, collections=6), 0.004, on=("rgb_1", "rgb_2"))
    with pytest.raises(AtomError, match="nothing tells how far 'arm' is off"):
        calibrate(dataset, CalibrationOptions(moving_edge_sigma={"arm": None}))


# --------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    "frame, said",
    [
        ("hand", "no such frame stands between a sensor and a board; .* are: flange"),
        ("rig_base", "'rig_base' stands still in 'world'"),
        ("rgb_1_link", "is estimated already, of sensor 'rgb_1'"),
    ],
)
def test_what_does_not_move_or_is_estimated_already_is_refused(frame, said):
    dataset = scenes.hand_eye(0, collections=4).dataset
    with pytest.raises(AtomError, match=f"--moving_edge_sigma {frame}: .*{said}"):
        calibrate(dataset, CalibrationOptions(moving_edge_sigma={frame: None}))


def test_a_cell_without_an_arm_has_none_to_name():
    with pytest.raises(AtomError, match="those that move are: none"):
        calibrate(paper_cell(0).dataset, CalibrationOptions(moving_edge_sigma={"flange": None}))


def with_an_elbow(dataset, seed=0):
    """Return the dataset with a further frame that moves, between the flange and its parent."""
    rng, collections = np.random.default_rng(seed), {}
    (hand,) = {
        edge
        for c in dataset.collections.values()
        for edge in c.transforms
        if edge.child == "flange"
    }
    upper, lower = Edge(hand.parent, "elbow"), Edge("elbow", "flange")
    for key, collection in dataset.collections.items():
        transforms = {e: m for e, m in collection.transforms.items() if e != hand}
        transforms[upper] = se3.from_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.3, 0.3, 3))
        transforms[lower] = se3.inverse(transforms[upper]) @ collection.transforms[hand]
        collections[key] = replace(collection, transforms=transforms)
    types = {**dataset.edge_types, upper: MULTIPLE, lower: MULTIPLE}
    return replace(dataset, collections=collections, edge_types=types)


def test_two_parts_that_every_board_is_seen_past_cannot_be_told_apart():
    dataset = with_an_elbow(of_an_arm(0, 0.001, 0.0, collections=12).dataset)
    both = CalibrationOptions(moving_edge_sigma={"elbow": None, "flange": None})
    with pytest.raises(AtomError, match="elbow flange: nothing tells which of the two is off"):
        calibrate(dataset, both)
    given = {"elbow": (0.0005, 0.02 * DEG), "flange": (0.001, 0.02 * DEG)}
    assert calibrate(dataset, CalibrationOptions(moving_edge_sigma=given)).status == "converged"


@pytest.mark.parametrize("sigmas", [(0.0, 0.1), (0.001, -1.0), (float("nan"), 0.1), (0.1, np.nan)])
def test_figures_that_are_no_standard_deviations_are_refused(sigmas):
    with pytest.raises(ValueError, match="moving_edge_sigma of flange needs two numbers > 0"):
        CalibrationOptions(moving_edge_sigma={"flange": sigmas})


def small(seed, kind="hand_eye"):
    return of_an_arm(seed, 0.0005, 0.03 * DEG, kind, collections=15)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["hand_eye", "board_on_arm"])
@pytest.mark.parametrize("seed", range(2))
def test_what_a_good_arm_is_off_is_estimated_unasked_and_said(seed, kind):
    scene = small(seed, kind)
    result = calibrate(scene.dataset)
    (part,) = result.free.moving.values()
    assert result.status == "converged" and result.moving == ()
    assert 0.0002 < part.sigma_m < 0.0008 and part.sigma_rad < 0.1 * DEG
    (said,) = [w for w in result.warnings if "contradict the boards" in w]
    assert "the poses of 'flange' in 'rig_base'" in said and "--moving_edge_sigma flange" in said
    asked = calibrate(scene.dataset, ESTIMATED)
    edge = scene.dataset.sensors["rgb_1"].edge
    np.testing.assert_allclose(
        result.dataset.first_value(edge), asked.dataset.first_value(edge), atol=2e-4
    )
    believed = outcome(scene, CalibrationOptions(model_errors="off"))
    found = outcome(scene, CalibrationOptions())
    assert believed.part is None and np.all(np.abs(found.in_sigmas) < 3.5)


@pytest.mark.parametrize("kind", ["hand_eye", "board_on_arm"])
def test_an_arm_that_is_where_it_says_changes_no_digit(kind):
    scene = getattr(scenes, kind)(3, collections=15)
    usual, believed = (
        calibrate(scene.dataset, CalibrationOptions(model_errors=how)) for how in ("suggest", "off")
    )
    assert not usual.free.moving and not any("contradict" in w for w in usual.warnings)
    np.testing.assert_array_equal(usual.summary.x, believed.summary.x)


def test_a_joint_that_is_off_is_not_taken_for_chance():
    """Room for chance would hide it: it moves the arm alike wherever the arm moves alike."""
    scene = arm.camera_on_arm(0, errors={"elbow": {"position_bias": 0.3 * DEG}}, collections=15)
    config = replace(scene.dataset.config, joints={})
    result = calibrate(replace(scene.dataset, config=config))
    assert result.status == "inconsistent" and not result.free.moving


@pytest.mark.long
@pytest.mark.parametrize("kind", ["hand_eye", "board_on_arm"])
def test_ten_good_arms(kind):
    scenes_ = [small(seed, kind) for seed in range(10)]
    found = [outcome(scene, CalibrationOptions()) for scene in scenes_]
    believed = [outcome(scene, CalibrationOptions(model_errors="off")).off_m for scene in scenes_]
    assert sum(f.part is not None for f in found) >= 7  # the others' do not show beside the noise
    assert np.mean([f.off_m for f in found]) < 0.8 * np.mean(believed)
    held = np.mean(np.abs([f.in_sigmas for f in found]) < 1.96)
    assert 0.85 <= held <= 1.0


@pytest.mark.parametrize("factor, told", [(1.02, "long"), (0.98, "short")])
def test_motions_of_another_scale_are_a_cause_beside_a_board_of_another_size(factor, told):
    """Wheels of another radius: the board alone was named, to be estimated."""
    dataset = vehicle_before_a_board(0).dataset
    scaled = {}
    for key, collection in dataset.collections.items():
        at = collection.transforms[ODOMETRY]
        scaled[key] = {ODOMETRY: se3.transform(at[:3, :3], factor * at[:3, 3])}
    message = calibrate(dataset.with_transforms(scaled)).message
    size = "larger" if told == "long" else "smaller"
    cause = f"% {size} than described (or /tf tells motions that much too {told}"
    assert cause in message, message


def test_a_board_of_another_size_before_what_stands_still_is_that_alone():
    scene = scenes.random_scene(0, rgb=2, depth=0, lidar3d=1, collections=16)
    message = calibrate(with_scaled_boards(scene.dataset, 1.03)).message
    assert "than described" in message and "/tf" not in message


@pytest.mark.parametrize("collections", [8, 16])
def test_a_focal_length_that_is_wrong_before_an_arm_that_is_off_is_told_beside_it(collections):
    """Beside the arm as it is told it was 5.9 +- 0.9 % too long, or not to be seen."""
    scene = scenes.hand_eye(0, collections=collections)
    rng = np.random.default_rng([0, 9])
    off = with_edge_off(scene.dataset, "flange", 0.003, 1.0, rng)
    result = calibrate(with_scaled_focal_length(off, "rgb_1", 1.05))
    assert result.message.startswith("the poses of 'flange' in 'rig_base' do not fit")
    (check,) = result.checks
    assert check.error.title == "focal length of rgb_1"
    assert check.value == pytest.approx(np.log(1.0 / 1.05), abs=0.01)


@pytest.mark.parametrize("seed", [0, 3])
def test_an_arm_that_is_off_and_whose_joints_imitate_one_another_is_judged(seed):
    """As where ATOM's users calibrate `origin_yaw` of all joints of an arm."""
    names = [name for name in arm.JOINT_NAMES if name != "telescope"]
    off = {"elbow": lambda p: 0.03 * np.sin(3 * p), "wrist_1": lambda p: 0.03 * np.cos(2 * p)}
    errors = {name: {"origin_yaw": 0.0} for name in names}
    result = calibrate(
        arm.camera_on_arm(seed, errors=errors, lacks=off).dataset, CalibrationOptions()
    )
    assert result.status == "rank_deficient" and "shoulder_pan" in result.message
    assert any("do not fit" in sentence for sentence in result.contradictions)
