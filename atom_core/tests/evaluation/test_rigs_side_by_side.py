"""A method beside a calibration: its links and its rig are measured by the same rules."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.evaluation.baselines import comparison as module
from atom_core.evaluation.baselines.comparison import Measured, compare_rigs
from atom_core.evaluation.baselines.links import Link, LinkedRig, linked_rig
from atom_core.evaluation.evaluate import evaluate
from atom_core.geometry import se3
from atom_core.model.dataset import pose
from atom_core.synthetic import Noise, scenes

NAMES = ("rgb_1", "rgb_2", "lidar_1")


@pytest.fixture(scope="module")
def scene():
    """Return two cameras, of which the first is anchored, and a LiDAR, off by 2 cm."""
    return scenes.random_scene(
        1,
        rgb=2,
        depth=0,
        lidar3d=1,
        collections=3,
        noise=Noise.none(),
        disturbance=(0.02, 0.01),
    )


@pytest.fixture(scope="module")
def measured(scene):
    dataset = scene.dataset
    found = evaluate(dataset, dataset, truth=scene.truth)
    return Measured(dataset, dataset, found, scene.truth)


def link(dataset, source, target, move=None):
    """Return a link as a dataset has it, or with the source shifted by (3,) [m] in the target."""
    first = next(iter(dataset.collections.values()))
    frames = (dataset.sensors[name].frame for name in (target, source))
    shift = se3.transform(np.eye(3), np.zeros(3) if move is None else np.array(move))
    return Link(source, target, shift @ pose(first, dataset.graph, *frames), 3)


def same_links(dataset, pairs):
    return [link(dataset, *pair) for pair in pairs]


def test_without_a_dataset_there_is_nothing_to_measure(measured):
    empty = LinkedRig("none", (), {})
    (found,) = compare_rigs([empty], measured)
    assert found.rig is empty and found.evaluation is None and found.links == ()
    assert (found.reference, found.sensors) == (None, None)


@pytest.fixture(scope="module")
def same(measured):
    """Return what is said of a method that answers as the calibration does."""
    pairs = [("rgb_1", "rgb_2"), ("lidar_1", "rgb_2")]
    rig = linked_rig("same", measured.train, same_links(measured.train, pairs), {})
    return compare_rigs([rig], measured)[0]


def test_a_method_with_the_calibrations_answer_has_its_figures(same, measured):
    assert len(same.links) == 2
    for score in same.links:
        assert score.pairs
        for pair in score.pairs:
            assert pair.rms == pytest.approx(pair.calibration, rel=1e-6)
            assert pair.at_truth < pair.calibration
        np.testing.assert_allclose(score.error, score.calibration, rtol=1e-6)
        assert score.error.translation_m > 0.005 and score.error.rotation_deg > 0.1
    assert same.reference == "rgb_1" and list(same.sensors) == ["rgb_2", "lidar_1"]
    for score in same.sensors.values():
        np.testing.assert_allclose(score.error, score.calibration, rtol=1e-6)
        assert score.error.translation_m > 0.005


def test_a_links_figures_are_those_of_its_kinds_of_pairs(same, measured):
    known = {result.pair: result for result in measured.evaluation.pairs}
    for score in same.links:
        both = {score.link.source, score.link.target}
        wanted = [p for p in known if {p.source, p.target} == both and not p.reverse]
        assert [pair.pair for pair in score.pairs] == wanted
        for pair in score.pairs:
            assert pair.calibration == known[pair.pair].measured.rms
            assert pair.at_truth == known[pair.pair].at_truth.rms


def test_a_link_and_its_inverse_are_worth_the_same(measured, scene):
    dataset = scene.dataset
    forth = link(dataset, "lidar_1", "rgb_2", (0.01, 0.0, 0.0))
    back = Link("rgb_2", "lidar_1", np.linalg.inv(forth.target_T_source), 3)
    one, other = (
        compare_rigs([linked_rig("m", dataset, [way], {})], measured)[0].links[0]
        for way in (forth, back)
    )
    assert [p.pair for p in one.pairs] == [p.pair for p in other.pairs]
    np.testing.assert_allclose([p.rms for p in one.pairs], [p.rms for p in other.pairs], rtol=1e-9)
    assert one.pairs[0].rms != pytest.approx(one.pairs[0].calibration, rel=1e-3)
    assert one.error.rotation_deg == pytest.approx(other.error.rotation_deg)


def test_a_links_error_is_its_distance_from_the_truth_in_metres_and_degrees(measured, scene):
    true = module.with_truth(scene.dataset, scene.truth)
    off = link(true, "rgb_1", "rgb_2", (0.03, 0.0, -0.04))
    turn = se3.rotation_from_rotation_vector(np.array([0.0, np.radians(2.0), 0.0]))
    turned = off._replace(target_T_source=off.target_T_source @ se3.transform(turn, np.zeros(3)))
    rig = linked_rig("m", scene.dataset, [off, turned], {})
    first, second = compare_rigs([rig], measured)[0].links
    assert first.error == pytest.approx((0.05, 0.0), abs=1e-5)
    assert second.error == pytest.approx((0.05, 2.0), abs=1e-5)
    assert first.calibration == second.calibration
    exact = link(true, "rgb_1", "rgb_2")
    rig = linked_rig("m", scene.dataset, [exact], {})
    (score,) = compare_rigs([rig], measured)[0].links
    np.testing.assert_allclose(score.error, 0.0, atol=1e-5)
    assert score.pairs[0].rms == pytest.approx(score.pairs[0].at_truth, rel=1e-6)


def test_without_a_truth_no_error_is_told(measured):
    blind = Measured(measured.train, measured.test, evaluate(measured.train, measured.test))
    rig = linked_rig("m", measured.train, same_links(measured.train, [("rgb_1", "rgb_2")]), {})
    (found,) = compare_rigs([rig], blind)
    (score,) = found.links
    assert score.error is None and score.calibration is None and found.sensors == {}
    assert score.pairs[0].at_truth is None and score.pairs[0].rms > 0.0


def test_a_link_between_sensors_that_share_no_board_measures_nothing(scene):
    dataset = scene.dataset
    for key in dataset.collections:
        dataset = dataset.with_labels(key, {("rgb_2", "pattern_1"): None})
    apart = Measured(dataset, dataset, evaluate(dataset, dataset, truth=scene.truth), scene.truth)
    rig = linked_rig("m", dataset, same_links(dataset, [("rgb_1", "rgb_2")]), {})
    (score,) = compare_rigs([rig], apart)[0].links
    assert [pair[1:] for pair in score.pairs] == [(None, None, None)]
    assert score.error is not None


def test_a_pair_that_was_not_evaluated_has_no_figures_of_the_calibration(measured):
    few = measured._replace(evaluation=replace(measured.evaluation, pairs=()))
    rig = linked_rig("m", measured.train, same_links(measured.train, [("rgb_1", "rgb_2")]), {})
    (score,) = compare_rigs([rig], few)[0].links
    assert score.pairs[0].rms > 0.0
    assert score.pairs[0].calibration is None and score.pairs[0].at_truth is None


def test_only_sensors_that_are_placed_are_evaluated_and_never_the_reference(measured):
    rig = linked_rig("m", measured.train, same_links(measured.train, [("lidar_1", "rgb_2")]), {})
    (found,) = compare_rigs([rig], measured)
    assert found.reference == "rgb_2" and list(found.sensors) == ["lidar_1"]
    assert {n for p in found.evaluation.pairs for n in (p.pair.source, p.pair.target)} == {
        "rgb_2",
        "lidar_1",
    }


def test_a_link_to_a_sensor_that_is_not_compared_measures_nothing(measured):
    pairs = [("rgb_1", "rgb_2")]
    rig = linked_rig("m", measured.train, same_links(measured.train, pairs), {})
    (found,) = compare_rigs([rig], measured, list(NAMES[:2]))
    assert found.links[0].pairs[0].rms > 0.0 and list(found.sensors) == ["rgb_2"]


@pytest.mark.parametrize("longer", [1.0, 1.02])
def test_a_method_is_measured_with_its_own_lenses(measured, longer):
    dataset = measured.train
    camera = dataset.sensors["rgb_2"].camera
    K = camera.K @ np.diag([longer, longer, 1.0])
    sensors = {**dataset.sensors}
    if longer != 1.0:
        sensors["rgb_2"] = replace(dataset.sensors["rgb_2"], camera=replace(camera, K=K))
    own = replace(dataset, sensors=sensors)
    pairs = [("rgb_1", "rgb_2"), ("lidar_1", "rgb_2")]
    rig = linked_rig("lens", own, same_links(dataset, pairs), {})
    (found,) = compare_rigs([rig], measured)
    by_pair = {result.pair: result for result in found.evaluation.pairs}
    for score in found.links:
        for pair in score.pairs:
            assert pair.rms == pytest.approx(by_pair[pair.pair].measured.rms, rel=1e-6)
            assert (pair.rms == pytest.approx(pair.calibration, rel=1e-6)) == (longer == 1.0)


def test_a_method_may_have_all_lenses_of_its_own(measured):
    dataset = measured.train
    cameras = {name: dataset.sensors[name].camera for name in NAMES[:2]}
    longer = {n: replace(c, K=c.K @ np.diag([1.02, 1.02, 1.0])) for n, c in cameras.items()}
    sensors = {n: replace(dataset.sensors[n], camera=camera) for n, camera in longer.items()}
    own = replace(dataset, sensors={**dataset.sensors, **sensors})
    rig = linked_rig("lens", own, same_links(dataset, [("rgb_1", "rgb_2")]), {})
    (found,) = compare_rigs([rig], measured)
    (pair,) = found.links[0].pairs
    by_pair = {result.pair: result for result in found.evaluation.pairs}
    assert pair.rms == pytest.approx(by_pair[pair.pair].measured.rms, rel=1e-6)
