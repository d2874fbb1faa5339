"""A launch file whose work is done ends as after Ctrl-C; only a failure looks like one."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from masters import reserved_port, running_master

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("roslaunch") is None, reason="roslaunch is not installed"),
]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ends")
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=0, collections=6)
    return write_dataset_folder(scene.dataset, folder / "data", name="ends")


CALIBRATE = ("atom_calibration", "calibrate.launch", "rviz:=false", "stay:=false")
CALIBRATE += ("options:=--no_report",)
PLAYBACK = ("atom_calibration", "dataset_playback.launch", "rviz:=false")
EVALUATE = (str(ROOT / "atom_examples" / "collab_cell" / "launch" / "full_evaluation.launch"),)
EVALUATE += ("report:=false",)
FROM_BAG = ("atom_calibration", "calibrate_from_bag.launch", "report:=false")


def launched(folder, *words, file=CALIBRATE):
    """Run a launch file, which starts its master, to its end; return exit code and prints."""
    with reserved_port() as port:
        place = {"ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOME": str(folder / "ros")}
        return launched_below(place, folder, ("-p", str(port), *file), *words)


def launched_below(place, folder, file, *words):
    """Run a launch file to its end, below the master of an environment."""
    done = subprocess.run(
        ["roslaunch", *file, *words],
        cwd=folder,
        env={**os.environ, **place, "PWD": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout


def test_success_does_not_look_like_a_crash(dataset, tmp_path):
    code, printed = launched(tmp_path, f"dataset:={dataset}", f"output:={tmp_path}/results")
    assert code == 0 and "verdict: " in printed, printed
    assert "REQUIRED" not in printed and "died" not in printed and "Traceback" not in printed
    assert (tmp_path / "results" / "calibration.json").is_file()


def test_a_failure_does_and_a_relative_path_is_told_with_where_it_was_looked_for(tmp_path):
    code, printed = launched(tmp_path, "dataset:=data/none.json", "output:=results")
    assert "REQUIRED process [calibrate" in printed and "exit code 2" in printed
    assert f"data/none.json: no such file, looked for at {tmp_path}/data/none.json;" in printed
    assert not (tmp_path / "results").exists()


def test_an_evaluation_ends_by_itself_also_with_a_master_of_its_own(dataset, tmp_path):
    words = (f"train_json:={dataset}", f"test_json:={dataset}", f"output:={tmp_path}/tables")
    code, printed = launched(tmp_path, *words, file=EVALUATE)
    assert code == 0 and "verdict: " in printed, printed
    assert "REQUIRED" not in printed and "died" not in printed and "Traceback" not in printed
    assert (tmp_path / "tables" / "evaluation.json").is_file()
    _, printed = launched(tmp_path, *words, file=EVALUATE)  # a refusal: the folder is not empty
    assert "overwrite:=true" in printed and "REQUIRED process [evaluate" in printed


def test_a_user_who_quits_sees_no_crash(dataset, tmp_path):
    quits = "until rosservice call /dataset_playback/quit; do sleep 0.5; done"
    with running_master(tmp_path) as environment:
        asking = subprocess.Popen(["bash", "-c", quits], env={**os.environ, **environment})
        code, printed = launched_below(environment, tmp_path, PLAYBACK, f"dataset:={dataset}")
        assert asking.wait(60) == 0
    assert code == 0 and "nothing was corrected" in printed, printed
    assert "REQUIRED" not in printed and "died" not in printed and "Traceback" not in printed


def test_a_recording_that_cannot_be_calibrated_ends_its_launch(tmp_path):
    words = (f"config:={tmp_path}/config.yml", "bag:=none.bag", f"output:={tmp_path}/all")
    _, printed = launched(tmp_path, *words, file=FROM_BAG)
    assert "config.yml: " in printed and "REQUIRED process [calibrate_from_bag" in printed
