"""A launch file whose work is done ends as after Ctrl-C; only a failure looks like one."""

import os
import shutil
import subprocess

import pytest
from ports import reserved_port

from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("roslaunch") is None, reason="roslaunch is not installed"),
]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ends")
    scene = scenes.random_scene(1, rgb=2, depth=0, lidar3d=0, collections=6)
    return write_dataset_folder(scene.dataset, folder / "data", name="ends")


def launched(folder, *words):
    """Run calibrate.launch without RViz to its end; return exit code and what was printed."""
    with reserved_port() as port:
        done = subprocess.run(
            ["roslaunch", "-p", str(port), "atom_calibration", "calibrate.launch", "rviz:=false"]
            + ["stay:=false", *words],
            cwd=folder,
            env={
                **os.environ,
                "ROS_MASTER_URI": f"http://localhost:{port}",
                "ROS_HOME": str(folder / "ros"),
                "PWD": str(folder),
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
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
