"""One wrong label is told as what it is, not as a sensor that was moved meanwhile."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.geometry import se3
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import scenes
from atom_core.synthetic.mistakes import move_about, with_moved_sensor

SHIFT_PX = np.array([2.5, -2.6])


def with_shifted_label(dataset, sensor, collection):
    """Return the dataset in which all corners of one label are off alike by 3.6 px."""
    labels = {
        place: RgbLabel(label.ids, label.pixels + SHIFT_PX) if place[0] == sensor else label
        for place, label in dataset.collections[collection].labels.items()
    }
    changed = replace(dataset.collections[collection], labels=labels)
    return replace(dataset, collections={**dataset.collections, collection: changed})


# (scene, sensor, collection): near the beginning or the end, where the others on its side are few
LABELS = [
    (lambda: scenes.random_scene(0, depth=0, collections=20), "rgb_2", "016"),
    (lambda: scenes.random_scene(1, rgb=3, depth=0, lidar3d=0, collections=10), "rgb_2", "006"),
    (lambda: scenes.two_cameras(7, collections=20), "rgb_2", "002"),
]


@pytest.mark.parametrize("make, sensor, collection", LABELS)
def test_a_wrong_label_is_named_with_its_collection(make, sensor, collection):
    dataset = make().dataset
    result = calibrate(with_shifted_label(dataset, sensor, collection))
    names, _, rest = result.message.partition(" seems to be elsewhere in ")
    assert sensor in names.split(" or ")
    assert rest.startswith(f"collection {collection} alone, by ")
    assert f"or leave it out (-csf '!{collection}')" in result.message
    assert "was moved" not in result.message
    others = [key for key in dataset.collections if key != collection]
    assert calibrate(dataset.selected(collections=others)).status == "converged"


@pytest.mark.parametrize("seed, sensor, first", [(34, "rgb_1", "003"), (28, "lidar_1", "003")])
def test_a_sensor_that_was_moved_after_few_collections_is_told_as_moved(seed, sensor, first):
    count = {34: 8, 28: 14}[seed]
    scene = scenes.random_scene(seed, rgb=2, depth=0, lidar3d=1, collections=count)
    rig = scenes.random_rig(np.random.default_rng([seed, 100]), 2, 0, 1)
    rng = np.random.default_rng(1)
    eye = rig.pose(scene.dataset.sensors[sensor].frame)[:3, 3]
    turn, shift = 0.015 * se3.random_direction(rng), 0.018 * se3.random_direction(rng)
    moved = with_moved_sensor(scene, rig, sensor, first, move_about(eye, turn, shift), rng)
    result = calibrate(moved)
    assert f"{sensor} was moved between collections 00" in result.message
    assert " alone, by " not in result.message
