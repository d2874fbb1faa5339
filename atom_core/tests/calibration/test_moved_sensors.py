"""A sensor, or a fixed board, that was moved while the collections were made."""

import re
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import arm, paper_cell, scenes
from atom_core.synthetic.cell import cell_rig
from atom_core.synthetic.mistakes import (
    Origin,
    move_about,
    with_detections_from,
    with_displaced_frame,
    with_long_ranges,
    with_moved_board,
    with_moved_sensor,
)
from atom_core.synthetic.realism import PLAIN, SLIGHT

DISTURBED = (0.05, 0.05)
SEED, FIRST, TURN_RAD, SHIFT_M = 0, "011", np.radians(0.6), 0.012


@pytest.fixture(scope="module")
def cell():
    return paper_cell(SEED, disturbance=DISTURBED)


def knocked(scene, sensor, first=FIRST, turn_rad=TURN_RAD, shift_m=SHIFT_M):
    """Return the cell in which a sensor was turned about itself and shifted, before `first`."""
    rng, dataset = np.random.default_rng(5), scene.dataset
    eye = cell_rig(SEED).pose(dataset.sensors[sensor].frame)[:3, 3]
    turn = turn_rad * se3.random_direction(rng)
    move = move_about(eye, turn, shift_m * se3.random_direction(rng))
    return with_moved_sensor(scene, cell_rig(SEED), sensor, first, move, rng)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("sensor", ["lidar_1", "depth_1"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_sensor_that_was_knocked_is_named_with_when_and_how_far(cell, sensor, solver):
    result = calibrate(knocked(cell, sensor), CalibrationOptions(solver_name=solver))
    assert result.status == "inconsistent" and not result.checks
    found = re.match(
        rf"{sensor} was moved between collections (\d+) and (\d+), by (.*) mm and (.*) deg: ",
        result.message,
    )
    last, first, shift_mm, turn_deg = (float(number) for number in found.groups())
    assert last < int(FIRST) <= first  # some collections do not have the sensor
    assert shift_mm == pytest.approx(1e3 * SHIFT_M, rel=0.3)
    assert np.radians(turn_deg) == pytest.approx(TURN_RAD, rel=0.3)
    assert "-csf" in result.message


def test_the_anchored_sensor_is_named_if_it_was_moved(cell):
    anchored = cell.dataset.config.anchored_sensor
    result = calibrate(knocked(cell, anchored, turn_rad=0.002, shift_m=0.003))
    assert f"{anchored} was moved between" in result.message


def test_a_fixed_board_that_was_moved_is_named(monkeypatch):
    scene, place = scenes.hand_eye(0, collections=20), scenes._before
    aside = se3.transform(np.eye(3), np.array([0.004, 0.003, 0.0]))
    monkeypatch.setattr(scenes, "_before", lambda *args, **words: place(*args, **words) @ aside)
    other = scenes.hand_eye(0, collections=20).dataset
    later = {(key, "rgb_1"): Origin(other, key) for key in list(other.collections)[12:]}
    result = calibrate(with_detections_from(scene.dataset, later))
    assert result.status == "inconsistent"
    # The base of the arm before the board may have been moved the other way: nothing differs.
    assert re.match(
        r"board pattern_1 or base '\w+' was moved between collections 011 and 012", result.message
    )
    assert "by 4.9 mm" in result.message  # 5 in truth


def with_base_moved(dataset, edge, first, by):
    """Return the dataset in which the base of an arm was moved before `first`, unknown to it."""
    later = [key for key in dataset.collections if key >= first]
    # The dataset believes the base where it was; what follows it is elsewhere by the same.
    moved = {key: {edge: by @ dataset.collections[key].transforms[edge]} for key in later}
    there = dataset.with_transforms(moved)
    without = {key: replace(c, joints={}) for key, c in there.collections.items()}
    return replace(there, collections=without)


MOVED_BASE = se3.from_rpy(np.array([0.004, 0.003, 0.0]), np.array([0.0, 0.0, 0.002]))


@pytest.mark.parametrize(
    "make, other",
    [
        (arm.camera_on_arm, "board pattern_1 or rgb_1"),
        (arm.board_on_arm, "rgb_1 or board pattern_1"),
    ],
    ids=["camera", "board"],
)
def test_before_one_arm_the_base_may_have_been_moved_as_well(make, other):
    scene = make(0, errors={}, collections=20)
    edge = scene.dataset.joint("shoulder_pan").edge
    result = calibrate(with_base_moved(scene.dataset, edge, "010", MOVED_BASE))
    assert result.message.startswith(f"{other} or base 'arm_base' was moved between")


def test_before_two_cameras_it_is_the_base_alone():
    dataset = scenes.board_on_arm(0, sensors=2, collections=20).dataset
    (edge,) = {step.edge for step in dataset.graph.chain("rig_base", "flange")}
    result = calibrate(with_base_moved(dataset, edge, "010", MOVED_BASE))
    said = (
        "base 'rig_base' was moved between collections 009 and 011, by 4.8 mm and 0.11 deg: fasten"
    )
    assert result.message.startswith(said)  # 5 mm and 0.115 deg in truth
    assert "or what /tf says of the parts that move in it jumped" in result.message


@pytest.mark.parametrize("sensor", ["rgb_2", pytest.param("depth_1", marks=pytest.mark.long)])
def test_a_sensor_that_shakes_did_not_stand_still(cell, sensor):
    rng, moves = np.random.default_rng(1), {}
    eye = cell_rig(SEED).pose(cell.dataset.sensors[sensor].frame)[:3, 3]
    for key in cell.dataset.collections:
        turn, shift = np.radians(0.3) * rng.normal(size=3), 0.009 * rng.normal(size=3)
        moves[key, sensor] = move_about(eye, turn, shift)
    result = calibrate(with_moved_board(cell, cell_rig(SEED), moves, rng))
    assert result.status == "inconsistent"
    assert result.message.startswith(f"{sensor} did not stand still")


def creeping(scene, sensor, turn_rad, shift_m):
    """Return the cell in which a sensor turned and went so far from the first to the last one."""
    rng = np.random.default_rng(5)
    eye = cell_rig(SEED).pose(scene.dataset.sensors[sensor].frame)[:3, 3]
    axis, way = se3.random_direction(rng), se3.random_direction(rng)
    keys, moves = list(scene.dataset.collections), {}
    for share, key in zip(np.linspace(-0.5, 0.5, len(keys)), keys):
        there = move_about(eye, share * turn_rad * axis, share * shift_m * way)
        moves[key, sensor] = se3.inverse(there)
    return with_moved_board(scene, cell_rig(SEED), moves, rng)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "sensor, shift_m, turn_deg", [("rgb_2", 0.003, 0.1), ("depth_1", 0.012, 0.4)]
)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_sensor_that_creeps_is_named_with_how_far(cell, sensor, shift_m, turn_deg, solver):
    moved = creeping(cell, sensor, np.radians(turn_deg), shift_m)
    result = calibrate(moved, CalibrationOptions(solver_name=solver))
    assert result.status == "inconsistent" and not result.checks
    told = re.match(
        rf"{sensor} crept between collections \d+ and \d+, by (.*) mm and (.*) deg little by ",
        result.message,
    )
    assert float(told.group(1)) == pytest.approx(1e3 * shift_m, rel=0.3)
    assert float(told.group(2)) == pytest.approx(turn_deg, rel=0.3)


def boards_along(scene, sensor, along):
    """Return the scene whose collections follow in the order of the board's place in a sensor."""
    frame = cell_rig(SEED).pose(scene.dataset.sensors[sensor].frame)
    places = {
        key: se3.apply(se3.inverse(frame), pose[None, :3, 3])[0]
        for (_, key), pose in scene.truth.boards.items()
    }
    keys = sorted(scene.dataset.collections, key=lambda key: along(places[key]))
    ordered = {key: scene.dataset.collections[key] for key in keys}
    return replace(scene, dataset=replace(scene.dataset, collections=ordered))


@pytest.mark.parametrize(
    "along, words",
    [
        (np.linalg.norm, "nearer or farther one after the other"),
        (lambda place: place[0] / place[2], "from one side to the other"),
        (None, None),
    ],
    ids=["near to far", "left to right", "mixed"],
)
def test_a_creep_among_boards_that_came_in_order_may_be_an_error_of_their_places(
    cell, along, words
):
    """ACFR's real pictures of boards from near to far: a range sensor "crept", by 11 mm."""
    scene = cell if along is None else boards_along(cell, "rgb_2", along)
    message = calibrate(creeping(scene, "rgb_2", np.radians(0.3), 0.009)).message
    assert message.startswith("rgb_2 crept between collections")
    assert ("it may be an error of" in message) == (words is not None)
    assert words is None or f"since its boards came {words}" in message


def test_a_long_range_is_no_move(cell):
    result = calibrate(with_long_ranges(cell.dataset, "lidar_1", 0.03))
    assert result.message.startswith("lidar_1 reads")


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in range(1, 25))]
)
@pytest.mark.parametrize("realism", [PLAIN, SLIGHT], ids=["plain", "slight"])
def test_what_stood_still_is_not_named(seed, realism):
    scene = scenes.random_scene(seed, collections=16, realism=realism, disturbance=DISTURBED)
    message = calibrate(scene.dataset).message
    assert "was moved" not in message and "crept" not in message


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in range(1, 10))]
)
def test_boards_that_come_in_the_order_of_their_distance_are_no_creep(seed):
    scene = scenes.random_scene(seed, collections=16, realism=SLIGHT, disturbance=DISTURBED)
    boards, dataset = scene.truth.boards, scene.dataset
    away = {key: np.linalg.norm(pose[:3, 3]) for (_, key), pose in boards.items()}
    ordered = {key: dataset.collections[key] for key in sorted(dataset.collections, key=away.get)}
    message = calibrate(replace(dataset, collections=ordered)).message
    assert "was moved" not in message and "crept" not in message


def test_few_collections_tell_nothing(cell):
    few = knocked(cell, "lidar_1", first="003").selected(collections=["000", "001", "002", "003"])
    assert "was moved" not in calibrate(few).message


# ---- sensors that no calibrated edge puts where they are

ONE_EDGE = (
    r"(rgb_2 and depth_1|depth_1 and rgb_2), which have one edge, do not stand to one another"
)


@pytest.fixture(scope="module")
def device():
    """rgb_1, anchored; rgb_2 and depth_1 in one device, whose edge is calibrated."""
    return scenes.shared_edge(0, collections=20, disturbance=DISTURBED)


def told_wrong(scene, shift_m, turn_rad=0.0, collections=None):
    """Return the device whose inner transform, from rgb_2 to depth_1, is wrong."""
    axis = np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0)
    move = se3.transform(se3.rotation_from_rotation_vector(turn_rad * axis), shift_m * axis)
    return with_displaced_frame(scene.dataset, "depth_1_frame", move, collections)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
def test_sensors_of_one_edge_that_stand_otherwise_to_one_another_are_named(device, solver):
    result = calibrate(told_wrong(device, 0.010), CalibrationOptions(solver_name=solver))
    assert result.status == "inconsistent" and not result.checks
    told = re.match(rf"{ONE_EDGE} .*, but (.*) mm and (.*) deg off: ", result.message)
    assert float(told.group(2)) == pytest.approx(10.0, rel=0.3)
    assert float(told.group(3)) < 0.1


def test_of_a_turn_the_angle_is_told(device):
    told = re.match(
        rf"{ONE_EDGE} .* mm and (.*) deg off: ",
        calibrate(told_wrong(device, 0.0, np.radians(0.3))).message,
    )
    assert float(told.group(2)) == pytest.approx(0.3, rel=0.3)


def test_where_an_image_centre_tells_as_much_both_are_named(device):
    result = calibrate(told_wrong(device, 0.010, np.radians(0.5)))
    assert result.status == "inconsistent" and result.checks
    assert re.match(rf"the image centre of rgb_2 .*; or {ONE_EDGE} ", result.message)


def test_also_where_their_edge_is_held(device):
    config = replace(device.dataset.config, anchored_sensor="rgb_2")
    result = calibrate(
        told_wrong(replace(device, dataset=replace(device.dataset, config=config)), 0.01)
    )
    assert re.match(ONE_EDGE, result.message)


def test_where_linear_steps_do_not_reach_the_transform_between_them_is_the_first_to_look_at(device):
    result = calibrate(told_wrong(device, 0.020, np.radians(1.0)))
    assert result.status == "inconsistent"
    other = {"rgb_2": "depth_1", "depth_1": "rgb_2"}
    for one in result.misfits:
        if one.sensor in other:
            assert one.likely[0] == f"its transform to {other[one.sensor]} (they hang on one edge)"
    assert {one.sensor for one in result.misfits} & other.keys()


def test_if_one_of_them_is_knocked_that_is_a_knock(device):
    later = list(device.dataset.collections)[10:]
    result = calibrate(told_wrong(device, 0.006, collections=later))
    # collection 009 does not have it
    assert result.message.startswith("depth_1 was moved between collections 008 and 010, by 5.4 mm")


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.long) for s in range(1, 25))]
)
@pytest.mark.parametrize("realism", [PLAIN, SLIGHT], ids=["plain", "slight"])
def test_where_they_stand_as_described_nothing_is_named(seed, realism):
    scene = scenes.shared_edge(seed, collections=16, realism=realism, disturbance=DISTURBED)
    message = calibrate(scene.dataset).message
    assert "one edge" not in message and "was moved" not in message
