"""What the launch files ask of the master."""

import subprocess
from pathlib import Path

import pytest
import yaml

LAUNCH = Path(__file__).resolve().parents[1] / "launch"
NO_RVIZ = "rviz:=false"


def parameters(name, *arguments):
    """Return what roslaunch would set."""
    command = ["roslaunch", "--dump-params", str(LAUNCH / name), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return yaml.safe_load(result.stdout)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("dataset_playback.launch", ["dataset:=a.json"]),
        ("transform_corrector.launch", ["json:=a.json"]),
        ("calibrate.launch", ["dataset:=a.json", "output:=b"]),
    ],
)
def test_what_plays_nothing_needs_no_clock_that_an_earlier_launch_left_behind(name, arguments):
    assert parameters(name, *arguments, NO_RVIZ)["/use_sim_time"] is False


def test_beside_a_running_system_the_clock_is_left_alone():
    arguments = ["dataset:=a.json", "output:=b", "tf:=calibrated", NO_RVIZ]
    assert "/use_sim_time" not in parameters("calibrate.launch", *arguments)
