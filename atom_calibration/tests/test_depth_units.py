"""Depth images of a bag in another unit than their encoding says: refused, with the factor."""

import numpy as np
import pytest

from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco, hits
from atom_core.synthetic.rig import pinhole

CONFIG = """
world_link: world
sensors:
  depth: {link: optical, parent_link: world, child_link: optical, topic_name: /depth/image_raw,
          modality: depth}
calibration_patterns:
  board: {link: board, parent_link: world, fixed: false, pattern_type: charuco,
          dictionary: DICT_5X5_100, dimension: {x: 11, y: 8}, size: 0.06, inner_size: 0.045,
          border_size: {x: 0.04, y: 0.03}}
max_duration_between_msgs: 200
"""
WALL_M, BOARD_M = 3.6, 1.5
CAMERA = pinhole(320, 240, 277.0)


@pytest.fixture(scope="module")
def depth_m():
    """Return what a depth camera sees of a board before a wall, (height, width) [m]."""
    border = pattern_from_config("board", charuco()).border
    camera_T_board = se3.from_rpy(np.zeros(3), np.array([0.2, -0.3, 0.3]))
    middle = camera_T_board[:3, :3] @ np.append(border.centre, 0.0)
    camera_T_board[:3, 3] = np.array([0.0, 0.0, BOARD_M]) - middle
    row, column = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    flat = CAMERA.normalise(np.column_stack([column.ravel(), row.ravel()]))
    z, _ = hits(camera_T_board, border, np.column_stack([flat, np.ones(len(flat))]))
    return np.minimum(z, WALL_M).reshape(CAMERA.height, CAMERA.width)


@pytest.fixture
def collect(make, tmp_path, capsys):
    """Return a function: stored image, encoding -> exit code of collecting, its lines on stderr."""

    def run(stored, encoding):
        content = [("/tf_static", make.tf("world", "optical", np.eye(4), 99.0), 99.0)]
        for tick in range(10):
            stamp = 100.0 + 0.2 * tick
            info = make.camera_info(CAMERA.width, CAMERA.height, "optical", stamp)
            info.K = CAMERA.K.ravel().tolist()
            image = make.image(stored, encoding, "optical", stamp)
            content += [("/depth/camera_info", info, stamp), ("/depth/image_raw", image, stamp)]
        bag = make.bag(tmp_path / "a.bag", content)
        (tmp_path / "config.yml").write_text(CONFIG)
        output = tmp_path / "out"
        words = ["--config", tmp_path / "config.yml", "--bag", bag, "--output", output]
        code = main([str(word) for word in words])
        lines = capsys.readouterr().err.splitlines()
        return code, [line for line in lines if line.startswith("collect_from_bag:")]

    run.folder = tmp_path / "out"
    return run


@pytest.mark.parametrize(("encoding", "kind", "unit"), [("16UC1", "<u2", 1e3), ("32FC1", "<f4", 1)])
def test_the_right_unit_is_collected(collect, depth_m, encoding, kind, unit):
    code, lines = collect((depth_m * unit).astype(kind), encoding)
    assert (code, lines) == (0, [])
    assert len(read_dataset(collect.folder / "dataset.json").collections) == 1


@pytest.mark.parametrize(
    ("encoding", "kind", "unit", "factor", "meaning"),
    [
        ("32FC1", "<f4", 1e3, "0.001", "look like millimetres where metres are expected"),
        ("16UC1", "<u2", 1e4, "0.1", "look like tenths of a millimetre"),
    ],
)
def test_another_unit_is_refused_with_sensor_topic_time_and_factor(
    collect, depth_m, encoding, kind, unit, factor, meaning
):
    code, lines = collect((depth_m * unit).astype(kind), encoding)
    assert code == 2 and len(lines) == 1
    assert "sensor 'depth', topic /depth/image_raw, time 100.000" in lines[0]
    assert f"multiplied by {factor}; they {meaning}" in lines[0]
    assert "correct the encoding or the driver" in lines[0]
    assert not (collect.folder / "dataset.json").exists()


def test_a_seed_outside_the_image_is_refused(collect, depth_m, make, capsys):
    collect((depth_m * 1e3).astype("<u2"), "16UC1")
    folder = collect.folder.parent
    (folder / "seeds.yaml").write_text("- {stamp: 100.2, sensor: depth, uv_px: [400, 20]}\n")
    words = ["--config", folder / "config.yml", "--bag", folder / "a.bag"]
    words += ["--output", folder / "again", "--seeds", folder / "seeds.yaml"]
    assert main([str(word) for word in words]) == 2
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("collect_from_bag")]
    assert "sensor 'depth'" in line and "time 100.200" in line and "320 x 240 pixels" in line
