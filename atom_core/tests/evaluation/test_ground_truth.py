"""Planted errors of sensors are found exactly."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.evaluation.ground_truth import ground_truth_errors
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.synthetic import Noise, paper_cell
from atom_core.synthetic.scenes import hand_eye, shared_edge

OPTIONS = {"collections": 2, "noise": Noise.none()}


@pytest.fixture(scope="module")
def cell():
    return paper_cell(5, "test", Noise.none())


def moved(dataset, edge, change):
    """Return the dataset with an edge moved in its parent's frame."""
    first = next(iter(dataset.collections.values())).transforms[edge]
    return dataset.with_transforms(dict.fromkeys(dataset.collections, {edge: change @ first}))


def test_the_truth_has_no_error(cell):
    errors = ground_truth_errors(cell.dataset, cell.truth)
    for error in (errors.mean, *errors.sensors.values()):
        assert max(error) == pytest.approx(0.0, abs=1e-6)


def test_a_planted_translation_is_found_in_its_sensor_alone(cell):
    edge = cell.dataset.sensors["rgb_1"].edge
    errors = ground_truth_errors(
        moved(cell.dataset, edge, se3.transform(np.eye(3), np.array([0.003, -0.004, 0.012]))),
        cell.truth,
    )
    assert errors.sensors["rgb_1"].translation_m == pytest.approx(0.013, abs=1e-12)
    assert errors.sensors["rgb_1"].world_translation_m == pytest.approx(0.013, abs=1e-12)
    assert errors.sensors["rgb_1"].rotation_deg == pytest.approx(0.0, abs=1e-6)
    assert errors.sensors["rgb_2"].translation_m == pytest.approx(0.0, abs=1e-12)
    assert errors.mean.translation_m == pytest.approx(0.013 / 6, abs=1e-12)


def test_a_planted_rotation_about_the_data_frame_is_a_pure_rotation(cell):
    sensor = cell.dataset.sensors["lidar_2"]
    collection = next(iter(cell.dataset.collections.values()))
    parent_T_data = pose(collection, cell.dataset.graph, sensor.edge.parent, sensor.frame)
    rotation = se3.random_rotation(0.02, np.random.default_rng(1))
    change = parent_T_data @ se3.transform(rotation, np.zeros(3)) @ se3.inverse(parent_T_data)
    errors = ground_truth_errors(moved(cell.dataset, sensor.edge, change), cell.truth)
    assert errors.sensors["lidar_2"].rotation_deg == pytest.approx(np.degrees(0.02), abs=1e-9)
    assert errors.sensors["lidar_2"].translation_m == pytest.approx(0.0, abs=1e-12)
    assert errors.mean.rotation_deg == pytest.approx(np.degrees(0.02) / 6, abs=1e-6)


def test_an_error_of_the_anchor_shows_in_all_others_and_in_the_world(cell):
    edge = cell.dataset.sensors["rgb_3"].edge
    errors = ground_truth_errors(
        moved(cell.dataset, edge, se3.transform(np.eye(3), np.array([0.0, 0.0, 0.1]))), cell.truth
    )
    assert errors.sensors["rgb_3"].translation_m == pytest.approx(0.0, abs=1e-12)
    assert errors.sensors["rgb_3"].world_translation_m == pytest.approx(0.1, abs=1e-12)
    for name in ("rgb_1", "lidar_1", "depth_1"):
        assert errors.sensors[name].translation_m == pytest.approx(0.1, abs=1e-12)
        assert errors.sensors[name].world_translation_m == pytest.approx(0.0, abs=1e-12)
    assert errors.mean.translation_m == pytest.approx(0.1, abs=1e-12)


def test_without_the_anchor_the_first_sensor_serves(cell):
    names = [name for name in cell.dataset.sensors if name != "rgb_3"]
    dataset = cell.dataset.selected(sensors=names)
    edge = dataset.sensors[names[0]].edge
    errors = ground_truth_errors(
        moved(dataset, edge, se3.transform(np.eye(3), np.array([0.02, 0, 0]))), cell.truth
    )
    assert errors.sensors[names[0]].translation_m == pytest.approx(0.0, abs=1e-12)
    assert errors.sensors[names[1]].translation_m == pytest.approx(0.02, abs=1e-12)


def test_sensors_on_one_edge_share_its_error():
    scene = shared_edge(0, **OPTIONS)
    edge = scene.dataset.sensors["rgb_2"].edge
    change = se3.transform(np.eye(3), np.array([0.0, 0.007, 0.0]))
    errors = ground_truth_errors(moved(scene.dataset, edge, change), scene.truth)
    for name in ("rgb_2", "depth_1"):
        assert errors.sensors[name].translation_m == pytest.approx(0.007, abs=1e-12)


OFF = se3.transform(
    se3.rotation_from_rotation_vector(np.array([0.0, 0.02, 0.0])), np.array([0.06, 0.0, -0.08])
)
SHIFT = se3.transform(np.eye(3), OFF[:3, 3])  # by 0.1 m


def test_a_single_sensor_has_the_error_of_its_own_edge():
    scene = hand_eye(0, **OPTIONS)
    edge = scene.dataset.sensors["rgb_1"].edge
    errors = ground_truth_errors(moved(scene.dataset, edge, SHIFT), scene.truth)
    assert errors.sensors["rgb_1"].translation_m == pytest.approx(0.1, abs=1e-9)
    assert errors.mean.translation_m == pytest.approx(0.1, abs=1e-9)


def test_a_single_anchored_sensor_has_the_error_of_its_own_edge(cell):
    dataset = cell.dataset.selected(sensors=["rgb_3"])
    errors = ground_truth_errors(moved(dataset, dataset.sensors["rgb_3"].edge, OFF), cell.truth)
    assert errors.mean.rotation_deg == pytest.approx(np.degrees(0.02), abs=1e-6)
    assert errors.mean == errors.sensors["rgb_3"][:2]


def test_an_estimated_reference_counts_in_the_mean(cell):
    dataset = moved(cell.dataset, cell.dataset.sensors["rgb_3"].edge, SHIFT)
    held = ground_truth_errors(dataset, cell.truth, held=["rgb_3"])
    estimated = ground_truth_errors(dataset, cell.truth, held=["rgb_1"])
    assert held.sensors["rgb_3"].translation_m == pytest.approx(0.0, abs=1e-9)
    assert estimated.sensors["rgb_3"].translation_m == pytest.approx(0.1, abs=1e-9)
    others = [error.translation_m for name, error in held.sensors.items() if name != "rgb_3"]
    assert estimated.mean.translation_m == pytest.approx(np.mean([*others, 0.1]), abs=1e-9)


def test_without_an_anchor_the_first_sensor_is_estimated_where_the_rig_moves_before_a_board(cell):
    dataset = cell.dataset.selected(sensors=[n for n in cell.dataset.sensors if n != "rgb_3"])
    first = next(iter(dataset.sensors.values()))
    off = moved(dataset, first.edge, SHIFT)
    carrier = dataset.graph.chain(dataset.world, first.edge.parent)[0].edge
    driven = off.with_transforms(
        {
            key: {
                carrier: collection.transforms[carrier] @ se3.from_rpy(np.ones(3) * i, np.ones(3))
            }
            for i, (key, collection) in enumerate(off.collections.items())
        }
    )
    # Boards that are carried along float with the rig wherever it goes; one that stays ties it.
    staying = {name: replace(p, fixed=True) for name, p in driven.patterns.items()}
    before = replace(driven, patterns=staying)
    for rig, own in ((off, 0.0), (driven, 0.0), (before, 0.1)):
        errors = ground_truth_errors(rig, cell.truth)
        assert errors.sensors[first.name].translation_m == pytest.approx(own, abs=1e-9)
