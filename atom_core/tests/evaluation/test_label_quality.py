"""Figures of single labels: what is wrong stands out, what determines nothing is not measured."""

import numpy as np
import pytest

from atom_core.evaluation.label_quality import label_quality
from atom_core.model.labels import DetectionKey, RangeLabel, RgbLabel
from atom_core.synthetic import scenes
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.noise import Noise

KEY = "001"


@pytest.fixture(scope="module")
def dataset():
    return scenes.random_scene(
        2, rgb=2, depth=1, lidar3d=1, collections=3, sampling=Sampling(background_step=2)
    ).dataset


def key_of(dataset, sensor):
    (pattern,) = dataset.patterns
    return DetectionKey(KEY, sensor, pattern)


def relabeled(dataset, key, label):
    return dataset.with_labels(key.collection, {(key.sensor, key.pattern): label})


def test_corners_without_noise_fit_their_board():
    exact = scenes.random_scene(2, rgb=1, depth=0, lidar3d=0, collections=3, noise=Noise.none())
    found = label_quality(exact.dataset, key_of(exact.dataset, "rgb_1"))
    assert found.unit == "px" and found.rms < 1e-6


def test_the_corner_that_is_off_is_named(dataset):
    key = key_of(dataset, "rgb_1")
    label = dataset.label(key)
    pixels = label.pixels.copy()
    pixels[13] += [8.0, -6.0]
    found = label_quality(relabeled(dataset, key, RgbLabel(label.ids, pixels)), key)
    assert found.worst_item == label.ids[13]
    assert 8.0 < found.worst < 10.5  # the pose gives way a little
    assert found.rms > 2 * label_quality(dataset, key).rms


@pytest.mark.parametrize("sensor", ["lidar_1", "depth_1"])
def test_the_point_that_is_off_the_plane_is_named(dataset, sensor):
    key = key_of(dataset, sensor)
    label = dataset.label(key)
    found = label_quality(dataset, key)
    assert (found.points, found.border_points) == (len(label.indices), len(label.limit_indices))
    assert 0.0 < found.rms <= found.worst < 0.05 and found.unit == "m"
    if sensor == "depth_1":
        data = np.isfinite(dataset.data.read(KEY, sensor)).ravel()
    else:
        data = np.all(np.isfinite(dataset.data.read(KEY, sensor)), axis=1)
    stray = np.setdiff1d(np.flatnonzero(data), [*label.indices, *label.limit_indices])[-1]
    more = RangeLabel(np.append(label.indices, stray), label.limit_indices)
    wrong = label_quality(relabeled(dataset, key, more), key)
    assert wrong.worst_item == stray and wrong.worst > 0.2


def test_what_too_few_items_do_not_determine_is_unknown(dataset):
    corners, points = key_of(dataset, "rgb_1"), key_of(dataset, "lidar_1")
    label = dataset.label(corners)
    few = relabeled(dataset, corners, RgbLabel(label.ids[:2], label.pixels[:2]))
    label = dataset.label(points)
    few = relabeled(few, points, RangeLabel(label.indices[:2], label.limit_indices[:0]))
    for key in (corners, points):
        found = label_quality(few, key)
        assert found.points == 2 and np.isnan(found.rms) and found.worst_item == -1
