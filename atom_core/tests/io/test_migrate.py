"""A migrated dataset has a copy of its data, and of nothing else."""

import json
import shutil

import pytest

from atom_core.errors import DatasetError
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.migrate import migrate_dataset
from atom_core.synthetic import scenes


@pytest.fixture
def path(tmp_path):
    scene = scenes.two_cameras(0, collections=2)
    return write_dataset_folder(scene.dataset, tmp_path / "dataset", name="two")


def with_data(path, change):
    """Change the entries of data of each collection; return those of the first."""
    document = json.loads(path.read_text("utf-8"))
    for key, collection in document["collections"].items():
        change(key, collection["data"])
    path.write_text(json.dumps(document), "utf-8")
    return next(iter(document["collections"].values()))["data"]


def names_in(folder):
    return sorted(file.name for file in folder.rglob("*") if file.is_file())


def test_data_are_copied_as_they_are(path, tmp_path):
    new = migrate_dataset(path, tmp_path / "new", overwrite=False)
    assert names_in(new.parent) == names_in(path.parent)
    assert list(read_dataset(new).collections) == ["000", "001"]
    name = with_data(path, lambda key, data: None)["rgb_1"]["data_file"]
    assert (new.parent / name).read_bytes() == (path.parent / name).read_bytes()


def test_a_file_that_holds_no_data_is_not_copied_from_elsewhere(path, tmp_path):
    (tmp_path / "secret.txt").write_text("mine")
    with_data(path, lambda key, data: data["rgb_1"].update(data_file="../secret.txt"))
    new = migrate_dataset(path, tmp_path / "new", overwrite=False)
    assert "secret.txt" not in names_in(new.parent)


def test_a_sensor_without_data_has_nothing_to_copy(path, tmp_path):
    with_data(path, lambda key, data: data.update(rgb_1=None))
    new = migrate_dataset(path, tmp_path / "new", overwrite=False)
    assert [name for name in names_in(new.parent) if name.startswith("rgb_1")] == []


def test_files_of_one_name_do_not_take_the_place_of_one_another(path, tmp_path):
    def into_a_folder_of_its_own(key, data):
        source = path.with_name(data["rgb_1"]["data_file"])
        target = path.parent / key / "rgb_1.png"
        target.parent.mkdir()
        shutil.move(str(source), str(target))
        data["rgb_1"]["data_file"] = f"{key}/rgb_1.png"

    with_data(path, into_a_folder_of_its_own)
    with pytest.raises(DatasetError, match=r"000/rgb_1.png.*001/rgb_1.png"):
        migrate_dataset(path, tmp_path / "new", overwrite=False)
    assert not (tmp_path / "new" / "dataset.json").exists()
