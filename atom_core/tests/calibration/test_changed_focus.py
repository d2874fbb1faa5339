"""A camera that focused, or zoomed, while the collections were made."""

import re
from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.refine import changed_focus
from atom_core.geometry import se3
from atom_core.model.labels import RgbLabel
from atom_core.solvers.choice import SOLVERS
from atom_core.solvers.shared_equations import inverse
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.cell import cell_rig
from atom_core.synthetic.mistakes import with_moved_sensor

DISTURBED = (0.05, 0.05)
CHANGED = r"the focal length of (\w+) changed between collections (\d+) and (\d+), by (\S+) %"
TOLD = "of rgb_[0-9] (changed|crept|differs)"


@pytest.fixture(scope="module")
def cell():
    return paper_cell(0, disturbance=DISTURBED)


def focused(dataset, sensor, changes):
    """Return the dataset in which a camera's focal length is longer by these parts (g,)."""
    camera, collections = dataset.sensors[sensor].camera, dict(dataset.collections)
    centre = camera.K[:2, 2]
    for change, (key, collection) in zip(changes, dataset.collections.items()):
        labels = dict(collection.labels)
        for place, label in collection.labels.items():
            if place[0] == sensor and isinstance(label, RgbLabel):
                pixels = centre + (1.0 + change) * (label.pixels - centre)
                labels[place] = RgbLabel(label.ids, pixels)
        collections[key] = replace(collection, labels=labels)
    return replace(dataset, collections=collections)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_camera_that_zoomed_once_is_named_with_when_and_how_far(cell, solver):
    later = np.arange(len(cell.dataset.collections)) >= 11
    changed = focused(cell.dataset, "rgb_2", 0.01 * later)
    result = calibrate(changed, CalibrationOptions(solver_name=solver))
    assert result.status == "inconsistent" and not result.checks
    name, last, first, part = re.match(CHANGED, result.message).groups()
    assert name == "rgb_2" and int(last) < 11 <= int(first)
    assert float(part) == pytest.approx(1.0, rel=0.2)
    assert "moved" not in result.message and "-csf" in result.message


def test_one_whose_focus_goes_on_changing_creeps(cell):
    share = np.linspace(0.0, 1.0, len(cell.dataset.collections))
    result = calibrate(focused(cell.dataset, "rgb_3", 0.01 * share))
    assert result.message.startswith("the focal length of rgb_3 crept between collections 000 and")
    assert result.status == "inconsistent"


@pytest.mark.parametrize("scene", ["cell", pytest.param("hand", marks=pytest.mark.long)])
def test_one_that_focuses_anew_each_time_differs(cell, scene):
    made = cell if scene == "cell" else scenes.hand_eye(0, collections=20, disturbance=DISTURBED)
    sensor = "rgb_2" if scene == "cell" else "rgb_1"
    each = np.random.default_rng(1).normal(size=len(made.dataset.collections))
    result = calibrate(focused(made.dataset, sensor, 0.005 * each))
    assert result.status == "inconsistent"
    told = rf"the focal length of {sensor} differs from collection to collection, by (\S+) %"
    assert 0.1 < float(re.match(told, result.message).group(1)) < 0.6


def test_where_boards_are_alike_a_move_along_the_axis_may_be_it(cell):
    rig = cell_rig(0)
    world_T_camera = rig.pose(cell.dataset.sensors["rgb_2"].frame)
    ahead = se3.transform(np.eye(3), 0.02 * world_T_camera[:3, 2])
    rng = np.random.default_rng(3)
    result = calibrate(with_moved_sensor(cell, rig, "rgb_2", "011", ahead, rng))
    assert "(or it was moved by 19 mm, these data do not tell): fasten it, " in result.message


@pytest.mark.parametrize(
    "label", ["k1", *(pytest.param(x, marks=pytest.mark.long) for x in ("centre", "focal"))]
)
def test_intrinsics_that_are_wrong_all_the_time_are_no_change(cell, label):
    camera = cell.dataset.sensors["rgb_2"].camera
    K, D = camera.K.copy(), np.array(camera.D, dtype=float)
    if label == "k1":
        D[0] += 0.02
    else:
        K += np.array([[8.0, 0, 0], [0, 8.0, 0], [0, 0, 0]]) * (label == "focal")
        K[0, 2] += 8.0 * (label == "centre")
    wrong = replace(cell.dataset.sensors["rgb_2"], camera=replace(camera, K=K, D=D))
    sensors = {**cell.dataset.sensors, "rgb_2": wrong}
    result = calibrate(replace(cell.dataset, sensors=sensors))
    assert "rgb_2" in result.message and result.status == "inconsistent"
    assert not re.search(TOLD, result.message)


@pytest.mark.parametrize("cameras", [3, 6])
def test_shared_numbers_are_inverted_once_however_many_cameras(monkeypatch, cameras):
    inverted = []
    monkeypatch.setattr(changed_focus, "inverse", lambda m: inverted.append(1) or inverse(m))
    scene = scenes.random_scene(2, rgb=cameras, depth=0, lidar3d=0, collections=12)
    calibrate(scene.dataset)
    assert len(inverted) == 1


@pytest.mark.parametrize("seen", [True, False])
def test_a_bordered_inverse_is_the_inverse_of_the_whole(seen):
    rows = np.random.default_rng(5).normal(size=(30, 7)) * np.logspace(-2, 3, 7)
    rows[:, 3] = 0.0  # what nothing sees
    rows[:, -1] *= seen
    whole = rows.T @ rows
    found = changed_focus.bordered(inverse(whole[:-1, :-1]), whole[:, -1])
    wanted = inverse(whole)
    scale = np.sqrt(np.diagonal(wanted))
    assert np.allclose(found / scale / scale[:, None], wanted / scale / scale[:, None], atol=1e-9)
