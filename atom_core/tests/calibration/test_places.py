"""Data of another sensor fit as well as a sensor's own; what was known of the rig tells."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.judge.places import displaced, exchanged
from atom_core.calibration.options import NO_GUESS, CalibrationOptions
from atom_core.calibration.preflight import preflight
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import scenes

GUESSED = (0.05, 0.05)  # metres and radians


def with_labels_of(dataset, names):
    """Return the dataset with some sensors' labels taken from others, by name."""
    changed = {}
    for key, collection in dataset.collections.items():
        labels = dict(collection.labels)
        for name, source in names.items():
            for pattern in dataset.patterns:
                labels.pop((name, pattern), None)
                if (source, pattern) in collection.labels:
                    labels[name, pattern] = collection.labels[source, pattern]
        changed[key] = replace(collection, labels=labels)
    return replace(dataset, collections=changed)


@pytest.fixture(scope="module")
def cameras():
    """Three cameras that have the same intrinsics."""
    return scenes.random_scene(
        2, rgb=3, depth=0, lidar3d=0, collections=12, disturbance=GUESSED
    ).dataset


def test_exchanged_cameras_are_named_and_not_trusted(cameras):
    swapped = calibrate(with_labels_of(cameras, {"rgb_1": "rgb_2", "rgb_2": "rgb_1"}))
    assert swapped.status == INCONSISTENT
    assert "'rgb_1' and 'rgb_2' each end where the description has the other" in swapped.message
    assert calibration_verdict(calibration_results(swapped, "scipy")).grade == "wrong"
    assert calibrate(cameras).status == CONVERGED


def test_without_a_guess_nothing_is_known_of_places(cameras):
    swapped = with_labels_of(cameras, {"rgb_1": "rgb_2", "rgb_2": "rgb_1"})
    solved = calibrate(swapped, CalibrationOptions(initial_guess=NO_GUESS))
    assert solved.status == CONVERGED and not solved.displaced


def test_a_rough_guess_exchanges_nobody(cameras):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        edges = {s.edge: cameras.first_value(s.edge) for s in cameras.sensors.values()}
        rough = {e: se3.random_move(0.3, 0.5, rng) @ pose for e, pose in edges.items()}
        elsewhere = cameras.with_transforms(dict.fromkeys(cameras.collections, rough))
        assert exchanged(elsewhere, cameras) == []


def test_what_ends_far_from_the_description_is_weak_until_that_says_so(cameras):
    edge = cameras.sensors["rgb_2"].edge
    for move, far in (((0.7, 0.0), True), ((0.0, 0.6), True), ((0.3, 0.3), False)):
        place = cameras.first_value(edge) @ se3.random_move(*move, np.random.default_rng(0))
        described = cameras.with_transforms(dict.fromkeys(cameras.collections, {edge: place}))
        solved = calibrate(described)
        assert solved.status == CONVERGED
        assert [found.sensors for found in solved.displaced] == [("rgb_2",)] * far
        verdict = calibration_verdict(calibration_results(solved, "scipy"))
        assert verdict.sensors["rgb_2"].grade == ("weak" if far else "good")
        assert ("from where the description has it" in verdict.sensors["rgb_2"].sentence) == far
        assert verdict.sensors["rgb_3"].grade == "good"


def test_a_place_that_was_never_guessed_is_nothing_to_be_far_from(cameras):
    edge = cameras.sensors["rgb_2"].edge
    far = cameras.first_value(edge) @ se3.from_rpy(np.array([0.0, 0.0, 9.0]), np.zeros(3))
    ended = cameras.with_transforms(dict.fromkeys(cameras.collections, {edge: far}))
    unset = cameras.with_transforms(dict.fromkeys(cameras.collections, {edge: np.eye(4)}))
    assert displaced(unset, ended) == []
    (found,) = displaced(cameras, ended)
    assert found.edge == edge and found.translation_m == pytest.approx(9.0)


@pytest.mark.parametrize("kind", ["rgb", "lidar3d", "depth"])
def test_one_sensor_under_two_names_is_refused(kind):
    counts = {**dict.fromkeys(("rgb", "lidar3d", "depth"), 0), kind: 2}
    scene = scenes.random_scene(1, **counts, collections=6, disturbance=GUESSED)
    one, other = scene.dataset.sensors
    twice = with_labels_of(scene.dataset, {other: one})
    if kind != "rgb":
        twice = replace(twice, data=Twice(twice.data, {other: one}))
    said = f"the labels of sensors '{one}' and '{other}' are the same to the last digit in"
    with pytest.raises(CalibrationError, match=said):
        calibrate(twice)
    assert any(said in problem for problem in preflight(twice).problems)
    assert not preflight(scene.dataset).problems


class Twice:
    """Data of which some sensors' are those of others."""

    def __init__(self, data, names):
        self.data, self.names = data, names

    def read(self, collection, sensor):
        return self.data.read(collection, self.names.get(sensor, sensor))

    def has_data(self, collection, sensor):
        return self.data.has_data(collection, self.names.get(sensor, sensor))
