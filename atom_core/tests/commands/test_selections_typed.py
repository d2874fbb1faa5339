"""Selections on the command line of `calibrate`: what they name, and what they may not do."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a dataset with an additional tf on which nothing stands."""
    folder = tmp_path_factory.mktemp("cell")
    scene = scenes.random_scene(0, collections=8, disturbance=(0.05, 0.05))
    path = write_dataset_folder(scene.dataset, folder / "data", name="train")
    document = json.loads(path.read_text())
    tf = {"parent_link": "world", "child_link": "nowhere"}
    document["calibration_config"].update(additional_tfs={"odom": tf})
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    "words, says",
    [
        (["-ssf", "front_*"], "no sensor matches 'front_*'"),
        (["-atsf", "base"], "no additional tf matches 'base'; there are: odom"),
        (["-ssf", "lambda s: __import__('os').system('touch owned')"], "not allowed"),
    ],
)
def test_what_names_nothing_or_is_code_is_refused(path, tmp_path, capsys, words, says):
    output = tmp_path / "out"
    assert says in refused(capsys, "calibrate", "--dataset", path, "--output", output, *words)
    assert not output.exists()


@pytest.mark.parametrize("words", [["-atsf", "lambda t: t != 'odom'"], ["-jsf", "lambda j: True"]])
def test_a_condition_that_holds_for_nothing_estimates_nothing_further(path, tmp_path, words):
    common = ["calibrate", "--dataset", path, "-atsf", "!odom"]
    run(*common, *words, "--output", tmp_path / "out")
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert "world-nowhere" not in document["edges"] and document["joints"] == {}
