"""A dataset assembled from its collections is the dataset; what breaks leaves the rest whole."""

import itertools
import json
import os
import shutil

import pytest

from atom_core.cli import main
from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import write_bytes_atomically
from atom_core.io.collections import CollectionStore, StoredCollection, recover_dataset
from atom_core.io.dataset_json import read_dataset, read_document
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    write_dataset_folder(scenes.two_cameras().dataset, folder, name="scene", overwrite=True)
    return folder


@pytest.fixture
def collected(whole, tmp_path):
    """The same dataset as a collector leaves it that was stopped before the end."""
    document = read_document(whole / "dataset.json")
    store = CollectionStore.create(tmp_path / "dataset")
    store.write_header(document)
    for key, collection in document["collections"].items():
        for entry in collection["data"].values():
            shutil.copy(whole / entry["data_file"], store.folder)
        initial = {n: p["transforms_initial"][key] for n, p in document["patterns"].items()}
        store.save(StoredCollection(key, collection, initial))
    return store


def test_assembled_equals_written_at_once(whole, collected):
    path, warnings = collected.assemble()
    assert warnings == []
    assert read_document(path) == read_document(whole / "dataset.json")


def test_recover_assembles_and_does_not_replace_unless_asked(collected, capsys):
    assert main(["recover", str(collected.folder)]) == 0
    assert "2 sensors" in capsys.readouterr().out
    assert main(["recover", str(collected.folder)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["recover", str(collected.folder), "--overwrite"]) == 0


def test_a_collection_without_its_data_is_left_out_and_named(collected):
    victim = collected.keys[1]
    name = next(iter(collected.load(victim).document["data"].values()))["data_file"]
    (collected.folder / name).unlink()
    path, warnings = recover_dataset(collected.folder)
    assert victim not in read_dataset(path).collections and f"collection {victim}" in warnings[0]


def test_a_half_written_file_of_a_crash_is_not_taken_for_a_collection(collected):
    count = len(collected.keys)
    (collected.folder / "collections" / ".007.json.abc.tmp").write_text('{"coll')
    assert len(read_dataset(recover_dataset(collected.folder)[0]).collections) == count


def test_a_damaged_collection_is_named(collected):
    damaged = collected.folder / "collections" / "000.json"
    damaged.write_text(damaged.read_text()[:100])
    with pytest.raises(DatasetError, match="000.json.*damaged.*move it away"):
        recover_dataset(collected.folder)


def test_a_folder_without_collections_is_refused(tmp_path, collected):
    with pytest.raises(DatasetError, match="no folder 'collections'"):
        recover_dataset(tmp_path)
    (collected.folder / "collections" / "header.json").unlink()
    with pytest.raises(DatasetError, match=r"header\.json: absent"):
        recover_dataset(collected.folder)


def test_delete_removes_the_collection_and_its_data_and_the_key_is_not_given_again(collected):
    first, last = collected.keys[0], collected.keys[-1]
    files = len(list(collected.folder.iterdir()))
    collected.delete(first)
    assert first not in collected.keys and len(list(collected.folder.iterdir())) < files
    assert int(collected.next_key) == int(last) + 1
    with pytest.raises(DatasetError, match=f"no collection {first}"):
        collected.delete(first)


def test_a_folder_in_use_is_only_taken_when_asked_and_then_cleared(collected):
    with pytest.raises(OutputError, match="--overwrite"):
        CollectionStore.create(collected.folder)
    assert collected.keys
    assert CollectionStore.create(collected.folder, overwrite=True).keys == []


# ---- a dataset that is to be replaced


def files_of(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def assembled(collected):
    """The folder of a dataset, with what others have put there."""
    collected.assemble()
    (collected.folder / "pictures").mkdir()
    (collected.folder / "pictures" / "000.jpg").write_bytes(b"picture")
    (collected.folder / "notes.txt").write_text("mine")
    return collected.folder


def begun_anew(folder):
    """Begin another run over a dataset, as far as its first collection."""
    document = read_document(folder / "dataset.json")
    key, collection = next(iter(document["collections"].items()))
    store = CollectionStore.create(folder, overwrite=True, beside=["pictures"])
    store.write_header(document)
    for entry in collection["data"].values():
        (folder / entry["data_file"]).write_bytes(b"new")
    store.save(StoredCollection(key, collection, {}))
    return store


def test_the_dataset_of_before_is_kept_until_the_new_one_is_whole(assembled):
    before = files_of(assembled)
    store = begun_anew(assembled)
    kept = files_of(assembled / "previous")
    assert {name for name in before if name not in kept} == {"notes.txt"}
    assert all(before[name] == data for name, data in kept.items())
    assert read_dataset(assembled / "previous" / "dataset.json").collections
    store.assemble()
    store.keep()
    assert not (assembled / "previous").exists() and (assembled / "notes.txt").is_file()
    assert len(read_dataset(assembled / "dataset.json").collections) == 1


def test_after_a_kill_either_dataset_can_be_had(assembled, capsys):
    before = files_of(assembled)
    begun_anew(assembled)
    # a second try over what the killed one has left: the dataset of before is still the kept one
    CollectionStore.create(assembled, overwrite=True, beside=["pictures"])
    assert files_of(assembled / "previous").items() <= before.items()
    assert main(["recover", str(assembled), "--previous"]) == 0
    assert files_of(assembled) == before
    assert main(["recover", str(assembled), "--previous"]) == 2
    assert "no earlier dataset is kept" in capsys.readouterr().err


def test_a_run_that_collects_nothing_brings_the_dataset_back(assembled):
    before = files_of(assembled)
    store = CollectionStore.create(assembled, overwrite=True, beside=["pictures"])
    assert not (assembled / "dataset.json").exists()
    assert store.give_up_if_empty()
    assert files_of(assembled) == before


def test_a_kill_amid_the_setting_aside_is_undone(assembled, monkeypatch):
    before = files_of(assembled)
    replace = os.replace
    for number in range(len(before) + 1):
        calls = itertools.count()

        def killed(*paths, calls=calls, number=number):
            if next(calls) == number:
                raise SystemExit  # no handler of ours catches it: as a kill, between two steps
            replace(*paths)

        monkeypatch.setattr("os.replace", killed)
        with pytest.raises(SystemExit):
            CollectionStore.create(assembled, overwrite=True, beside=["pictures"])
            raise SystemExit
        monkeypatch.undo()
        assert main(["recover", str(assembled), "--previous"]) == 0
        assert files_of(assembled) == before


def test_a_kill_amid_the_removing_leaves_no_collection_without_its_data(
    collected, tmp_path, monkeypatch
):
    unlink, files = type(tmp_path).unlink, len(files_of(collected.folder))
    for number in range(files):
        folder = shutil.copytree(collected.folder, tmp_path / str(number))
        calls = itertools.count()

        def killed(path, *args, calls=calls, number=number):
            if next(calls) == number:
                raise SystemExit
            unlink(path, *args)

        monkeypatch.setattr(type(tmp_path), "unlink", killed)
        with pytest.raises(SystemExit):
            CollectionStore(folder).begin_anew()
        monkeypatch.undo()
        assert len(files_of(folder)) == files - number
        keys = CollectionStore(folder).keys
        if keys:
            path, warnings = recover_dataset(folder)
            assert list(read_dataset(path).collections) == keys and not warnings


def test_files_outside_of_the_folder_are_not_touched(assembled):
    outside = assembled.parent / "others.jpg"
    outside.write_bytes(b"precious")
    path = assembled / "dataset.json"
    document = json.loads(path.read_text())
    entry = next(iter(next(iter(document["collections"].values()))["data"].values()))
    for name in ("../others.jpg", str(outside)):
        entry["data_file"] = name
        path.write_text(json.dumps(document))
        store = CollectionStore.create(assembled, overwrite=True)
        assert outside.read_bytes() == b"precious"
        store.give_up_if_empty()


def test_a_full_disk_leaves_the_other_collections_whole(collected, monkeypatch):
    before, stored = collected.keys, collected.load(collected.keys[0])

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OutputError, match=r"099\.json.*no space left.*free some space"):
        collected.save(StoredCollection("099", stored.document, {}))
    monkeypatch.undo()
    assert collected.keys == before
    write_bytes_atomically(collected.folder / "x", b"")
    assert len(read_dataset(recover_dataset(collected.folder)[0]).collections) == len(before)


def test_an_edge_that_differs_between_collections_is_multiple(collected):
    name = "world-rig_base"
    move(collected, name)
    edges = read_document(collected.assemble()[0])["transforms"]
    assert edges[name]["type"] == "multiple"
    assert {e["type"] for n, e in edges.items() if n != name} <= {"fixed"}


def move(collected, name):
    """Move an edge in the first collection, as where it was corrected after that."""
    path = collected.folder / "collections" / "000.json"
    document = json.loads(path.read_text())
    document["collection"]["transforms"][name]["trans"][0] += 0.1
    path.write_text(json.dumps(document))


def test_a_sensors_edge_whose_guess_was_improved_between_collections_stays_fixed(collected):
    dataset = read_dataset(collected.assemble()[0])
    anchored = dataset.config.anchored_sensor
    for name, sensor in dataset.sensors.items():
        move(collected, str(sensor.edge))
        kind = read_dataset(collected.assemble()[0]).edge_types[sensor.edge]
        assert kind == ("multiple" if name == anchored else "fixed")
