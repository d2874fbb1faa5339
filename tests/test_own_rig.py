"""The page "Your own rig": run as it stands, with a simulation in the place of the recordings."""

import json
import os
import re
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="ROS is not installed")
ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tutorials" / "own_rig.md"
MOST_COMMANDS = 12

CAMERA = """
  {name}:
    modality: rgb
    frame: {name}_optical
    topic: /{name}/image_raw
    camera_info_topic: /{name}/camera_info
    rate_hz: 10.0
    width: 960
    height: 640
    K: [831.0, 0.0, 479.5, 0.0, 831.0, 319.5, 0.0, 0.0, 1.0]
    distortion_model: plumb_bob
    D: [0.0, 0.0, 0.0, 0.0, 0.0]
    noise: {{sigma_grey: 2.0}}
"""
LIDAR = """
  lidar:
    modality: lidar3d
    frame: lidar
    topic: /lidar/points
    rate_hz: 10.0
    rings: 16
    elevation_deg: [-15.0, 15.0]
    azimuth_steps: 1800
    range_m: [0.9, 130.0]
    beam_divergence_rad: 0.003
    noise: {sigma_m: 0.008, dropout: 0.02, mixed_within_beams: 0.5}
"""
SCENARIO = """
room: {low: [-3.5, -3.5, 0.0], high: [4.5, 3.5, 3.0]}
boards:
  board:
    carried: {low: [1.4, -0.5, 0.6], high: [2.2, 0.5, 1.3], faces: [[0.0, 0.0, 1.4]], tilt_deg: 30}
stops: {train: 18, test: 6}
seen: {detections: 2, part: 0.6}
"""


def commands():
    """Return the command lines of the page, in order."""
    text = re.sub(r"^```.*?^```", "", PAGE.read_text(encoding="utf-8"), flags=re.M | re.S)
    return re.findall(r"^    (\S.*?)(?:\s+#.*)?$", text, re.M)


def block(language):
    """Return the file that the page shows in a language."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.M | re.S)
    return text


def test_it_is_few_commands_and_the_files_are_whole():
    assert 8 <= len(commands()) <= MOST_COMMANDS
    assert block("xml").count("<joint") == 7
    for name in ("left", "right", "lidar"):
        assert f"  {name}:" in block("yaml")


def test_the_page_says_the_number_of_its_commands():
    names = {10: "ten", 11: "eleven", 12: "twelve"}
    assert f"in {names[len(commands())]} commands" in PAGE.read_text(encoding="utf-8")


@pytest.fixture
def home(tmp_path):
    """Return an empty home, and the environment of a shell in it."""
    variables = {**os.environ, "HOME": str(tmp_path), "ROS_HOME": str(tmp_path / "ros")}
    variables["ROS_BAGS"] = str(tmp_path / "bags")
    return tmp_path, variables


def run(line, folder, variables):
    done = subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def write_package(home):
    """Do what the page asks to be written by hand."""
    package = home / "catkin_ws" / "src" / "my_rig"
    (package / "urdf").mkdir(exist_ok=True)
    (package / "urdf" / "my_rig.urdf").write_text(block("xml"), encoding="utf-8")
    (package / "calibration" / "config.yml").write_text(block("yaml"), encoding="utf-8")


def write_robot(home):
    """Return the folder of the rig for the simulator: where sensors really are, the page says."""
    folder = home / "robot"
    (folder / "config").mkdir(parents=True)
    description = home / "true.urdf"
    description.write_text(block("xml"), encoding="utf-8")
    config = block("yaml").replace("package://my_rig/urdf/my_rig.urdf", str(description))
    (folder / "config" / "config.yml").write_text(config, encoding="utf-8")
    sensors = "sensors:\n" + CAMERA.format(name="left") + CAMERA.format(name="right") + LIDAR
    (folder / "config" / "sensors.yaml").write_text(sensors, encoding="utf-8")
    (folder / "config" / "scenario.yaml").write_text(SCENARIO, encoding="utf-8")
    return folder


def record(line, home, robot, variables):
    """Simulate a bag with the topics of a `rosbag record` of the page and no others: no /tf."""
    bag = Path(line.split()[3].replace("~", str(home)))
    whole = bag.with_name(f"whole_{bag.name}")
    made = f"rosrun atom_examples robot_simulator --robot {robot} --bag {whole}"
    run(f"{made} --scenario {bag.stem} --seed 0", home, variables)
    topics = " or ".join(f"topic == '{topic}'" for topic in line.split()[4:])
    run(f'rosbag filter {whole} {bag} "{topics}"', home, variables)
    whole.unlink()


@pytest.mark.long(minutes=15)
def test_from_an_empty_package_to_figures(home):
    folder, variables = home
    robot, printed = write_robot(folder), {}
    for line in commands():
        if line.startswith("source"):
            continue  # this shell has it
        if line.startswith("export"):
            source = folder / "catkin_ws" / "src"
            variables["ROS_PACKAGE_PATH"] += f"{os.pathsep}{source}"
            continue
        if line.startswith("rosbag record"):
            record(line, folder, robot, variables)
            continue
        printed[line.split(" --")[0]] = run(line, folder, variables)
        if "create_calibration_pkg" in line:
            write_package(folder)
    assert "next: roslaunch my_rig" in printed["rosrun my_rig configure"]
    for command in ("check", "calibrate", "evaluate"):
        assert "verdict: " in printed[f"rosrun atom_calibration {command}"]
    assert (folder / "data" / "calibration" / "optimized.urdf.xacro").is_file()
    found = json.loads((folder / "data" / "calibration" / "calibration.json").read_text("utf-8"))
    measured = json.loads((folder / "data" / "evaluation" / "evaluation.json").read_text("utf-8"))
    assert found["status"] == "converged" and measured["verdict"]["grade"] == "good"
    for edge in found["edges"].values():
        moved = [abs(v) for v in off_from_the_page(edge)]
        assert max(moved) < 0.01, edge["child"]


def off_from_the_page(edge):
    """Return how far an edge is from what the page says [m], which is the truth here."""
    mount = re.search(
        rf'<parent link="{edge["parent"]}"/> <child link="{edge["child"]}"/> '
        rf'<origin xyz="([^"]*)"',
        block("xml"),
    )
    true = [float(v) for v in mount.group(1).split()]
    return [a - b for a, b in zip(edge["translation_m"], true)]
