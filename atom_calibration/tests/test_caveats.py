"""What a recording puts in doubt is told once, kept with the dataset, and no verdict forgets it."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rospy")

from stand_in_rig import messages

from atom_calibration.collect.caveats import CaveatLog
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_calibration.sources.contradictions import EdgeWatch
from atom_calibration.sources.rig import Rig
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge

EDGES = [("world", "rig"), ("rig", "left"), ("left", "left_data"), ("rig", "right")]
SHIFT = se3.transform(np.eye(3), np.array([0.03, 0.0, 0.0]))


def log_of(make, told, anchored=None, doubted=(), fixed_board_in=None):
    """Return the caveats of two LiDARs on a rig, some of whose fixed edges come with two values."""
    sensors = {
        "left": Sensor("left", LIDAR3D, "left_data", Edge("rig", "left"), None, "/left", 0.0),
        "right": Sensor("right", LIDAR3D, "right", Edge("rig", "right"), None, "/right", 0.0),
    }
    tree, watch = TransformTree(), EdgeWatch()
    for edge in EDGES:
        tree.add([make.transform(*edge, np.eye(4))], fixed=True)
        for pose in [np.eye(4), SHIFT] if edge in doubted else [np.eye(4)]:
            watch.see_fixed(make.transform(*edge, pose))
    parent = fixed_board_in or "world"
    board = SimpleNamespace(link="board", parent_link=parent, fixed=parent != "world")
    config = SimpleNamespace(
        world_link="world",
        calibration_patterns={"board": board},
        estimated_edges=(),
        anchored_sensor=anchored,
    )
    return CaveatLog(Rig(sensors, {}, {}, ()), config, tree, lambda: watch.doubtful, told.append)


@pytest.mark.parametrize(
    ("edge", "anchored", "sensors"),
    [
        (("world", "rig"), None, ("left", "right")),
        (("left", "left_data"), None, ("left",)),
        (("rig", "right"), None, ()),  # it is estimated
        (("rig", "right"), "right", ("right",)),
    ],
)
def test_a_fixed_edge_of_two_values_concerns_whose_answer_hangs_on_it(
    make, edge, anchored, sensors
):
    told = []
    log = log_of(make, told, anchored, [edge])
    assert [c.sensors for c in log.now()] == ([sensors] if sensors else [])
    assert log.now() == log.now() and len(told) == 1 and "differ by 30.0 mm" in told[0]


def test_that_of_a_board_that_stays_concerns_all(make):
    log = log_of(make, [], doubted=[("left", "left_data")], fixed_board_in="left_data")
    assert [c.sensors for c in log.now()] == [("left", "right")]


def test_what_is_in_doubt_is_kept_with_the_dataset(place, make, capsys):
    content = list(messages(make))
    content.insert(3, ("/tf_static", make.tf("cam", "cam_optical", SHIFT, 100.0), 100.0))
    assert main(place(content)) == 0
    assert capsys.readouterr().err.count("'cam-cam_optical' has several values") == 1
    (caveat,) = read_dataset(place.folder / "dataset.json").caveats
    assert caveat.sensors == ("cam",) and "differ by 30.0 mm and 0.00 deg" in caveat.what


def test_also_what_comes_up_after_the_first_collection(place, make):
    content = list(messages(make, stops=6))
    content += [("/tf", make.tf("world", "lidar", np.eye(4), 114.8), 114.9)]
    assert main(place(content)) == 1  # stops were lost by it
    document = json.loads((place.folder / "dataset.json").read_text())
    (entry,) = document["_metadata"]["caveats"]
    assert entry["sensors"] == ["lidar"] and "stands in 'arm' and in 'world'" in entry["what"]
