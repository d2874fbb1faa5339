"""500 collections of the live collector are whole."""

import pytest
from played_sessions import check_saves, session

from atom_core.io.dataset_json import read_dataset

pytestmark = pytest.mark.slow
pytest.importorskip("rospy")


@pytest.mark.long(minutes=10)
def test_500_collections_are_whole(tmp_path):
    figures = session(tmp_path, 125, 0.8, "keep")
    check_saves(figures, 125)
    dataset = read_dataset(tmp_path / "dataset" / "dataset.json")
    assert len(dataset.collections) == 500
    names = set(dataset.sensors)
    for key, collection in dataset.collections.items():
        assert {sensor for sensor, _ in collection.labels} == names, key
        assert all(dataset.data.has_data(key, name) for name in names), key
