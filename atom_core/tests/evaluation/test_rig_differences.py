"""A test set of another rig: where it differs from the calibrated one is told, or it is refused."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.rig_differences import board_differences, rig_differences
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import GOOD, WEAK
from atom_core.synthetic import Noise, arm, mistakes, paper_cell


@pytest.fixture(scope="module")
def cell():
    return paper_cell(0, "test").dataset


def with_camera(dataset, name, width=None, **factors):
    camera = dataset.sensors[name].camera
    K = camera.K.copy()
    K[0, 0] *= factors.get("focal_length", 1.0)
    K[1, 1] *= factors.get("focal_length", 1.0)
    K[0, 2] += factors.get("centre", 0.0) * K[0, 0]
    other = Camera(width or camera.width, camera.height, K, camera.D, camera.model)
    sensor = replace(dataset.sensors[name], camera=other)
    return replace(dataset, sensors={**dataset.sensors, name: sensor})


def believed_edge(dataset):
    """Return an edge that nobody estimates, and the sensors behind it."""
    estimated = {sensor.edge for sensor in dataset.sensors.values()}
    for name, sensor in dataset.sensors.items():
        for edge, _ in dataset.graph.chain(dataset.world, sensor.frame):
            if edge not in estimated:
                return edge, name
    raise AssertionError("every edge is estimated")


def with_edge_moved(dataset, edge, by_m):
    moved = dataset.first_value(edge) @ se3.transform(np.eye(3), np.array([by_m, 0.0, 0.0]))
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: moved}))


def test_the_same_rig_has_no_difference(cell):
    assert rig_differences(cell, cell) == []


@pytest.mark.parametrize("what", [{"focal_length": 1.05}, {"centre": 0.03}])
def test_another_lens_of_a_camera_is_told_with_both(cell, what):
    (caveat,) = rig_differences(cell, with_camera(cell, "rgb_2", **what))
    assert caveat.sensors == ("rgb_2",)
    fx = cell.sensors["rgb_2"].camera.K[0, 0]
    assert f"fx {fx:.1f}" in caveat.what and "another lens" in caveat.what


def test_intrinsics_that_were_estimated_are_no_other_lens(cell):
    assert rig_differences(cell, with_camera(cell, "rgb_2", focal_length=1.01, centre=0.01)) == []


def test_an_edge_that_nobody_estimated_is_told_with_how_far_it_is_off(cell):
    edge, name = believed_edge(cell)
    (caveat,) = rig_differences(cell, with_edge_moved(cell, edge, 0.03))
    assert name in caveat.sensors and f"'{edge}' 30.0 mm" in caveat.what


def test_what_differs_is_weak_in_the_verdict_and_all_else_stays_good(cell):
    said = evaluation_verdict(evaluate(cell, with_camera(cell, "rgb_2", focal_length=1.05)))
    grades = {name: sensor.grade for name, sensor in said.sensors.items()}
    assert grades.pop("rgb_2") == WEAK
    assert set(grades.values()) == {GOOD}


def test_images_of_another_size_are_refused_with_both_sizes(cell):
    with pytest.raises(DatasetError, match="rgb_2.* px in the train file and of 320 x"):
        evaluate(cell, with_camera(cell, "rgb_2", width=320))


def test_a_joint_that_stands_elsewhere_is_no_difference():
    on_arm = arm.camera_on_arm(0, errors={}, collections=2, noise=Noise.none()).dataset
    joint = on_arm.joint("elbow")
    standing = replace(on_arm, edge_types={**on_arm.edge_types, joint.edge: "fixed"})
    elsewhere = with_edge_moved(standing, joint.edge, 0.1)
    assert rig_differences(standing, elsewhere) == []


@pytest.mark.parametrize("factor, count", [(1.0, 0), (1.0001, 0), (1.02, 1), (1000.0, 1)])
def test_a_board_that_has_other_sizes_in_the_test_set_is_told(cell, factor, count):
    told = board_differences(cell, mistakes.with_scaled_boards(cell, factor))
    assert len(told) == count * len(cell.patterns)
    for sentence, name in zip(told, cell.patterns):
        assert sentence.startswith(f"board '{name}' has") and "mm" in sentence


def test_another_board_by_another_name_is_no_difference(cell):
    patterns = {f"other_{name}": pattern for name, pattern in cell.patterns.items()}
    assert board_differences(cell, replace(cell, patterns=patterns)) == []
