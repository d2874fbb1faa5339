"""Results of `calibrate` replace those of the run before, and never better ones."""

import json

import pytest

from atom_core.cli import main
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


def test_what_did_not_converge_replaces_nothing_that_did(tmp_path, capsys):
    scene = scenes.two_cameras()
    write_dataset_folder(scene.dataset, tmp_path / "data", name="train")
    words = ["calibrate", "--dataset", str(tmp_path / "data" / "dataset.json"), "--overwrite"]
    words += ["--output", str(tmp_path / "out")]
    one_iteration, aside = ["--max_iterations", "1"], tmp_path / "out" / "not_converged"

    def status(folder):
        return json.loads((folder / "calibration.json").read_text())["status"]

    assert main([*words, "--save_calibration_errors"]) == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    assert main([*words, *one_iteration]) == 1
    now = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir() if path.is_file()}
    assert now == before and status(aside) == "not_converged"
    told = capsys.readouterr().out
    assert f"stay in {tmp_path / 'out'}" in told and f"results: {aside}" in told
    assert read_dataset(aside / "atom_calibration.json").data.has_data(
        "000", next(iter(scene.dataset.sensors))
    )
    assert main(words) == 0
    assert not aside.exists() and status(tmp_path / "out") == "converged"
    assert not (tmp_path / "out" / "calibration_errors.csv").exists()  # of another run


@pytest.mark.parametrize(
    "text, reason",
    [
        ("<robot><link", "robot.urdf: "),
        (None, "robot.urdf: there is no such robot description"),
    ],
)
def test_why_there_is_no_description_is_told(tmp_path, capsys, text, reason):
    write_dataset_folder(scenes.two_cameras().dataset, tmp_path / "data", name="train")
    path = tmp_path / "data" / "dataset.json"
    document = json.loads(path.read_text())
    document["calibration_config"]["description_file"] = str(tmp_path / "robot.urdf")
    path.write_text(json.dumps(document))
    if text is not None:
        (tmp_path / "robot.urdf").write_text(text)
    assert main(["calibrate", "--dataset", str(path), "--output", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert f"optimized.urdf.xacro is not written: {tmp_path}/{reason}" in told
    assert not (tmp_path / "out" / "optimized.urdf.xacro").exists()
