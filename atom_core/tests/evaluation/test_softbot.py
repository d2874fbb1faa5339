"""ATOM's own figures on ATOM's own datasets."""

import csv

import pytest

from atom_core.evaluation.evaluate import evaluate
from atom_core.io.dataset_json import read_dataset

PRINTED = 1e-4  # ATOM prints four decimals
AVERAGES = {
    "nig_0.1_run001": (41.3302, 38.3875, 13.3990, 122.3104, 1.8590),
    "nig_0.2_run002": (82.8875, 73.4005, 28.5047, 427.3611, 11.6135),
}


@pytest.fixture(scope="module", params=sorted(AVERAGES))
def run(request, real_data):
    folder = real_data("atom_softbot") / request.param
    dataset = read_dataset(folder / "atom_calibration.json")
    return request.param, folder, evaluate(dataset, dataset)


def values(figures):
    return (
        figures.rms,
        figures.x_mean_abs,
        figures.y_mean_abs,
        figures.translation_mm,
        figures.rotation_deg,
    )


def camera_pair(evaluation):
    (result,) = [
        r for r in evaluation.pairs if r.pair.kind.name == "rgb-rgb" and not r.pair.reverse
    ]
    return result


def test_averages_are_those_that_atom_printed(run):
    name, _, evaluation = run
    assert values(camera_pair(evaluation).measured) == pytest.approx(AVERAGES[name], abs=PRINTED)
    assert tuple(round(v, 4) for v in values(camera_pair(evaluation).measured)) == AVERAGES[name]


def test_every_collection_is_as_in_atoms_file(run):
    _, folder, evaluation = run
    measured = camera_pair(evaluation).measured
    with open(folder / "rgb_rgb_evaluation.csv", newline="") as stream:
        rows = {row[0]: [float(v) for v in row[1:]] for row in list(csv.reader(stream))[1:]}
    assert set(rows) == {*measured.per_collection, "Averages"}
    for key, figures in measured.per_collection.items():
        assert values(figures) == pytest.approx(rows[key], abs=PRINTED)


def test_pairs_without_their_clouds_are_skipped_and_say_so(run):
    _, _, evaluation = run
    skipped = {r.pair.target: r.skipped for r in evaluation.pairs if r.measured is None}
    assert set(skipped) == {"front_left_camera", "front_right_camera"}
    for why in skipped.values():
        assert why == "the data file of 'lidar3d' is absent (5 collections)"
