"""A board that is configured with rows that it has not is named, though its labels fit."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.preflight import preflight
from atom_core.labeling.unseen_rows import seen_rows
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import pattern_from_config
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.check_verdict import check_verdict
from atom_core.report.verdict import GOOD, WEAK
from atom_core.synthetic import scenes

TOLD = "no picture shows a corner of the last "


@pytest.fixture(scope="module")
def scene():
    return scenes.random_scene(3, rgb=2, depth=0, lidar3d=0, collections=12)


def with_rows(dataset, further):
    """Return the dataset whose configuration has the board with further rows."""
    ((name, config),) = dataset.config.calibration_patterns.items()
    columns, rows = config.dimension
    config = replace(config, dimension=(columns, rows + further))
    return replace(
        dataset,
        config=replace(dataset.config, calibration_patterns={name: config}),
        patterns={name: pattern_from_config(name, config)},
    )


def without_row(dataset, row, collections):
    """Return the dataset in which a row of corners is covered in some collections."""
    (pattern,) = dataset.patterns.values()
    changed = dict(dataset.collections)
    for key in collections:
        labels = {
            place: RgbLabel(
                label.ids[label.ids // pattern.columns != row],
                label.pixels[label.ids // pattern.columns != row],
            )
            for place, label in changed[key].labels.items()
        }
        changed[key] = replace(changed[key], labels=labels)
    return replace(dataset, collections=changed)


def remarks(dataset):
    return [w for w in preflight(dataset).warnings if TOLD in w]


@pytest.mark.parametrize("further, last", [(1, "row"), (2, "2 rows")])
def test_a_board_with_rows_too_many_is_named_with_those_that_it_has(scene, further, last):
    (pattern,) = scene.dataset.patterns.values()
    size = f"{pattern.columns} x {pattern.rows} inner corners"
    dataset = with_rows(scene.dataset, further)
    (told,) = remarks(dataset)
    assert told.startswith("sensors 'rgb_1', 'rgb_2': ") and f"{TOLD}{last} of pattern" in told
    assert f"the board has {size}, not {pattern.columns} x {pattern.rows + further}" in told
    verdict = check_verdict(dataset, preflight(dataset))
    assert verdict.grade == WEAK and TOLD in verdict.sentence
    calibration = calibrate(dataset)
    assert told in calibration.warnings
    assert calibration_verdict(calibration_results(calibration, "any")).grade == WEAK


def test_a_board_as_configured_is_not_named(scene):
    assert not remarks(scene.dataset)
    assert check_verdict(scene.dataset, preflight(scene.dataset)).grade == GOOD


def test_a_row_that_one_picture_shows_is_there(scene):
    (pattern,) = scene.dataset.patterns.values()
    last, keys = pattern.rows - 1, list(scene.dataset.collections)
    (told,) = remarks(without_row(scene.dataset, last, keys))
    assert "or something covers that part of it" in told
    assert not remarks(without_row(scene.dataset, last, keys[1:]))


def test_a_row_that_would_lie_beyond_the_image_is_not_missed(scene):
    """Images are cut right beside the corners, whichever way the board is turned."""
    (pattern,) = with_rows(scene.dataset, 1).patterns.values()
    before, after = [], []
    for key, label in scene.dataset.detections():
        camera = scene.dataset.sensors[key.sensor].camera
        before.append(seen_rows(label, pattern, camera).is_next_in_view)
        low, high = label.pixels.min(axis=0) - 3.0, label.pixels.max(axis=0) + 3.0
        width, height = (int(side) for side in high - low)
        K = camera.K - np.array([[0, 0, low[0]], [0, 0, low[1]], [0, 0, 0]])
        cut = replace(camera, width=width, height=height, K=K)
        moved = RgbLabel(label.ids, label.pixels - low)
        after.append(seen_rows(moved, pattern, cut).is_next_in_view)
    assert sum(before) > len(before) / 2 and not any(after)


def test_few_pictures_do_not_tell(scene):
    few = list(scene.dataset.collections)[:2]
    assert not remarks(with_rows(scene.dataset.selected(collections=few), 1))
