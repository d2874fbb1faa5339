"""What stands between the world and a sensor is there in each collection, or named."""

from dataclasses import replace

import pytest

from atom_core.errors import DatasetError
from atom_core.problem.builder import FreeEdges, check_edges
from atom_core.synthetic import scenes


def test_a_transform_that_one_collection_lacks_is_named_with_its_sensor():
    dataset = scenes.random_scene(0, collections=3).dataset
    (edge,) = (e for e in dataset.collections["001"].transforms if e.child == "lidar_1")
    transforms = dict(dataset.collections["001"].transforms)
    del transforms[edge]
    lacking = replace(dataset.collections["001"], transforms=transforms)
    dataset = replace(dataset, collections={**dataset.collections, "001": lacking})
    words = f"collection 001: transform '{edge}', on the way from 'world' to sensor 'lidar_1'"
    with pytest.raises(DatasetError, match=words):
        check_edges(dataset, FreeEdges())
    unseen = {key: label for key, label in lacking.labels.items() if key[0] != "lidar_1"}
    lacking = replace(lacking, labels=unseen)
    check_edges(replace(dataset, collections={**dataset.collections, "001": lacking}), FreeEdges())
