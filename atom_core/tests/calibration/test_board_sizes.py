"""Clouds are looked at for the size of boards one after the other, whatever they are together."""

import weakref
from dataclasses import replace

import pytest

from atom_core import native
from atom_core.calibration.board_sizes import look_at_boards
from atom_core.model.dataset import DataSource
from atom_core.synthetic.scenes import random_scene

pytestmark = pytest.mark.skipif(not native.available(), reason="needs the compiled module")


class Watched(DataSource):
    """Another source; knows how many of the clouds that it gave are in memory at most."""

    def __init__(self, source):
        self.source, self.given, self.most = source, [], 0

    def has_data(self, collection, sensor):
        return self.source.has_data(collection, sensor)

    def read(self, collection, sensor):
        data = self.source.read(collection, sensor).copy()
        self.given.append(weakref.ref(data))
        self.most = max(self.most, sum(given() is not None for given in self.given))
        return data


def test_no_two_collections_clouds_are_in_memory_together():
    dataset = random_scene(0, rgb=1, depth=0, lidar3d=1, collections=6).dataset
    data = Watched(dataset.data)
    sides, _ = look_at_boards(replace(dataset, data=data))
    assert len(data.given) >= 4 and {side.sensor for side in sides} == {"lidar_1"}
    assert data.most <= 2, "the one that is read, and the one before it"
