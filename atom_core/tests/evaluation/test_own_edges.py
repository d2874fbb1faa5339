"""Odometry that is estimated anew in each collection is no part of a calibration on a test set."""

from dataclasses import replace

import pytest

from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.own_edges import own_edge_between, own_edges
from atom_core.model.config import EdgeConfig
from atom_core.model.dataset import MULTIPLE
from atom_core.model.transforms import Edge
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import GOOD, WRONG
from atom_core.synthetic.driving import ODOMETRY, vehicle_before_a_board
from atom_core.synthetic.scenes import random_scene

POST = Edge("rig_base", "rgb_2_post")


@pytest.fixture(scope="module")
def vehicle():
    """Two cameras at their true places; what the odometry says is off by centimetres."""
    scene = vehicle_before_a_board(1, odometry=True, off=0.03)
    return replace(scene, dataset=replace(scene.dataset, edge_types={ODOMETRY: MULTIPLE}))


def test_errors_of_the_test_sets_odometry_are_not_the_calibrations(vehicle):
    found = evaluate(vehicle.dataset, vehicle.dataset, truth=vehicle.truth)
    assert [one.measured for one in found.spread] == [None, None]
    assert all("'world-base' lies in between" in one.skipped for one in found.spread)
    for one in found.single:  # labels and intrinsics alone
        assert not one.one_pose and not one.tells_of_calibration and one.measured.rms < 1.0
    assert evaluation_verdict(found).grade == GOOD


def test_odometry_that_no_calibration_estimates_is_measured_with_it(vehicle):
    """Then the calibration rests on it, and boards that stay lie apart by what it is off."""
    config = replace(vehicle.dataset.config, additional_tfs={})
    dataset = replace(vehicle.dataset, config=config)
    found = evaluate(dataset, dataset)
    assert own_edges(dataset, dataset) == frozenset()
    assert all(one.measured.translation_mm > 20.0 for one in found.spread)
    assert evaluation_verdict(found).grade == WRONG


def test_sensors_on_both_sides_of_such_an_edge_are_no_pair():
    scene = random_scene(1, rgb=3, depth=0, lidar3d=0, collections=4)
    entry = EdgeConfig(parent_link=POST.parent, child_link=POST.child)
    dataset = replace(
        scene.dataset,
        config=replace(scene.dataset.config, additional_tfs={"post": entry}),
        edge_types={POST: MULTIPLE},
    )
    measured = {
        (one.pair.source, one.pair.target): one.measured is not None
        for one in evaluate(dataset, dataset).pairs
        if not one.pair.reverse
    }
    expected = {("rgb_1", "rgb_2"): False, ("rgb_1", "rgb_3"): True, ("rgb_2", "rgb_3"): False}
    assert measured == expected
    frames = [dataset.sensors[name].frame for name in ("rgb_1", "rgb_2")]
    assert own_edge_between(dataset, [POST], *frames) == POST
    assert own_edge_between(dataset, [POST], frames[0], "nowhere") is None
