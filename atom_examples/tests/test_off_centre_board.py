"""A board whose print is not in its middle: simulated, labeled and calibrated as it is."""

from dataclasses import replace
from pathlib import Path

import cell_boards as boards
import numpy as np
import pytest
import yaml

from atom_core.calibration.calibrate import calibrate
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.base import labeler_for
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import Collection, Dataset
from atom_core.model.pattern import pattern_from_config
from atom_core.model.transforms import Edge
from atom_core.synthetic.memory import MemoryDataSource
from atom_examples.cell_simulator.world import World, cell_files

SIDES_M = {"left": 0.01, "right": 0.09, "top": 0.07, "bottom": 0.02}
SENSORS = ("rgb_3", "depth_1")
STANDS = [  # distance [m], tilt, roll [rad], direction
    (1.6, 0.5, 0.0, (-0.1, 0.0)),
    (1.8, -0.5, 0.4, (0.0, 0.05)),
    (1.5, 0.4, -0.5, (0.1, -0.05)),
    (2.0, -0.4, 1.2, (-0.05, 0.0)),
    (1.7, 0.3, 2.4, (0.05, 0.05)),
    (1.6, -0.3, -1.5, (0.0, -0.1)),
]
SHIFT_M = 0.03  # of the first guess


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """Return the cell with that board."""
    files = cell_files()
    document = yaml.safe_load(files.sensors.read_text(encoding="utf-8"))
    document["pattern"]["border_m"] = SIDES_M
    sensors = tmp_path_factory.mktemp("cell") / "sensors.yaml"
    sensors.write_text(yaml.safe_dump(document), encoding="utf-8")
    world = World(0, replace(files, sensors=sensors))
    world.scene.place_person(boards.AWAY)
    yield world
    world.scene.close()


@pytest.fixture(scope="module")
def dataset(cell):
    """Return what two sensors label of the board, the second one's first guess shifted."""
    scene, print_ = cell.scene, cell.settings.board
    true = {name: scene.pose(cell.rig.sensors[name].frame) for name in SENSORS}
    sensors = {
        n: replace(cell.rig.sensors[n], edge=Edge("world", cell.rig.sensors[n].frame))
        for n in SENSORS
    }
    pattern = pattern_from_config("board", print_)
    guess = {s.edge: true[n].copy() for n, s in sensors.items()}
    guess[sensors["depth_1"].edge][:3, 3] += SHIFT_M
    collections, data = {}, MemoryDataSource({"board": (pattern, print_)})
    rng = np.random.default_rng(0)
    for number, stand in enumerate(STANDS):
        scene.place_board(true["depth_1"] @ boards.before(*stand, pattern))
        pictures = {
            "rgb_3": cell.colours["rgb_3"].capture(scene, rng),
            "depth_1": cell.depths["depth_1"].capture(scene, rng),
        }
        labels = {}
        for name, sensor in sensors.items():
            found = labeler_for(sensor, pattern, print_).label(pictures[name])
            if found.detected:
                labels[(name, "board")] = found.label
        key = f"{number:03d}"
        data.add(key, "depth_1", pictures["depth_1"])
        collections[key] = Collection(key, labels, dict(guess))
    document = {
        "world_link": "world",
        "anchored_sensor": "rgb_3",
        "sensors": {
            n: {
                "link": s.frame,
                "parent_link": "world",
                "child_link": s.frame,
                "topic_name": s.topic,
                "modality": s.modality,
            }
            for n, s in sensors.items()
        },
        "calibration_patterns": {"board": print_.to_document()},
    }
    config = CalibrationConfig.from_document(document, "config")
    patterns = {"board": pattern}
    return Dataset(Path("cell"), config, sensors, patterns, collections, data=data), true


def test_the_plate_of_the_simulation_is_that_of_the_settings(cell):
    border, print_ = cell.scene.board.pattern.border, cell.settings.board
    assert print_.border == tuple(SIDES_M[side] for side in ("left", "right", "top", "bottom"))
    left_top = [-SIDES_M["left"], -SIDES_M["top"]]
    right_bottom = [12 * 0.06 + SIDES_M["right"], 9 * 0.06 + SIDES_M["bottom"]]
    np.testing.assert_allclose([border.x_min, border.y_min], left_top)
    np.testing.assert_allclose([border.x_max, border.y_max], right_bottom)


def test_from_pictures_to_the_calibration(dataset):
    given, true = dataset
    seen = [len(c.labels) for c in given.collections.values()]
    assert sum(count == 2 for count in seen) >= 5, seen
    result = calibrate(given)
    assert result.status == "converged", result.message
    found = result.dataset.first_value(given.sensors["depth_1"].edge)
    error = se3.inverse(true["depth_1"]) @ found
    assert np.linalg.norm(error[:3, 3]) < 0.003
    assert np.degrees(se3.rotation_angle(error[:3, :3])) < 0.1


def test_taken_as_centred_the_same_labels_put_the_camera_elsewhere(dataset):
    given, true = dataset
    pattern = given.patterns["board"]
    corners, half = pattern.corners_by_id, pattern.border.half_size
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    centred = replace(pattern, border=Rectangle(*(middle - half), *(middle + half)))
    result = calibrate(replace(given, patterns={"board": centred}))
    found = result.dataset.first_value(given.sensors["depth_1"].edge)
    wrong_m = np.linalg.norm((se3.inverse(true["depth_1"]) @ found)[:3, 3])
    assert result.status != "converged" or wrong_m > 0.01
