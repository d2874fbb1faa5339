"""A LiDAR against a camera by picked corners: which collections count."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.evaluation.corner_baseline import as_named, corner_pairs
from atom_core.geometry import se3
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import Noise, scenes


@pytest.fixture(scope="module")
def scene():
    return scenes.random_scene(0, rgb=1, depth=0, lidar3d=1, collections=4, noise=Noise.none())


def picked_at_the_truth(scene, lidar_T_world):
    border = scene.dataset.patterns["pattern_1"].border.corners
    corners = np.column_stack([border, np.zeros(4)])
    boards = {key: scene.truth.boards["pattern_1", key] for key in scene.dataset.collections}
    return {key: se3.apply(lidar_T_world @ board, corners) for key, board in boards.items()}


def without_label(dataset, key):
    empty = {("rgb_1", "pattern_1"): RgbLabel(np.zeros(0, dtype=int), np.zeros((0, 2)))}
    collection = dataset.collections[key]
    labels = {**collection.labels, **empty}
    return replace(
        dataset, collections={**dataset.collections, key: replace(collection, labels=labels)}
    )


def test_a_collection_without_the_board_costs_the_others_nothing(scene):
    picked = picked_at_the_truth(scene, np.eye(4))
    seen = [pair.collection for pair in corner_pairs(scene.dataset, "rgb_1", "pattern_1", picked)]
    first = seen[0]
    pairs = corner_pairs(without_label(scene.dataset, first), "rgb_1", "pattern_1", picked)
    assert [pair.collection for pair in pairs] == seen[1:] and seen[1:]
    found, whole = (
        as_named(pairs),
        as_named(corner_pairs(scene.dataset, "rgb_1", "pattern_1", picked)),
    )
    np.testing.assert_allclose(found, whole, atol=1e-4)


def test_no_common_collection_is_refused(scene):
    with pytest.raises(DatasetError, match="in no collection 'rgb_1' sees 'pattern_1'"):
        corner_pairs(scene.dataset, "rgb_1", "pattern_1", {"elsewhere": np.zeros((4, 3))})
