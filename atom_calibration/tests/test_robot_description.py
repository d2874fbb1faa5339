"""What launch files give RViz as `robot_description`, and what they say where there is none."""

import re
import sys
from pathlib import Path

import pytest
from small_rig import XACRO

from atom_calibration.nodes.bags.robot_description import main

ROOT = Path(__file__).resolve().parents[2]
URDF = '<robot name="plain"><link name="base"/></robot>'


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def test_a_description_below_the_home_folder_is_printed(home, capsys):
    (home / "rig.urdf").write_text(URDF, encoding="utf-8")
    assert main(["~/rig.urdf"]) == 0
    assert capsys.readouterr().out.strip() == URDF


def test_a_xacro_is_expanded(home, capsys):
    (home / "rig.urdf.xacro").write_text(XACRO, encoding="utf-8")
    assert main([str(home / "rig.urdf.xacro")]) == 0
    printed = capsys.readouterr().out
    assert 'name="lidar' in printed and "xacro:macro" not in printed


def test_a_plain_description_needs_no_xacro(home, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    (home / "rig.urdf").write_text(URDF, encoding="utf-8")
    assert main([str(home / "rig.urdf")]) == 0
    assert capsys.readouterr().out.strip() == URDF


def test_one_that_is_not_there_is_one_sentence(home, capsys):
    assert main(["~/rig.urdf"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"robot_description: {home}/rig.urdf: there is no such robot")
    assert "mend the path" in line


def test_every_launch_file_with_a_description_of_the_user_asks_for_it_here():
    paths = [*ROOT.glob("atom_*/**/*.launch"), *ROOT.glob("atom_*/**/*.j2")]
    asked = r'command="([^"]*\$\(arg description[^"]*)"'
    used = [words for path in paths for words in re.findall(asked, path.read_text("utf-8"))]
    assert len(used) >= 5
    assert [c for c in used if not c.startswith("rosrun atom_calibration robot_description ")] == []
