"""Clouds that are depth images: which ones are, and their labels."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from cloud_scenes import rosette, scene_with, strewn, tof
from lidar_scenes import BORDER, scan

from atom_core import native
from atom_core.geometry import se3
from atom_core.labeling.image_cloud import as_image
from atom_core.labeling.lidar3d import Cloud, Lidar3dLabeler
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco
from atom_core.synthetic.lidar_models import LidarModel

WIDTH, HEIGHT = 240, 180
COUNT = WIDTH * HEIGHT


def taken(model, lost=0.1):
    """Return the points of all beams, lost ones NaN, and what is true of them."""
    scene = scene_with(np.random.default_rng(1), model, 2.0, 30.0)
    cloud = scan(scene, 0, 0.005, 0.0)
    points = cloud.points.copy()
    points[np.random.default_rng(2).random(len(points)) < lost] = np.nan
    return points, cloud


def labeler():
    config = charuco(border_size=(0.04, 0.03))
    sensor = Sensor("points", LIDAR3D, "points", Edge("world", "points"))
    return Lidar3dLabeler(sensor, pattern_from_config("board", config))


@pytest.mark.parametrize("told", [True, False])
def test_points_of_a_camera_are_an_image_whatever_its_axes(told):
    points, _ = taken(tof())
    turned = points @ se3.rotation_from_rpy(np.array([0.3, -1.0, 2.0])).T
    image = as_image(turned, WIDTH, HEIGHT) if told else as_image(turned)
    assert (image.camera.width, image.camera.height) == (WIDTH, HEIGHT)
    focal_px = (WIDTH - 1) / 2.0 / np.tan(np.radians(31.0))
    assert image.camera.focal_px == pytest.approx([focal_px, focal_px], rel=1e-3)
    for index in np.flatnonzero(np.isfinite(points).all(axis=1))[::500]:
        assert image.pixel(turned[index]) == pytest.approx([index % WIDTH, index // WIDTH], abs=0.1)
    away = np.linalg.norm(points, axis=1).reshape(HEIGHT, WIDTH)
    known = np.isfinite(away)
    assert np.array_equal(known, np.isfinite(image.depth_m))
    assert np.all(image.depth_m[known] <= away[known] + 1e-4)


@pytest.mark.parametrize(
    "model", [rosette(), strewn(), LidarModel(16), LidarModel(64, (-22.5, 22.5), 1024)]
)
def test_other_clouds_are_no_images(model):
    points, _ = taken(model)
    assert as_image(points) is None


def test_a_shuffled_or_thinned_cloud_is_no_image():
    points, _ = taken(tof())
    assert as_image(points[np.random.default_rng(0).permutation(COUNT)]) is None
    assert as_image(points[np.isfinite(points).all(axis=1)]) is None
    assert as_image(np.full((COUNT, 3), np.nan), WIDTH, HEIGHT) is None


@pytest.mark.parametrize("with_seed", [True, False])
def test_the_label_of_an_image_has_the_clouds_indices(with_seed):
    points, cloud = taken(tof())
    found = labeler().label(Cloud(points), cloud.seed if with_seed else None)
    assert found.detected and "coverage" in found.quality
    clear = found.label.indices[~cloud.mixed[found.label.indices]]
    assert np.all(cloud.on_board[clear])
    middle = np.nanmean(points[cloud.on_board & ~cloud.mixed], axis=0)
    assert np.linalg.norm(found.next_seed - middle) < 0.02
    away = np.linalg.norm(points[found.label.limit_indices] - middle, axis=1)
    assert np.all(away > BORDER.half_size.min() - 0.05)
    assert np.all(away < np.linalg.norm(BORDER.half_size) + 0.05)


def test_a_seed_out_of_the_image_is_named():
    points, _ = taken(tof())
    found = labeler().label(Cloud(points), np.array([-2.0, 0.0, 0.0]))
    assert not found.detected and "field of view" in found.reason


@pytest.mark.skipif(not native.available(), reason="the compiled core is not built")
def test_a_shuffled_image_is_labeled_by_its_outline():
    points, cloud = taken(tof())
    order = np.random.default_rng(0).permutation(COUNT)
    found = labeler().label(Cloud(points[order]), cloud.seed)
    assert found.detected and "point_spacing_m" in found.quality
