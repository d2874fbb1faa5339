"""Every command block of README, CONTRIBUTING and the tutorials, run in order as by a reader.

In a fresh clone, in a fresh catkin workspace, and on a ROS master that other steps have left behind
(`make test-long`; a good half hour). `make test` only looks whether every line is run somewhere, or
named with the reason why not. RViz by mouse is `make test-rviz`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rospy", reason="ROS is not installed")
ROOT = Path(__file__).resolve().parents[1]
for folder in ("tests", "atom_calibration/tests", "atom_rviz_plugins/tests"):
    sys.path.insert(0, str(ROOT / folder))

from document_blocks import blocks, typed  # noqa: E402
from document_plan import CLONE, IN_USE, PAGES, WAYS, WORKSPACE, block_of, steps  # noqa: E402
from document_reader import PREPARED, Reader  # noqa: E402
from masters import reserved_port  # noqa: E402
from test_launches import registered  # noqa: E402
from test_workspace import tracked_files  # noqa: E402

SETTINGS = (CLONE, IN_USE, WORKSPACE)


# ---- the plan


def test_command_lines_are_told_from_files_and_outputs():
    assert typed(["a: 1", "b: 2"]) == [] and typed(["verdict: GOOD."]) == []
    assert typed(["make build   # once", "rosrun a b \\", "    --c d"]) == [
        "make build",
        "rosrun a b --c d",
    ]
    answered = ["$ python3 -m atom_core check", "check: refused"]
    assert typed(answered) == ["python3 -m atom_core check"]


@pytest.mark.parametrize("page", PAGES)
def test_every_block_is_run_in_some_setting_and_every_line_of_it_or_why_not_is_said(page):
    every = blocks(page)
    run = [step.block for setting in SETTINGS for step in steps(setting)]
    assert every and [str(block) for block in every if block not in run] == []
    lines = [line for block in every for line in block.lines]
    for begin, way in WAYS[page].items():
        assert any(line.startswith(begin) for line in lines), begin
        assert not way.not_run or not (way.added or way.stays), begin
    for of_page, begin in PREPARED:
        assert of_page != page or any(line.startswith(begin) for line in lines), begin


def test_a_block_that_a_page_has_lost_is_missed():
    with pytest.raises(KeyError, match="make nothing"):
        block_of("README.md", "make nothing")


# ---- run


def checkout(folder: Path) -> None:
    """Write what a clone of this checkout has, without anything that was built."""
    for name in tracked_files():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("documents")


@pytest.fixture(scope="module")
def clone(folder):
    """Return a home with a clone in it, not built yet."""
    home = folder / "home"
    checkout(home / "atom")
    return home


@pytest.mark.long(minutes=10)
def test_in_a_fresh_clone(clone, folder):
    with reserved_port() as port:
        reader = Reader(clone, folder / "recordings", port)
        for step in steps(CLONE):
            reader.follow(step)
    assert_all_typed(reader, CLONE)


@pytest.mark.long(minutes=10)
def test_with_a_master_that_was_in_use(clone, folder):
    for name in ("bags", "data", "datasets", "catkin_ws", "robot"):
        shutil.rmtree(clone / name, ignore_errors=True)
    with reserved_port() as port:
        reader = Reader(clone, folder / "recordings", port)
        reader.type("cd ~/atom")
        reader.type("make build")
        reader.type("source env.bash")
        master = subprocess.Popen(
            ["bash", "-c", f"source ~/atom/env.bash; exec roscore -p {port}"],
            env=reader.variables,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            wait_for(lambda: "/rosout" in registered(port))
            reader.type("rosparam set /use_sim_time true")  # a bag was played here
            reader.type("rosparam set /robot_description '<robot name=\"another\"/>'")
            for step in steps(IN_USE):
                reader.follow(step)
        finally:
            master.terminate()
            master.wait(60)
    assert_all_typed(reader, IN_USE)


@pytest.mark.long(minutes=10)
def test_in_a_fresh_workspace(folder):
    home = folder / "workspace_home"
    checkout(home / "catkin_ws" / "src" / "atom")
    with reserved_port() as port:
        reader = Reader(home, folder / "recordings", port)
        for step in steps(WORKSPACE):
            reader.follow(step)
    assert_all_typed(reader, WORKSPACE)


def assert_all_typed(reader: Reader, setting: str) -> None:
    expected = [(step.block.page, line) for step in steps(setting) for line in step.block.lines]
    assert reader.typed == expected


def wait_for(condition) -> None:
    end_s = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.2)
