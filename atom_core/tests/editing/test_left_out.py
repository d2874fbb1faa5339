"""What a calibration would be without what a sensor saw in a collection."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.editing.left_out import LeftOut
from atom_core.errors import SelectionError
from atom_core.geometry import se3
from atom_core.model.dataset import board_edge
from atom_core.synthetic import faults, scenes

pytest.importorskip("atom_core._core", reason="the compiled module solves")


@pytest.fixture(scope="module")
def start():
    scene = scenes.random_scene(3, lidar3d=1, collections=6, disturbance=(0.02, 0.02))
    options = CalibrationOptions()
    return calibrate(scene.dataset, options), options


def poses(calibration):
    dataset = calibration.dataset
    return {edge: dataset.first_value(edge) for edge in (s.edge for s in dataset.sensors.values())}


def same(one, other, atol):
    mine, theirs = poses(one), poses(other)
    return all(np.allclose(mine[edge], theirs[edge], rtol=0.0, atol=atol) for edge in mine)


def test_it_is_the_calibration_of_a_dataset_without_that_label(start):
    first, options = start
    left = LeftOut(first, options)
    words = left.leave_out("lidar_1", "002")
    assert ("lidar_1", "002") in left.places
    assert words.startswith("lidar_1 in 002 is left out; ") and "moves most, by" in words
    labels = first.dataset.collections["002"].labels
    none = {key: None for key in labels if key[0] == "lidar_1"}
    expected = calibrate(first.dataset.with_labels("002", none), options)
    assert same(left.now, expected, 1e-7)
    assert (left.now.status, left.now.message) == (expected.status, expected.message)
    assert left.now is left.now, "judged once"
    assert not same(left.now, first, 1e-6), "it has had a say"


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "fault", ["every LiDAR reads 30 mm long", "camera on an arm, arm 5 mm and 1 deg off"]
)
def test_a_faulty_rig_does_not_become_a_good_one_by_a_click(fault):
    dataset, options = faults.FAULTS[fault](0).dataset, CalibrationOptions()
    first = calibrate(dataset, options)
    left = LeftOut(first, options)
    collection = next(d.collection for d, _ in dataset.detections() if d.sensor == "rgb_1")
    left.leave_out("rgb_1", collection)
    labels = dataset.collections[collection].labels
    none = {key: None for key in labels if key[0] == "rgb_1"}
    expected = calibrate(dataset.with_labels(collection, none), options)
    assert left.now.status == expected.status == first.status != "converged"
    assert [check.error for check in left.now.checks] == [c.error for c in expected.checks]
    assert [m.child for m in left.now.moving] == [m.child for m in expected.moving]
    assert same(left.now, expected, 1e-6)


def test_taken_in_again_it_is_the_first_answer(start):
    left = LeftOut(*start)
    left.leave_out("lidar_1", "002")
    left.leave_out("lidar_1", "003")
    assert left.places == {("lidar_1", "002"), ("lidar_1", "003")}
    left.take_in("lidar_1", "003")
    assert left.places == {("lidar_1", "002")}
    assert left.take_in("lidar_1", "002").endswith("all is as it was written")
    assert left.now is left.first and not left.places


def test_what_is_not_there_is_refused(start):
    left = LeftOut(*start)
    for sensor, collection in (("lidar_1", "nowhere"), ("nobody", "002")):
        with pytest.raises(SelectionError, match="has no label in collection"):
            left.leave_out(sensor, collection)
    assert left.now is left.first


def test_boards_of_the_dataset_that_do_not_fit_are_placed_anew(start):
    first, options = start
    dataset, wrong = first.dataset, {}
    move = se3.random_move(0.5, 1.0, np.random.default_rng(0))
    for key, collection in dataset.collections.items():
        edges = [board_edge(p) for p in dataset.patterns.values()]
        poses_of = collection.transforms
        wrong[key] = {e: poses_of[e] @ move for e in edges if e in poses_of}
    assert wrong["000"], "the answer carries its boards"
    trusting = replace(options, boards_of_dataset=True)
    again = calibrate(dataset.with_transforms(wrong), trusting)
    assert again.status == first.status and same(again, first, 1e-6)
