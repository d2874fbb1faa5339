"""``convert --to kalibr``: images and target as Kalibr's documentation describes them."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))  # command_line, which the tests share

from command_line import refused, run  # noqa: E402

from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the JSON of a dataset with two cameras and a LiDAR."""
    folder = tmp_path_factory.mktemp("made")
    scene = scenes.random_scene(3, rgb=2, depth=0, lidar3d=1, collections=3)
    write_dataset_folder(scene.dataset, folder / "data", name="data")
    return folder / "data" / "dataset.json"


def test_target_and_images_are_those_of_the_dataset(made, tmp_path, capsys):
    run("convert", "--to", "kalibr", "--dataset", made, "--output", tmp_path / "out")
    said = capsys.readouterr().out
    dataset = read_dataset(made)
    (pattern,) = dataset.patterns.values()
    assert yaml.safe_load((tmp_path / "out" / "target.yaml").read_text()) == {
        "target_type": "checkerboard",
        "targetCols": pattern.columns,
        "targetRows": pattern.rows,
        "rowSpacingMeters": pattern.square_m,
        "colSpacingMeters": pattern.square_m,
    }
    stamps = []
    for number, name in enumerate(("rgb_1", "rgb_2")):
        images = sorted(
            (tmp_path / "out" / f"cam{number}").glob("*.png"), key=lambda p: int(p.stem)
        )
        stamps.append([int(path.stem) for path in images])
        assert len(images) == len(dataset.collections)
        for path, key in zip(images, dataset.collections):
            found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            grey = cv2.cvtColor(dataset.data.read(key, name), cv2.COLOR_BGR2GRAY)
            np.testing.assert_array_equal(found, grey)
    assert stamps[0] == stamps[1] and len(set(stamps[0])) == len(stamps[0])
    assert not (tmp_path / "out" / "cam2").exists()  # a LiDAR is none
    assert "kalibr_bagcreater --folder" in said
    assert "--topics /cam0/image_raw /cam1/image_raw --models pinhole-radtan" in said
    assert "warning: Kalibr has no ChArUco" in said


def test_what_kalibr_cannot_take_is_refused(made, tmp_path, capsys):
    line = ["convert", "--dataset", made, "--output", tmp_path / "out"]
    both = ["--from", "atom_v2", "--to", "kalibr"]
    assert "only atom_v3 is brought into kalibr" in refused(capsys, *line, *both)
    lidars = ["--to", "kalibr", "-ssf", "lidar*"]
    assert "no rgb camera has an image" in refused(capsys, *line, *lidars)
    part = ["--to", "atom_v3", "-csf", "000"]
    assert "is migrated as a whole" in refused(capsys, *line, *part)
    assert not (tmp_path / "out").exists()
    run(*line, "--to", "kalibr")
    assert "the folder is not empty" in refused(capsys, *line, "--to", "kalibr")


def test_images_of_an_earlier_conversion_do_not_stay_beside_those_of_this(made, tmp_path, capsys):
    line = ["convert", "--to", "kalibr", "--dataset", made, "--output", tmp_path / "out"]
    run(*line)
    run(*line, "-ow")
    said = refused(capsys, *line, "-ow", "-csf", "!001")
    assert "of another conversion (2 files)" in said
    run(*line[:-1], tmp_path / "other", "-csf", "!001")
