"""Outliers are found, named by their id, and counted."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge import outliers
from atom_core.calibration.judge.outliers import find_outliers
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import paper_cell

PATTERN = "pattern_1"


def found_in(dataset):
    result = calibrate(dataset)
    return find_outliers(result.problem, result.summary.x, result.summary.sigmas)


def with_moved_corner(dataset, collection, sensor, number, shift_px):
    label = dataset.collections[collection].labels[(sensor, PATTERN)]
    pixels = label.pixels.copy()
    pixels[number] += shift_px
    labels = dict(dataset.collections[collection].labels)
    labels[(sensor, PATTERN)] = RgbLabel(label.ids, pixels)
    changed = replace(dataset.collections[collection], labels=labels)
    return replace(dataset, collections={**dataset.collections, collection: changed})


def camera_detection(dataset, sensor):
    return next(k for k, c in dataset.collections.items() if (sensor, PATTERN) in c.labels)


@pytest.fixture(scope="module")
def cell():
    return paper_cell(0).dataset


def test_a_wrong_corner_is_the_largest_outlier_and_named_by_its_id(cell):
    key = camera_detection(cell, "rgb_2")
    found = found_in(with_moved_corner(cell, key, "rgb_2", 5, (30.0, -20.0)))
    worst = found.largest[0]
    assert (worst.collection, worst.sensor, worst.pattern) == (key, "rgb_2", PATTERN)
    assert worst.kind == "reprojection" and worst.unit == "px"
    assert worst.id == cell.collections[key].labels[("rgb_2", PATTERN)].ids[5]
    assert worst.residual == pytest.approx(np.hypot(30.0, 20.0), abs=1.5)
    assert worst.sigmas == pytest.approx(worst.residual / 0.3, rel=0.1)


def test_a_wrong_range_point_is_named_by_its_index_in_the_cloud(cell):
    key = next(k for k, c in cell.collections.items() if ("lidar_1", PATTERN) in c.labels)
    index = cell.collections[key].labels[("lidar_1", PATTERN)].indices[7]
    cloud = cell.data.read(key, "lidar_1").copy()
    cloud[index] *= 1.2

    class OnePointWrong:
        """The same data but for one point."""

        def read(self, collection, sensor):
            same = (collection, sensor) != (key, "lidar_1")
            return cell.data.read(collection, sensor) if same else cloud

        def __getattr__(self, method):
            return getattr(cell.data, method)

    worst = found_in(replace(cell, data=OnePointWrong())).largest[0]
    assert (worst.collection, worst.sensor, worst.id) == (key, "lidar_1", index)
    assert worst.unit == "m"


def test_the_list_is_capped_and_the_count_is_not(cell, monkeypatch):
    every = found_in(cell)
    monkeypatch.setattr(outliers, "MOST_LISTED", 5)
    capped = found_in(cell)
    assert capped.counts == every.counts and sum(capped.counts.values()) > 5
    assert capped.largest == every.largest[:5]
    sizes = [outlier.sigmas for outlier in every.largest]
    assert sizes == sorted(sizes, reverse=True) and min(sizes) > outliers.OUTLIER_SIGMAS
