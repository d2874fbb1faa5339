"""Documents of datasets that tests read, change and damage."""

from copy import deepcopy

import pytest

from atom_core.errors import DatasetError
from atom_core.io.dataset_json import dumps, read_dataset
from atom_core.io.dataset_writer import new_document
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def fresh():
    """Return a document of version 3: rgb_1, rgb_2, depth_1, lidar_1, three collections."""
    return new_document(scenes.random_scene(0, collections=3).dataset, name="fresh")


@pytest.fixture
def document(fresh):
    return deepcopy(fresh)


@pytest.fixture
def read(tmp_path):
    """Return a function: document -> the dataset read from a file of it."""

    def from_file(document):
        path = tmp_path / "dataset.json"
        path.write_text(dumps(document))
        return read_dataset(path)

    return from_file


@pytest.fixture
def refusal(read):
    """Return a function: document -> the one line with which it is refused."""

    def message(document):
        with pytest.raises(DatasetError) as caught:
            read(document)
        line = str(caught.value)
        assert "dataset.json" in line and "\n" not in line and "Traceback" not in line
        return line

    return message


@pytest.fixture
def first_label():
    """Return a function: document, sensor -> its first detected label, and the collection."""

    def found(document, sensor):
        for key, collection in sorted(document["collections"].items()):
            label = collection["labels"]["pattern_1"][sensor]
            if label["detected"]:
                return label, key
        raise AssertionError("nothing detected")

    return found
