"""Where an output stands is told as an absolute path, also where a relative one was typed."""

import sys
from pathlib import Path

import pytest

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share
from command_line import run  # noqa: E402


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
