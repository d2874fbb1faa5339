"""Boards' first poses, estimated anew: where the cameras see them; nothing else changes."""

import json

import numpy as np
import pytest

from atom_core import cli
from atom_core.geometry import se3
from atom_core.io.dataset_entries import pose_of_entry
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.labels import RgbLabel
from atom_core.synthetic import Noise, scenes


@pytest.fixture
def made(tmp_path):
    scene = scenes.random_scene(3, rgb=2, depth=1, lidar3d=0, collections=4, noise=Noise.none())
    return write_dataset_folder(scene.dataset, tmp_path / "data", name="four"), scene


def run(*words, code=0):
    assert cli.main(["estimate_pattern_poses", *(str(word) for word in words)]) == code


def test_without_noise_they_are_the_true_ones(made):
    path, scene = made
    before = path.read_text()
    run("-json", path)
    assert path.read_text() == before
    new = json.loads(path.with_name("dataset_pattern_poses.json").read_text())
    first = new["patterns"]["pattern_1"].pop("transforms_initial")
    old = json.loads(before)
    old["patterns"]["pattern_1"].pop("transforms_initial")
    assert new == old
    labels = {k: [*c.labels.items()] for k, c in scene.dataset.collections.items()}
    for key, entry in first.items():
        cameras = [s for (s, _), label in labels[key] if isinstance(label, RgbLabel)]
        assert entry["detected"] == bool(cameras)
        if cameras:
            assert entry["sensor"] == next(n for n in scene.dataset.sensors if n in cameras)
            error = se3.inverse(scene.truth.boards["pattern_1", key]) @ pose_of_entry(entry)
            np.testing.assert_allclose(error, np.eye(4), atol=1e-4)
    assert sum(entry["detected"] for entry in first.values()) >= 3


def test_in_place_only_when_asked(made, capsys):
    path, _ = made
    before = path.read_text()
    run("-json", path, "-o", path, "-ow", code=2)
    assert "is the input" in capsys.readouterr().err and path.read_text() == before
    run("-json", path, "--in_place", "-o", path.with_name("b.json"), code=2)
    assert "exclude one another" in capsys.readouterr().err
    run("-json", path, "--in_place")
    assert path.read_text() != before
    again = path.read_text()
    run("-json", path, "--in_place")
    assert path.read_text() == again


def test_a_board_that_no_camera_tells_is_said(made, capsys):
    path, _ = made
    document = json.loads(path.read_text())
    for by_sensor in document["collections"]["001"]["labels"].values():
        for sensor in ("rgb_1", "rgb_2"):
            by_sensor[sensor].update(detected=False, idxs=[])
    path.write_text(json.dumps(document))
    run("-json", path)
    assert "no camera tells it in 001" in capsys.readouterr().out
