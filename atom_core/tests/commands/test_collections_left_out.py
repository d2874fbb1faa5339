"""Which collections `calibrate` leaves out where options take labels away, and what it says."""

import json

import pytest

from atom_core import cli
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes


@pytest.fixture
def dataset(tmp_path):
    """Return the path of a dataset of two cameras and a LiDAR, and its document."""
    scene = scenes.random_scene(2, depth=0, lidar3d=1, collections=14)
    path = write_dataset_folder(scene.dataset, tmp_path / "data", name="train")
    return path, json.loads(path.read_text())


def unused(path, *options):
    assert cli.main(["calibrate", "-json", str(path), "-ow", "--no_report", *options]) != 2
    document = json.loads((path.parent / "calibration.json").read_text())
    return {k: c["reason"] for k, c in document["collections"].items() if not c["used"]}


def test_a_label_that_lacks_corners_makes_no_collection_incomplete(dataset):
    """As in ATOM, and in evaluations of a pair: `-rpd` comes after that question."""
    path, document = dataset
    complete = set(document["collections"]) - set(unused(path, "--complete_only"))
    for key in complete:
        label = document["collections"][key]["labels"]["pattern_1"]["rgb_1"]
        label["idxs"] = label["idxs"][1:] if key == min(complete) else label["idxs"]
    path.write_text(json.dumps(document))
    assert min(complete) not in unused(path, "--complete_only", "-rpd")


def test_a_collection_that_an_option_empties_is_told_with_the_option(dataset):
    path, document = dataset
    assert not unused(path)
    calibrated = path.with_name("atom_calibration.json")
    held = json.loads(calibrated.read_text())
    del held["collections"]["000"]["transforms"]["world-pattern_link"]
    partial = path.with_name("held.json")
    partial.write_text(json.dumps(held))
    assert "(-ap)" in unused(partial, "-ap")["000"]
    for sensor in ("rgb_1", "rgb_2"):
        label = document["collections"]["001"]["labels"]["pattern_1"][sensor]
        label["idxs"] = label["idxs"][1:]
    path.write_text(json.dumps(document))
    assert "(-rpd)" in unused(path, "-rpd", "-ssf", "rgb_*")["001"]
