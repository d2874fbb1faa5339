"""`check --against` where errors of sensors were estimated: new boards are read with them."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402
from described_rigs import described_elsewhere, urdf_of  # noqa: E402

from atom_core.geometry import se3  # noqa: E402
from atom_core.geometry.intrinsics import moved_camera  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402
from atom_core.synthetic.mistakes import with_long_ranges  # noqa: E402

NEW, LONG_M = 4, 0.06
STANDS = "Nothing is seen to have moved|The rig stands as described"
WRONG = np.array([0.01, 0.01, *np.zeros(10)])  # a focal length 1 % too long


def with_wrong_camera(dataset, numbers=WRONG):
    camera = moved_camera(dataset.sensors["rgb_2"].camera, numbers)
    sensors = {**dataset.sensors, "rgb_2": replace(dataset.sensors["rgb_2"], camera=camera)}
    return replace(dataset, sensors=sensors)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a folder: a rig with a LiDAR that reads long and a wrong camera, and new boards."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(3, rgb=2, depth=0, lidar3d=1, collections=22)
    dataset = with_wrong_camera(with_long_ranges(scene.dataset, "lidar_1", LONG_M))
    collections = dataset.collections
    seen = sorted(collections, key=lambda key: -len(collections[key].labels))
    old, new = dataset.selected(collections=seen[NEW:]), dataset.selected(collections=seen[:NEW])
    write_dataset_folder(old, folder / "old", name="old")
    write_dataset_folder(new, folder / "new", name="new")
    (folder / "rig.urdf").write_text(urdf_of(old))
    line = ["calibrate", "-json", folder / "old" / "dataset.json", "--output", folder / "results"]
    line += ["--range_offset", "lidar_1", "--optimize_intrinsics", "rgb_2"]
    run(*line, "--description", folder / "rig.urdf")
    return folder


def check(made, against, *more):
    return ["check", "--dataset", made / "new" / "dataset.json", "--against", against, *more]


def with_document(made, tmp_path, change):
    """Return the description beside a ``calibration.json`` that was changed."""
    document = json.loads((made / "results" / "calibration.json").read_text())
    change(document)
    (tmp_path / "calibration.json").write_text(json.dumps(document))
    text = (made / "results" / "optimized.urdf.xacro").read_text()
    (tmp_path / "optimized.urdf.xacro").write_text(text)
    return tmp_path / "optimized.urdf.xacro"


def without_known_errors(document):
    document["model_errors"] = []
    for sensor in document["sensors"].values():
        sensor.pop("camera", None)
        sensor.pop("intrinsics", None)


@pytest.mark.long
def test_a_rig_that_did_not_move_stands_though_its_sensors_are_wrong(made, tmp_path, capsys):
    run(*check(made, made / "results" / "optimized.urdf.xacro"))
    assert re.search(STANDS, capsys.readouterr().out)
    run(*check(made, with_document(made, tmp_path, without_known_errors)), code=1)
    assert "The rig has moved" in capsys.readouterr().out


def test_new_boards_may_come_with_the_intrinsics_that_were_found(made, tmp_path, capsys):
    document = json.loads((made / "results" / "calibration.json").read_text())
    found = document["sensors"]["rgb_2"]["camera"]["found"]
    new = json.loads((made / "new" / "dataset.json").read_text())
    info = new["sensors"]["rgb_2"]["camera_info"]
    info["K"] = [found["fx"], 0, found["cx"], 0, found["fy"], found["cy"], 0, 0, 1]
    info["D"] = [value for name, value in found.items() if name not in ("fx", "fy", "cx", "cy")]
    for file in (made / "new").iterdir():
        (tmp_path / file.name).symlink_to(file)
    (tmp_path / "dataset.json").unlink()
    (tmp_path / "dataset.json").write_text(json.dumps(new))
    against = made / "results" / "optimized.urdf.xacro"
    run("check", "--dataset", tmp_path / "dataset.json", "--against", against)
    assert re.search(STANDS, capsys.readouterr().out)
    info["K"][0] *= 1.005
    (tmp_path / "dataset.json").write_text(json.dumps(new))
    said = refused(capsys, "check", "--dataset", tmp_path / "dataset.json", "--against", against)
    assert "'rgb_2' has intrinsics now that are neither those" in said


@pytest.mark.long
@pytest.mark.sampled(1)
@pytest.mark.parametrize("sensor", ["lidar_1", "rgb_2"])
def test_what_moved_is_named_beside_the_known_errors(made, tmp_path, capsys, sensor):
    move = se3.random_move(0.05, np.radians(1.0), np.random.default_rng(3))
    run(*check(made, described_elsewhere(made, tmp_path, sensor, move)), code=1)
    assert f"The rig has moved: {sensor} by" in capsys.readouterr().out


def renamed(document):
    document["model_errors"][0]["type"] = "Wish"


def of_an_earlier_version(document):
    del document["model_errors"][0]["type"]


def with_words_for_numbers(document):
    document["model_errors"][0]["parameters"] = {"low_rad": "a", "high_rad": 0.1}
    document["model_errors"][0]["type"] = "LayerOffset"


def with_a_joint(document):
    document["joints"] = {"elbow": {}}


@pytest.mark.parametrize(
    "change, said",
    [
        (renamed, "model error 'Wish' is unknown"),
        (of_an_earlier_version, "by a version that does not tell all of it.*evaluate --compare"),
        (with_words_for_numbers, "tell no LayerOffset of lidar_1"),
        (with_a_joint, r"joints were estimated, too \(elbow\)"),
    ],
)
def test_what_cannot_be_known_is_refused(made, tmp_path, capsys, change, said):
    assert re.search(said, refused(capsys, *check(made, with_document(made, tmp_path, change))))
