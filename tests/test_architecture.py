"""What docs/architecture.md promises of the modalities, counted; and how nodes start."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# A comparison with the name of one modality, or with several, in code or in a template.
BRANCH = re.compile(r"modality (==|!=|in|not in) [({A-Z\"']")


def branches():
    """Return the places, by file, of comparisons with a modality's name outside the rooms."""
    found = {}
    files = [*ROOT.glob("*/src/**/*.py"), *ROOT.glob("*/templates/*.j2")]
    for file in sorted(files):
        name = file.relative_to(ROOT).as_posix()
        lines = [x for x in file.read_text(encoding="utf-8").splitlines() if BRANCH.search(x)]
        if lines and "/modalities/" not in name:
            found[name] = lines
    return found


def test_hardly_anything_branches_on_a_modality_outside_its_room():
    found = branches()
    assert sum(len(lines) for lines in found.values()) <= 10, found


def test_what_the_pattern_finds():
    for line in (
        "if sensor.modality == DEPTH:",
        'elif x.modality == "lidar3d"',
        "modality in (A, B)",
    ):
        assert BRANCH.search(line)
    for line in ("for modality in modalities():", "if block.modality == modality"):
        assert not BRANCH.search(line)


def test_nodes_start_in_one_way():
    """With the handler of rospy a signal amid a message may wait for that message for ever."""
    starting = {
        file.relative_to(ROOT).as_posix(): line.strip()
        for file in ROOT.glob("*/src/**/*.py")
        for line in file.read_text(encoding="utf-8").splitlines()
        if "init_node(" in line
    }
    assert starting == {
        "atom_calibration/src/atom_calibration/runtime/running.py": (
            "rospy.init_node(name, disable_signals=True)"
        )
    }


def test_topics_go_quiet_when_a_node_ends():
    """Publishing to a topic that rospy has closed is a traceback in whatever thread does it."""
    made = [
        f"{file.name}: {line.strip()}"
        for file in ROOT.glob("*/src/**/*.py")
        for line in file.read_text(encoding="utf-8").splitlines()
        if "rospy.Publisher(" in line or re.search(r"\bInteractiveMarkerServer\(", line)
    ]
    assert not made, "running.Publisher and pose_marker.MarkerServer do that"
