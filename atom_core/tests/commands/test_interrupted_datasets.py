"""Tools that write a dataset over another one, killed at any step: one of both is there."""

import json
import multiprocessing
import os
import shutil
import signal

import pytest

from atom_core.cli import main
from atom_core.io.dataset_json import read_document
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

STEPS = ("replace", "fsync", "unlink")


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Return two datasets whose data and labels differ, and whose files have the same names."""
    folder = tmp_path_factory.mktemp("given")
    return [
        write_dataset_folder(
            scenes.random_scene(seed, rgb=1, depth=0, lidar3d=1, collections=3).dataset,
            folder / str(seed),
            name="given",
        )
        for seed in (1, 2)
    ]


def killed_at(number, line):
    """Run a command line in a process that is killed at one of its steps; tell whether it was."""

    def run():
        count = iter(range(number))
        for name in STEPS:
            setattr(os, name, counted(getattr(os, name), count))
        os._exit(main(line))

    process = multiprocessing.get_context("fork").Process(target=run)
    process.start()
    process.join()
    assert process.exitcode in (0, -signal.SIGKILL)
    return process.exitcode != 0


def counted(call, count):
    def step(*args, **options):
        if next(count, None) is None:
            os.kill(os.getpid(), signal.SIGKILL)
        return call(*args, **options)

    return step


def whole(path):
    """Return what a dataset says, and the contents of the files that it names."""
    document = read_document(path)
    document.pop("_metadata")
    return json.dumps(document), *(
        (path.parent / entry["data_file"]).read_bytes()
        for collection in document["collections"].values()
        for entry in collection["data"].values()
    )


def merge(given, number, out):
    first = given[number]
    return ["merge_atom_datasets", "-ds1", first, "-ds2", first, "-dof", out, "--overwrite"]


def convert(given, number, out):
    older = given[number].with_name("older.json")
    if not older.exists():
        shutil.copyfile(given[number], older)
    convert = ["convert", "--from", "atom_v2", "--to", "atom_v3", "--dataset", older]
    return [*convert, "--output", out, "--overwrite"]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("command", [convert, merge])
def test_a_dataset_is_replaced_as_a_whole(given, tmp_path, command):
    out, runs = tmp_path / "out", []
    lines = [[str(word) for word in command(given, number, out)] for number in (0, 1)]
    for line in reversed(lines):
        assert main(line) == 0
        runs.insert(0, whole(out / "dataset.json"))
    assert runs[0] != runs[1]
    number = 0
    while killed_at(number, lines[1]):
        assert whole(out / "dataset.json") in runs
        assert main(lines[0]) == 0
        number += 1
    assert whole(out / "dataset.json") == runs[1]
    assert number > 8
    assert not [name for name in os.listdir(out) if name.startswith(".")]


# --- the order in which a disk is told: what a name stands for is on it before the name --------


def calibrate(given, number, out):
    line = ["calibrate", "-json", given[number], "-o", out, "--no_report", "--overwrite"]
    return [*line, "-ssf", "rgb_1", "lidar_1"]


def split(given, number, out):
    if not out.exists():
        shutil.copytree(given[number].parent, out)
    return ["split_atom_dataset", "-json", out / "dataset.json", "-tp", 50, "--overwrite"]


@pytest.mark.parametrize("command", [merge, convert, split, calibrate])
def test_names_are_given_to_what_is_on_the_disk_already(given, tmp_path, monkeypatch, command):
    line = [str(word) for word in command(given, 0, tmp_path / "out")]
    synced, waiting, renamed = set(), set(), []
    fsync, replace = os.fsync, os.replace

    def synchronise(descriptor):
        fsync(descriptor)
        there = os.fstat(descriptor)
        synced.add(there.st_ino)
        waiting.discard(there.st_ino)

    def rename(source, target):
        assert os.stat(source).st_ino in synced, f"{target} gets its name too early"
        replace(source, target)
        renamed.append(target)
        waiting.add(os.stat(os.path.dirname(target)).st_ino)

    monkeypatch.setattr(os, "fsync", synchronise)
    monkeypatch.setattr(os, "replace", rename)
    assert main(line) == 0
    assert renamed and not waiting, "new names are brought to the disk, too"
