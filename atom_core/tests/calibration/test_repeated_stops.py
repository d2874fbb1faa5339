"""Collections with all boards where they were are one stop, and make no answer surer."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.geometry import se3
from atom_core.model.labels import RgbLabel
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.stated_errors import stated_errors
from atom_core.report.verdict import WEAK
from atom_core.solvers.choice import default_solver
from atom_core.solvers.stops import stops_of
from atom_core.synthetic import mistakes, scenes

NOISE_PX = 0.1


def pictures(dataset, count, rng):
    """Return the dataset of cameras with so many pictures of each collection, noise apart."""
    collections = {}
    for collection in dataset.collections.values():
        for _ in range(count):
            labels = {
                place: RgbLabel(
                    label.ids, label.pixels + NOISE_PX * rng.normal(size=(len(label.ids), 2))
                )
                for place, label in collection.labels.items()
            }
            key = f"{len(collections):03d}"
            collections[key] = replace(collection, key=key, labels=labels)
    return replace(dataset, collections=collections)


def bent_pictures(dataset, rng, size_px=0.15):
    """Return the dataset in whose pictures all corners are off together, as by a lens there."""
    collections = {}
    for key, collection in dataset.collections.items():
        labels = {}
        for place, label in collection.labels.items():
            shift, slope = size_px * rng.normal(size=2), size_px * rng.normal(size=(2, 2))
            off = shift + (label.pixels - [640.0, 400.0]) / 400.0 @ slope
            labels[place] = RgbLabel(label.ids, label.pixels + off)
        collections[key] = replace(collection, labels=labels)
    return replace(dataset, collections=collections)


def test_more_pictures_of_the_same_stops_make_no_answer_surer():
    """Twenty pictures of each of five stops had a quarter of the sigma, and 16 of them of error."""
    for seed in range(3):
        rng = np.random.default_rng([seed, 5])
        once = bent_pictures(scenes.hand_eye(seed, collections=8).dataset, rng)
        sigmas = []
        for count in (1, 6):
            results = calibration_results(calibrate(pictures(once, count, rng)), "any")
            sigmas.append(results.edges[0].sigma_translation_m)
        assert min(sigmas[1]) > 0.6 * min(sigmas[0])


def test_what_differs_between_stops_is_within_the_stated_sigmas():
    ratios = []
    for seed in range(6):
        rng = np.random.default_rng([seed, 6])
        scene = scenes.hand_eye(seed, collections=5, disturbance=(0.02, 0.02))
        found = calibrate(pictures(bent_pictures(scene.dataset, rng), 6, rng))
        edges = calibration_results(found, default_solver()).edges
        (error,) = stated_errors(edges, scene.truth)
        ratios.append(np.abs(error.error) / error.combined_sigma)
    assert np.mean(np.array(ratios) < 1.96) > 0.9


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(6))
def test_an_arm_that_is_off_at_each_stop_is_no_sensor_that_was_moved(seed):
    """In 8 of 24 rigs like these, three pictures to a stop, a sensor or a base "was moved"."""
    rng = np.random.default_rng([seed, 7])
    scene = scenes.board_on_arm(seed, collections=8, sensors=2)
    off = mistakes.with_edge_off(scene.dataset, "flange", 0.0005, 0.035, rng)
    assert calibrate(off).status == "converged"
    found = calibrate(pictures(off, 3, rng))
    assert found.status == "converged", found.message


def test_three_places_are_few_whatever_the_number_of_pictures():
    rng = np.random.default_rng(3)
    scene = scenes.hand_eye(3, collections=3)
    found = calibrate(pictures(scene.dataset, 4, rng))
    results = calibration_results(found, "any")
    said = [w for w in found.warnings if "do not tell by their differences" in w]
    assert said[0].startswith("12 collections that show the boards in 3 place(s) only")
    assert calibration_verdict(results).sensors["rgb_1"].grade == WEAK
    assert results.sensors["rgb_1"].boards == 3


def test_two_pictures_to_a_stop_are_told_and_one_is_not():
    rng = np.random.default_rng(4)
    dataset = scenes.hand_eye(4, collections=8).dataset
    told = [
        any("worth 8 of them" in w for w in calibrate(d).warnings)
        for d in (pictures(dataset, 2, rng), pictures(dataset, 1, rng))
    ]
    assert told == [True, False]


@pytest.fixture(scope="module")
def twice():
    """Return the problem of a camera on an arm, two pictures to each of six stops; its solution."""
    dataset = scenes.hand_eye(5, collections=6).dataset
    found = calibrate(pictures(dataset, 2, np.random.default_rng(5)))
    return found.problem, found.summary.x


def test_two_pictures_are_one_stop_under_the_first_ones_name(twice):
    stops = stops_of(*twice)
    assert list(stops) == [f"{i:03d}" for i in range(12)]
    assert list(stops.values()) == [f"{i - i % 2:03d}" for i in range(12)]


def elsewhere(twice, detection, places, moved):
    """Return the number of stops where a detection's chain is moved in one place, or two."""
    problem, x = twice
    constants = problem.chains.constants.copy()
    pose = problem.poses(x)[detection]
    constants[detection, places[0]] = constants[detection, places[0]] @ moved
    if len(places) == 2:  # which makes up for it: the board is where it was
        chains = replace(problem.chains, constants=constants)
        now = replace(problem, chains=chains).poses(x)[detection]
        constants[detection, places[1]] = constants[detection, places[1]] @ se3.inverse(now) @ pose
    return len(
        set(
            stops_of(
                replace(problem, chains=replace(problem.chains, constants=constants)), x
            ).values()
        )
    )


@pytest.mark.parametrize("places", [(2,), (1, 2)], ids=["board", "arm"])
def test_a_stop_ends_where_the_board_or_the_arm_is_elsewhere(twice, places):
    """Of an arm, though the camera sees the board as before."""
    assert len(set(stops_of(*twice).values())) == 6
    for moved, count in ((0.0005, 6), (0.1, 7)):
        shift = se3.transform(np.eye(3), np.array([moved, 0.0, 0.0]))
        assert elsewhere(twice, 3, places, shift) == count
        turn = se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, moved]))
        assert elsewhere(twice, 3, places, turn) == count
