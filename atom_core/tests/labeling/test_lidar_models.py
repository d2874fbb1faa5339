"""Boards before each LiDAR model with the rough profile's errors; what is like a board and is none.

`tests/benchmarks/bench_lidar_models.py` is the long form, with calibrations.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from lidar_scenes import BORDER, Box, Scene, board_facing, pose, scan, shares
from model_scenes import LIDAR, PATTERN, labeled, model_cell, outline_errors_m

from atom_core import native
from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, CalibrationOptions
from atom_core.geometry import se3
from atom_core.labeling.lidar3d import Cloud, board_at, find_boards
from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic import charuco
from atom_core.synthetic.lidar_models import LIDAR_MODELS, LidarModel

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

EYE = (0.0, 0.0, 1.5)
DENSE_AMID = (-25, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4, -3.667, -3.333)
DENSE_AMID += (-3, -2.667, -2.333, -2, -1.667, -1.333, -1, -0.667, -0.333, 0, 0.333, 0.667, 1)
DENSE_AMID += (1.333, 1.667, 2.333, 3.333, 4.667, 7, 10.333, 15)  # of a VLP-32C, and of others
NOMINAL = pattern_from_config(PATTERN, charuco()).border


def outlines_of(cell):
    """Return the RMS [m] of the outline of the only board in each cloud."""
    rms = []
    for board in cell.boards:
        (found,) = find_boards(board.data, NOMINAL)
        assert board.cloud.on_board[found.labeled.label.indices].mean() > 0.97
        errors = outline_errors_m(board, found.sensor_T_centre, NOMINAL)
        rms.append(np.sqrt(np.mean(errors**2)))
    return np.array(rms)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", LIDAR_MODELS)
def test_every_model_finds_boards_and_their_outlines_without_a_seed(name):
    rms = outlines_of(model_cell(name, 1, 3))
    assert np.sqrt(np.mean(rms**2)) < 0.005


@pytest.mark.long
@pytest.mark.parametrize("name", ["vlp_16", "ouster_64", "ouster_128"])
def test_a_calibration_with_these_labels_is_right(name):
    cell = model_cell(name, 0)
    labels = {}
    for board in cell.boards:
        (found,) = find_boards(board.data, NOMINAL)
        labels[board.collection] = found.labeled.label
    scene = labeled(cell, labels)
    result = calibrate(scene.dataset, CalibrationOptions(model_errors=AUTO))
    edge = scene.dataset.sensors[LIDAR].edge
    found = result.dataset.collections["000"].transforms[edge]
    true = scene.truth.edges[edge]
    assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < 0.005
    assert np.degrees(se3.rotation_angle(found[:3, :3].T @ true[:3, :3])) < 0.15


def label(cloud, seed):
    return board_at(Cloud(cloud.points, cloud.ring), BORDER, np.array(seed)).labeled


@pytest.mark.parametrize("name", ["hdl_64", "ouster_128"])
def test_the_end_of_a_table_is_no_board(name):
    table = Box((1.5, -0.4, 0.72), (3.3, 0.4, 0.74))  # wide as the board, thrice as long
    scene = Scene(pose(EYE), None, [table], model=LIDAR_MODELS[name])
    cloud = scan(scene, 4)
    for x in (1.8, 2.4, 3.0):
        found = label(cloud, [x, 0.0, 0.74 - EYE[2]])
        assert not found.detected, found.quality
    assert find_boards(Cloud(cloud.points, cloud.ring), BORDER) == []
    short = Box((1.5, -0.4, 0.72), (2.1, 0.4, 0.74))  # no larger than the board: nothing tells it
    cloud = scan(scene._replace(things=[short]), 4)
    assert label(cloud, [1.8, 0.0, 0.74 - EYE[2]]).detected


def test_another_surface_that_crosses_the_plane_of_a_board_does_not_hide_it():
    board = board_facing(EYE, (2.0, 0.0, 1.5), 0.0, 40.0)
    post = Box((1.9, 0.5, 0.0), (2.6, 0.9, 3.0))
    cloud = scan(Scene(pose(EYE), board, [post], model=LIDAR_MODELS["ouster_128"]), 5)
    found = label(cloud, cloud.seed)
    assert found.detected, found.reason
    precision, recall = shares(found.label.indices, cloud)
    assert precision > 0.98
    assert recall > 0.9


@pytest.mark.parametrize(
    "top_m, height_m, away_m",
    [(0.04, 0.40, 1.7), (0.08, 0.40, 2.0), (0.12, 0.40, 1.7), (0.12, 0.45, 2.4), (0.08, 0.45, 1.7)],
)
@pytest.mark.parametrize("width_m", [0.80, 0.815])
def test_no_layer_passes_through_a_board(width_m, top_m, height_m, away_m):
    """The front of a cabinet, as wide as the board: the layers below it are few, and say so."""
    top = EYE[2] + top_m
    low, high = (away_m, -width_m / 2, top - height_m), (away_m + 0.5, width_m / 2, top)
    model = LidarModel(rings=32, elevation_deg=DENSE_AMID, azimuth_steps=1800)
    cloud = scan(Scene(pose(EYE), None, [Box(low, high)], model=model))
    found = label(cloud, (away_m, 0.0, top_m - height_m / 2))
    assert not found.detected and "layers pass through where the board would be" in found.reason
    assert find_boards(Cloud(cloud.points, cloud.ring), BORDER) == []


@pytest.mark.parametrize("top_m", [0.04, 0.12, 0.25, 0.4])
@pytest.mark.parametrize("away_m", [1.2, 1.7, 2.4])
def test_layers_that_are_dense_in_the_middle_find_the_board_wherever_it_is(top_m, away_m):
    model = LidarModel(rings=32, elevation_deg=DENSE_AMID, azimuth_steps=1800)
    board = board_facing(EYE, (away_m, 0.0, EYE[2] + top_m - 0.3), 0.0, turn_deg=15.0)
    cloud = scan(Scene(pose(EYE), board, model=model))
    found = label(cloud, cloud.seed)
    assert found.detected, found.reason
    precision, recall = shares(found.label.indices, cloud)
    assert precision > 0.97 and recall > 0.9
