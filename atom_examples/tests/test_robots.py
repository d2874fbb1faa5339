"""The example robots: their files fit together, and what is recorded of them can be calibrated."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from atom_core import cli
from atom_core.evaluation.edge_errors import joint_errors
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_json import read_truth
from atom_examples import robot_demo
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.robot_simulator import main as program
from atom_examples.robot_simulator.motion import RobotMotion
from atom_examples.robot_simulator.robots import Robot, robot_named, robot_names
from atom_examples.robot_simulator.stops import draw_stops
from atom_examples.robot_simulator.world import RobotWorld

NAMES = robot_names()
CAMERA, RANGE = (0.001, 0.05), (0.001, 0.05)  # m, deg
AT_WORK = "collab_cell_at_work"
LIMITS = {AT_WORK: ((0.0005, 0.02), (0.0015, 0.1))}  # LiDARs hang 2 m above the boards
JOINT_LIMIT_DEG, JOINT_LIMIT_M = 0.02, 0.001
HELD = dict.fromkeys(("mrjbot", "riwmpbot"), ("shoulder_pan_joint", "wrist_3_joint"))


@pytest.fixture(scope="module")
def worlds():
    """Return a function: the robot of a name, seed 0, built once."""
    known = {}

    def world(name):
        if name not in known:
            known[name] = RobotWorld(robot_named(name), 0)
        return known[name]

    yield world
    for made in known.values():
        made.scene.close()


def test_atoms_robots_are_there():
    expected = {"rrbot", "rlbot", "rdbot", "mrbot", "rihbot", "rihmpbot", "riwbot", "riwmpbot"}
    assert expected | {"mrjbot", "spjbot", "softbot", AT_WORK} == set(NAMES)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", NAMES)
def test_each_free_edge_is_told_wrong_by_a_tenth_and_an_anchored_one_right(worlds, name):
    world = worlds(name)
    true, told = world.true_edges, world.told_edges("disturbed")
    anchored = world.config.anchored_sensor
    for edge, pose in true.items():
        move = np.linalg.norm(told[edge][:3, 3] - pose[:3, 3])
        turn = se3.rotation_angle(pose[:3, :3].T @ told[edge][:3, :3])
        held = anchored is not None and edge == world.config.sensors[anchored].edge
        assert (move, turn) == pytest.approx((0.0, 0.0) if held else (0.1, 0.1), abs=1e-9)
    assert all(np.array_equal(told, true[e]) for e, told in world.told_edges("exact").items())


@pytest.mark.parametrize("name", NAMES)
def test_what_is_reported_and_the_bias_make_the_true_position(worlds, name):
    world = worlds(name)
    posture = dict(world.scenario.joints.postures[0])
    reported = world.reported(posture)
    for joint, position in posture.items():
        assert reported[joint] + world.biases.get(joint, 0.0) == pytest.approx(position, abs=1e-12)
    largest = world.scenario.joints.position_bias
    assert all(0.5 * largest[j] <= abs(b) <= largest[j] for j, b in world.biases.items())
    assert set(world.biases) == set(world.config.joints)


def test_boards_on_moving_links_go_along(worlds):
    world = worlds("riwmpbot")
    first, second = draw_stops(world, "train", 2)
    seen = []
    for stop in (first, second):
        world.place(stop.positions, stop.boards)
        seen.append({name: world.parent_T_pattern(name) for name in world.patterns})
        assert np.allclose(world.scene.pose("flange"), world.scene.pose("tool0") @ _tool(world))
    for name, board in world.scenario.boards.items():
        assert np.allclose(seen[0][name], board.parent_T_pattern, atol=1e-9)
        assert np.allclose(seen[1][name], board.parent_T_pattern, atol=1e-9)
    assert not np.allclose(first.boards["hand_pattern"], second.boards["hand_pattern"], atol=0.01)


def _tool(world):
    edges = world.description.transforms({})
    return se3.inverse(next(pose for edge, pose in edges.items() if edge.child == "tool0"))


def test_a_motion_stands_at_its_stops_and_moves_at_a_moderate_speed(worlds):
    world = worlds("rihbot")
    stops = draw_stops(world, "train", 3)
    motion = RobotMotion(world, stops, 0.5)
    states = [motion.state(tick) for tick in range(motion.ticks)]
    for number, stop in enumerate(stops):
        first, after = motion.interval(number)
        assert after - first == 5
        for state in states[first:after]:
            assert state.stop == number and state.positions == stop.positions
    names = list(stops[0].positions)
    angles = np.array([[state.positions[name] for name in names] for state in states])
    assert np.abs(np.diff(angles, axis=0)).max() < 0.1 * 2.0  # rad in a tenth of a second
    assert motion.interval(2)[1] == motion.ticks


def test_stops_follow_from_the_seed_and_the_recording(worlds):
    world = worlds("rrbot")
    one, same = draw_stops(world, "train", 2), draw_stops(world, "train", 2)
    other = draw_stops(world, "test", 2)
    assert np.array_equal(one[1].boards["pattern_1"], same[1].boards["pattern_1"])
    assert not np.allclose(one[1].boards["pattern_1"], other[1].boards["pattern_1"])


# ---- from a bag to an answer


def small_copy(name, folder, factor):
    """Copy a robot with images smaller by a factor; everything else stays."""
    robot = robot_named(name)
    copy = Robot(name, folder / name)
    shutil.copytree(robot.folder, copy.folder)
    text = copy.sensors.read_text()

    def smaller(match):
        return f"{match[1]}: {round(int(match[2]) / factor)}"

    def nearer(match):
        f, cx, cy = (float(v) for v in (match[1], match[2], match[3]))
        x, y = ((c + 0.5) / factor - 0.5 for c in (cx, cy))
        return f"K: [{f / factor}, 0.0, {x}, 0.0, {f / factor}, {y}, 0.0, 0.0, 1.0]"

    text = re.sub(r"(width|height): (\d+)", smaller, text)
    text = re.sub(r"K: \[([\d.]+), 0.0, ([\d.]+), 0.0, [\d.]+, ([\d.]+), .*\]", nearer, text)
    copy.sensors.write_text(text)
    return copy


def calibrated(robot, folder, stops=None):
    """Record, collect and calibrate; return the folder of the results."""
    robot_demo.simulate(robot, folder, "train", 0, stops)
    robot_demo.collect(robot, folder, "train")
    more = RobotWorld(robot, 0).scenario.calibrate
    dataset, truth = folder / "train" / "dataset.json", folder / "train.truth.json"
    words = ["--dataset", str(dataset), "--output", str(folder / "out"), "--truth", str(truth)]
    assert cli.main(["calibrate", *words, *more]) == 0
    return folder / "out"


def check_errors(name, results, truth_path):
    """Hold sensors and joints against the truth."""
    document = json.loads((results / "calibration.json").read_text())
    of_cameras, of_range_sensors = LIMITS.get(name, (CAMERA, RANGE))
    for sensor, entry in document["sensors"].items():
        error = document["ground_truth"][sensor]
        metres, degrees = of_cameras if entry["modality"] == "rgb" else of_range_sensors
        assert error["translation_error_m"] <= metres, sensor
        assert error["rotation_error_deg"] <= degrees, sensor
    solved = read_dataset(results / "atom_calibration.json")
    for error in joint_errors(solved, solved, read_truth(truth_path)):
        limit = JOINT_LIMIT_M if error.unit == "m" else np.radians(JOINT_LIMIT_DEG)
        entry = document["joints"][error.joint][error.parameter]
        assert entry["held_by_prior"] == (error.joint in HELD.get(name, ()))
        limit = 3.0 * entry["prior_sigma"] if entry["held_by_prior"] else limit
        assert abs(error.after) <= limit, error.joint


def test_a_camera_in_a_hand_is_found_with_small_images_at_six_stops(tmp_path):
    robot = small_copy("rihbot", tmp_path, 2.5)
    check_errors("rihbot", calibrated(robot, tmp_path, 6), tmp_path / "train.truth.json")


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_robot_is_calibrated_from_its_recording(tmp_path, name):
    check_errors(name, calibrated(robot_named(name), tmp_path), tmp_path / "train.truth.json")


def test_the_conclusion_tells_the_largest_errors(tmp_path):
    def entry(metres, degrees):
        return {"translation_error_m": metres, "rotation_error_deg": degrees}

    errors = {"mean": entry(0.002, 0.2), "a": entry(0.001, 0.3), "b": entry(0.003, 0.1)}
    joints = [
        {"unit": "rad", "before": -0.1, "after": np.radians(-0.02)},
        {"unit": "rad", "before": 0.05, "after": np.radians(0.01)},
        {"unit": "m", "before": 0.01, "after": -0.0005},
        {"joint": "j", "parameter": "b", "unit": "rad", "before": 0.1, "after": np.radians(1.0)},
    ]
    found = {"j": {"b": {"held_by_prior": True}}}
    for name, document in (
        ("evaluation", {"ground_truth": errors}),
        ("calibration", {"joints": found, "truth_comparison": {"joints": joints}}),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.json").write_text(json.dumps(document))
    sensors, turning, held, sliding, _ = robot_demo.conclusion(tmp_path)
    assert "at most 3.000 mm and 0.3000 deg" in sensors
    assert "at most 0.0200 deg off" in turning and "at the start 5.73 deg" in turning
    assert held.startswith("joints that a prior holds: at most 1.0000 deg")
    assert "at most 0.5000 mm off" in sliding and "at the start 10.00 mm" in sliding
    (tmp_path / "calibration" / "calibration.json").write_text('{"truth_comparison": {}}')
    assert (
        robot_demo.conclusion(tmp_path)[0] == sensors and len(robot_demo.conclusion(tmp_path)) == 2
    )


# ---- refusals


def test_an_unknown_robot_is_refused_with_those_there_are(tmp_path, capsys):
    assert program.main(["--robot", "robbot", "--bag", str(tmp_path / "a.bag")]) == 2
    said = capsys.readouterr().err
    assert "there is no robot 'robbot'" in said and "rihbot" in said


@pytest.mark.parametrize(
    "file, old, new, says",
    [
        ("scenario.yaml", "elbow_joint: ", "elbo_joint: ", "joint 'elbo_joint' is in no posture"),
        ("scenario.yaml", "pattern_1:", "pattern_2:", "boards of scenario.yaml are not those"),
        ("scenario.yaml", "seen:", "sean:", "'sean' is unknown"),
        ("scenario.yaml", "part: 0.7", "by: {a: [b]}", "'a' is no sensor and no board"),
        ("scenario.yaml", "train: 14", "train: none", "'train' is malformed"),
        ("sensors.yaml", "rgb_hand:", "rgb:", "sensors of sensors.yaml are not those"),
        ("sensors.yaml", "topic: /", "topic: /x/", "are not the link and topic_name"),
        ("config.yml", "fixed: true", "fixed: false", "config.yml says fixed: false"),
        ("config.yml", '"flange"', '"tool0"', "no fixed joint from 'tool0' to 'rgb_hand_link'"),
    ],
)
def test_files_that_contradict_each_other_are_refused(tmp_path, file, old, new, says):
    copy = Robot("rihbot", tmp_path / "rihbot")
    shutil.copytree(robot_named("rihbot").folder, copy.folder)
    path = copy.folder / "config" / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SimulatorError, match=re.escape(says)) as refused:
        RobotWorld(copy, 0)
    assert "\n" not in str(refused.value)


def test_a_scenario_in_which_nothing_can_be_seen_is_refused(worlds, monkeypatch):
    world = worlds("rrbot")
    seen = replace(world.scenario.seen, detections=3)
    monkeypatch.setattr(world, "scenario", replace(world.scenario, seen=seen))
    monkeypatch.setattr("atom_examples.robot_simulator.stops._TRIES", 20)
    with pytest.raises(SimulatorError, match="in 20 draws no stop shows 3 boards"):
        draw_stops(world, "train", 1)


def test_the_scenario_in_the_readme_loads_with_all_its_keys():
    readme = (Path(__file__).resolve().parents[1] / "README.md").read_text("utf-8")
    block = readme[readme.index("    room: {low:") : readme.index("## The simulated cell")]
    document = yaml.safe_load(block)
    assert set(document) == {"room", "boards", "absent", "joints", "stops", "seen", "calibrate"}
    assert set(document["joints"]) == {"postures", "spread", "position_bias"}
