"""A collection that stands twice in a dataset counts once."""

from dataclasses import replace

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.preflight import preflight
from atom_core.report.calibration_results import calibration_results
from atom_core.synthetic import scenes
from atom_core.synthetic.mistakes import Origin, with_detections_from


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(2, collections=8).dataset


def with_copies(dataset, keys):
    """Return the dataset with some collections under further keys, as a merge leaves them."""
    copies = {f"{i:03d}": key for i, key in enumerate(keys, len(dataset.collections))}
    added = {new: replace(dataset.collections[old], key=new) for new, old in copies.items()}
    more = replace(dataset, collections={**dataset.collections, **added})
    origins = {
        (new, sensor): Origin(dataset, old)
        for new, old in copies.items()
        for sensor in dataset.sensors
        if any(name == sensor for name, _ in dataset.collections[old].labels)
    }
    return with_detections_from(more, origins)


def test_a_copy_is_left_out_by_name_and_makes_no_answer_surer(dataset):
    twice = with_copies(dataset, ["002", "005"])
    found, plain = calibrate(twice), calibrate(dataset)
    assert {key: why for key, why in found.unused.items() if key >= "008"} == {
        "008": "it is a copy of collection 002, all labels are the same to the last digit",
        "009": "it is a copy of collection 005, all labels are the same to the last digit",
    }
    for one, other in zip(*(calibration_results(c, "any").edges for c in (found, plain))):
        assert one.sigma_translation_m == pytest.approx(other.sigma_translation_m, rel=1e-3)


def test_check_names_it(dataset):
    warnings = preflight(with_copies(dataset, ["002"])).warnings
    assert any(w.startswith("collection 008 is a copy of 002") for w in warnings)
    assert not any("copy" in w for w in preflight(dataset).warnings)


def test_the_same_labels_from_another_place_are_no_copy():
    """Where an arm moves a camera about a board, without noise: places may differ."""
    dataset = scenes.hand_eye(1, collections=6).dataset
    edge = next(e for e in dataset.collections["001"].transforms if e.child == "flange")
    there = dataset.collections["001"].transforms[edge]
    twice = with_copies(dataset, ["002"]).with_transforms({"006": {edge: there}})
    assert not any("copy" in w for w in preflight(twice).warnings)
