"""2D LiDARs beside the simulated cell: what they see, and the way from a bag to their poses."""

import itertools
import json
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from roslaunch.config import load_config_default

from atom_calibration.nodes.collecting import collect_from_bag
from atom_core import cli
from atom_core.geometry import se3
from atom_core.io.config_yaml import read_config
from atom_core.io.dataset_json import read_dataset
from atom_core.io.paths import package_folder
from atom_core.io.truth_json import read_truth
from atom_core.model.labels import DetectionKey
from atom_core.model.sensor import LIDAR2D
from atom_examples.cell_simulator import recorder
from atom_examples.cell_simulator.devices import Packing, ScannerDevice, devices_of
from atom_examples.cell_simulator.planner import LEAST_CUT_M, cut_length_m, plan_stops
from atom_examples.cell_simulator.recorder import Recording, record
from atom_examples.cell_simulator.world import EXACT, World

CONFIG = package_folder("atom_examples") / "collab_cell" / "config" / "config_with_scanners.yml"
NAMES = ["scanner_1", "scanner_2"]


@pytest.fixture(scope="module")
def world_with_scanners():
    """Seed 0 with its 2D LiDARs."""
    made = World(0, scanners=True)
    yield made
    made.scene.close()


@pytest.fixture(scope="module")
def stops(world_with_scanners):
    """Two stops in it."""
    return plan_stops(world_with_scanners, "train", 2)


@pytest.fixture(scope="module")
def cell(world_with_scanners, stops):
    """The same, the board at the first stop."""
    world_with_scanners.scene.place_board(stops[0].world_T_pattern)
    world_with_scanners.scene.place_person(stops[0].person)
    return world_with_scanners


@pytest.fixture(params=NAMES)
def scanner(cell, request):
    return next(d for d in devices_of(cell) if d.settings.name == request.param)


def test_they_are_there_only_if_asked_for(world, cell):
    assert set(cell.rig.sensors) - set(world.rig.sensors) == set(NAMES)
    assert not any(isinstance(device, ScannerDevice) for device in devices_of(world))
    links = [w.description(EXACT).robot.links for w in (world, cell)]
    assert "scanner_1" in links[1] and "scanner_1" not in links[0]


def test_the_committed_noise_is_that_of_the_acceptance_runs(scanner):
    assert scanner.settings.noise == (0.010, 0.02, 0.0015)
    assert scanner.settings.model.angle_increment == np.deg2rad(0.25)


def test_description_configuration_and_rig_agree(cell, scanner):
    name = scanner.settings.name
    entry, sensor = read_config(CONFIG).sensors[name], cell.rig.sensors[name]
    assert (entry.link, entry.parent_link, entry.child_link) == (sensor.frame, *sensor.edge)
    assert (entry.topic_name, entry.modality) == (sensor.topic, LIDAR2D)
    np.testing.assert_allclose(cell.scene.pose(name), cell.rig.pose(name), atol=1e-9)


def test_a_scan_has_a_range_for_each_beam_and_meets_the_board(cell, scanner):
    seen = scanner.capture(cell.scene, None)
    message = scanner.pack(seen, None, Packing())
    assert len(message.ranges) == 1440
    ranges = np.array(message.ranges)
    assert np.isinf(np.delete(ranges, seen.beam)).all() and np.isfinite(ranges[seen.beam]).all()
    beams = scanner.on_plate(seen)
    angles = message.angle_min + message.angle_increment * beams
    points = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(beams))])
    lidar_T_pattern = se3.inverse(cell.scene.pose(scanner.settings.frame))
    lidar_T_pattern = lidar_T_pattern @ cell.scene.world_T_pattern
    on_board = se3.apply(se3.inverse(lidar_T_pattern), points * ranges[beams, None])
    off_m = on_board[:, 2]  # the plate is 1 mm thick
    assert np.all((off_m > -1e-4) & (off_m < 1.1e-3))


def test_noise_is_that_of_the_settings(cell, scanner):
    exact = scanner.sensor.exact(cell.scene)
    seen = scanner.capture(cell.scene, np.random.default_rng(3))
    whole = exact.beam[exact.other == exact.range]
    both, mine, theirs = np.intersect1d(seen.beam, whole, return_indices=True)
    measured = np.linalg.norm(seen.points[mine].astype(float), axis=1)
    true = exact.range[exact.other == exact.range][theirs]
    assert np.std(measured - true) == pytest.approx(0.010, rel=0.1)
    assert len(seen.beam) / len(exact.beam) == pytest.approx(0.98, abs=0.015)


def test_one_of_them_sees_the_board_at_each_stop(cell, stops):
    for stop in stops:
        cell.scene.place_board(stop.world_T_pattern)
        cell.scene.place_person(stop.person)
        assert max(cut_length_m(cell, name) for name in NAMES) >= LEAST_CUT_M


# ---------------------------------------------------------------- from a bag to their poses


def recorded(folder, seed, collections):
    """Return the dataset of a recording with automatic seeds, its rig, and its true labels."""
    bag = folder / "train.bag"
    made = World(seed, scanners=True)
    try:
        record(made, Recording(collections=collections, compressed=True), bag, progress=False)
    finally:
        made.scene.close()
    words = ["--config", str(CONFIG), "--bag", str(bag), "--output", str(folder / "train")]
    assert collect_from_bag.main(words) in (0, 1)
    dataset = read_dataset(folder / "train" / "dataset.json")
    return dataset, made.rig, dict(np.load(bag.with_suffix(".labels.npz")))


def cuts(dataset, rig, labels, boards):
    """Yield for each scan of a collection its length on the board [m], true beams and label."""
    for collection, name in itertools.product(dataset.collections, NAMES):
        entry = dataset.document["collections"][collection]["data"].get(name)
        if entry is None:
            continue
        stamp = entry["header"]["stamp"]
        stamp_s = stamp["secs"] + 1e-9 * stamp["nsecs"]
        for stop, world_T_pattern in boards.items():
            stamps = labels[f"{stop}/{name}/stamps"]
            at = np.flatnonzero(np.abs(stamps - stamp_s) < 1e-3)
            if len(at):
                beams = labels[f"{stop}/{name}/returns_{at[0]}"]
                points = dataset.data.read(collection, name).points[beams]
                in_pattern = se3.inverse(world_T_pattern) @ rig.pose(name)
                key = DetectionKey(collection, name, "pattern_1")
                yield length(se3.apply(in_pattern, points)), beams, dataset.label(key), key


def length(points):
    """Return how long a cut is, of points of the pattern; mixed returns are off the board."""
    on_board = points[np.abs(points[:, 2]) < 0.05, :2]
    if len(on_board) < 2:
        return 0.0
    centred = on_board - on_board.mean(axis=0)
    return float(np.ptp(centred @ np.linalg.svd(centred, full_matrices=False)[2][0]))


class Error(NamedTuple):
    """How far a pose is from the truth, and its predicted sigma, the largest of three axes."""

    translation_m: float
    rotation_deg: float
    sigma_m: float


def errors(folder):
    """Calibrate; return the error of each scanner's pose."""
    words = ["calibrate", "--dataset", folder / "train" / "dataset.json"]
    words += ["--output", folder / "calibration", "--truth", folder / "train.truth.json"]
    assert cli.main([str(word) for word in words]) == 0
    document = json.loads((folder / "calibration" / "calibration.json").read_text("utf-8"))
    found = {}
    for name in NAMES:
        truth = document["ground_truth"][name]
        edge = document["edges"][f"{name}_post-{name}_base_link"]
        sigma_m = max(edge["sigma_translation_m"])
        found[name] = Error(truth["translation_error_m"], truth["rotation_error_deg"], sigma_m)
    return found


def assess(folder, seed, collections):
    """Return the share of the boards found, how many there are, and false labels."""
    dataset, rig, labels = recorded(folder, seed, collections)
    truth = read_truth(folder / "train.truth.json")
    boards = {stop: pose for (_, stop), pose in truth.boards.items()}
    expected = found = false = 0
    for length_m, beams, label, key in cuts(dataset, rig, labels, boards):
        detected = label is not None and label.detected
        true = np.isin(label.indices, beams).mean() if detected else 0.0
        # Where it is seen from behind, returns of the clamp before it cannot be told from it.
        false += detected and true < 0.6
        expected += length_m >= LEAST_CUT_M
        found += length_m >= LEAST_CUT_M and detected
        print(key.collection, key.sensor, f"{length_m:.2f} m", f"{true:.2f}" if detected else "-")
    return SimpleNamespace(found=found / expected, expected=expected, false=false)


@pytest.mark.long
@pytest.mark.slow
def test_boards_are_found_in_a_bag_with_automatic_seeds(tmp_path, stops, monkeypatch):
    monkeypatch.setattr(recorder, "plan_stops", lambda *_: stops)  # those of the very same call
    result = assess(tmp_path, seed=0, collections=2)
    assert result.expected >= 2 and result.found == 1.0 and result.false == 0


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_whole_bag_with_automatic_seeds_gives_exact_poses(tmp_path, seed):
    result = assess(tmp_path, seed, collections=23)
    print(result)
    assert result.expected >= 23 and result.found >= 0.9 and result.false == 0
    found = errors(tmp_path).values()
    assert np.mean([error.rotation_deg for error in found]) <= 0.2
    for error in found:
        assert error.translation_m <= 0.006 and error.translation_m <= 3.5 * error.sigma_m


@pytest.mark.parametrize("scanners", ["true", "false"])
def test_the_launch_file_of_the_simulation_starts_with_and_without_them(scanners):
    path = package_folder("atom_examples") / "launch" / "collab_cell_simulation.launch"
    words = [f"scanners:={scanners}", "rviz:=false"]
    launch = load_config_default([(str(path), words)], None, verbose=False)
    (simulator,) = launch.nodes
    assert ("--scanners" in simulator.args.split()) is (scanners == "true")
