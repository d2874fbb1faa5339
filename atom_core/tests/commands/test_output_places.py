"""Where an output stands is told as an absolute path, also where a relative one was typed."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share
from command_line import refused, run  # noqa: E402

from atom_core.commands import calibrate  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder with two datasets and results."""
    folder = tmp_path_factory.mktemp("rig")
    for seed, name in ((0, "one"), (1, "two")):
        scene = scenes.random_scene(seed, collections=5, disturbance=(0.03, 0.03))
        write_dataset_folder(scene.dataset, folder / name, name=name)
    words = ["calibrate", "--dataset", folder / "one" / "dataset.json", "--no_report"]
    run(*words, "--output", folder / "results")
    return folder


@pytest.mark.parametrize(
    "words, output",
    [
        ("calibrate --dataset one/dataset.json --output out --no_report", "out"),
        pytest.param(
            *("report --calibration results --output report", "report/report.html"),
            marks=pytest.mark.long,
        ),
        ("split_atom_dataset --dataset one/dataset.json -tp 60", "one/dataset_"),
        (
            "remove_collections_from_atom_dataset --dataset one/dataset.json -csf 000",
            "one/dataset_",
        ),
        ("estimate_pattern_poses --dataset one/dataset.json --overwrite", "one/dataset"),
        ("rename_atom_dataset --dataset_path two --name three", "three"),
    ],
)
def test_it_is_absolute(made, capsys, monkeypatch, words, output):
    monkeypatch.chdir(made)
    capsys.readouterr()
    run(*words.split())
    assert f"{made}/{output}" in capsys.readouterr().out


@pytest.fixture
def read_only(monkeypatch):
    """Return a function that lets a folder take nothing more, as one of another user."""

    def close(folder):
        real = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: path != folder and real(path, mode))

    return close


@pytest.mark.parametrize(
    "place", [["--output", "{closed}/out/run_1"], ["--output", "{closed}"], []]
)
def test_a_folder_that_takes_nothing_is_told_before_the_work(
    made, tmp_path, monkeypatch, capsys, read_only, place
):
    closed = tmp_path / "closed"
    shutil.copytree(made / "one", closed)
    read_only(closed)
    monkeypatch.setattr(calibrate, "read_input", None)  # nothing is even read
    words = ["calibrate", "--dataset", closed / "dataset.json", "-ow"]
    line = refused(capsys, *words, *(word.format(closed=closed) for word in place))
    assert "cannot be written (permission denied)" in line and str(closed) in line
    assert not (closed / "out").exists()


def test_a_file_amid_the_path_of_a_folder_is_told_before_the_work(made, monkeypatch, capsys):
    monkeypatch.setattr(calibrate, "read_input", None)
    dataset = made / "one" / "dataset.json"
    line = refused(capsys, "calibrate", "--dataset", dataset, "--output", dataset / "out")
    assert "a part of the path is a file" in line


def test_the_folder_of_a_short_table_is_asked_for_before_the_work(made, monkeypatch, capsys):
    monkeypatch.setattr(calibrate, "read_input", None)
    words = ["calibrate", "--dataset", made / "one" / "dataset.json", "-ctgt"]
    line = refused(capsys, *words, "-sfrn", made / "no" / "short.csv")
    assert "short.csv: its folder is not there" in line
