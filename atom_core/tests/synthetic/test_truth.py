"""Without noise, every measurement agrees with the truth that comes with it."""

from itertools import product

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import pose, range_points
from atom_core.model.labels import RgbLabel
from atom_core.model.sensor import DEPTH, LIDAR3D
from atom_core.model.truth import with_truth
from atom_core.synthetic import Noise, Sampling, paper_cell, scenes

EXACT = {"noise": Noise.none(), "disturbance": (0.1, 0.1)}
SCENES = {
    "random_scene": scenes.random_scene,
    "two_cameras": scenes.two_cameras,
    "lidar_only": scenes.lidar_only,
    "shared_edge": scenes.shared_edge,
    "disconnected": scenes.disconnected,
    "two_patterns": scenes.two_patterns,
    "hand_eye": scenes.hand_eye,
    "board_on_arm": scenes.board_on_arm,
    "paper_cell": paper_cell,
}


@pytest.fixture(scope="module", params=SCENES)
def exact(request):
    return SCENES[request.param](seed=1, **EXACT)


def detections_at_truth(synthetic, modality=None):
    """Yield (key, label, sensor, pattern, sensor_T_pattern) at the truth."""
    dataset = with_truth(synthetic.dataset, synthetic.truth)
    for key, label in dataset.detections():
        sensor, pattern = dataset.sensors[key.sensor], dataset.patterns[key.pattern]
        if modality is None or sensor.modality == modality:
            collection = dataset.collections[key.collection]
            yield (
                key,
                label,
                sensor,
                pattern,
                pose(collection, dataset.graph, sensor.frame, pattern.frame),
            )


def points_in_pattern(synthetic, modality):
    """Yield (pattern, inside, limit, sensor_T_pattern), the points (n, 3) in the pattern."""
    for key, _, _, pattern, sensor_T_pattern in detections_at_truth(synthetic, modality):
        points = range_points(synthetic.dataset, key)
        pattern_T_sensor = se3.inverse(sensor_T_pattern)
        inside, limit = (se3.apply(pattern_T_sensor, p) for p in points[:2])
        yield pattern, inside, limit, sensor_T_pattern


def test_corners_project_to_their_pixels(exact):
    for _, label, sensor, pattern, camera_T_pattern in detections_at_truth(exact, "rgb"):
        projected = sensor.camera.project(
            se3.apply(camera_T_pattern, pattern.corners_of(label.ids))
        )
        assert np.max(np.abs(projected - label.pixels)) < 1e-9


@pytest.mark.parametrize("modality", [LIDAR3D, DEPTH])
def test_labeled_points_lie_in_the_board(exact, modality):
    for pattern, inside, limit, _ in points_in_pattern(exact, modality):
        both = np.concatenate([inside, limit])
        assert np.max(np.abs(both[:, 2])) < 1e-9
        assert np.max(pattern.border.signed_distance(both[:, :2])[0]) < 1e-9


def test_lidar_limit_points_are_less_than_a_beam_step_from_the_border(exact):
    for pattern, _, limit, lidar_T_pattern in points_in_pattern(exact, LIDAR3D):
        # beyond the first and the last point of a ring the next beam misses the board
        step = 2 * np.pi / 1875
        towards = []
        for sign in (-1, 1):
            turn = se3.rotation_from_rotation_vector(np.array([0, 0, sign * step]))
            in_lidar = se3.apply(lidar_T_pattern, limit) @ turn.T
            directions = in_lidar @ lidar_T_pattern[:3, :3]
            origin = se3.inverse(lidar_T_pattern)[:3, 3]
            hit = origin[:2] - origin[2] * directions[:, :2] / directions[:, 2:]
            towards.append(pattern.border.signed_distance(hit)[0] > 0)
        assert np.all(towards[0] | towards[1])


def test_depth_limit_pixels_are_less_than_a_pixel_from_the_border(exact):
    for key, label, sensor, pattern, camera_T_pattern in detections_at_truth(exact, DEPTH):
        row, column = np.divmod(label.limit_indices, sensor.camera.width)
        pattern_T_camera = se3.inverse(camera_T_pattern)
        beside_is_outside = np.zeros(len(row), dtype=bool)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            rays = sensor.camera.normalise(np.column_stack([column + dx, row + dy]))
            directions = np.column_stack([rays, np.ones(len(rays))]) @ pattern_T_camera[:3, :3].T
            origin = pattern_T_camera[:3, 3]
            hit = origin[:2] - origin[2] * directions[:, :2] / directions[:, 2:]
            beside_is_outside |= pattern.border.signed_distance(hit)[0] > 0
        assert np.all(beside_is_outside), key


def test_exact_border_puts_lidar_limit_points_on_the_border():
    exact = scenes.random_scene(3, noise=Noise.none(), sampling=Sampling(exact_border=True))
    checked = 0
    for pattern, _, limit, _ in points_in_pattern(exact, LIDAR3D):
        assert np.max(np.abs(pattern.border.signed_distance(limit[:, :2])[0])) < 1e-9
        assert np.max(np.abs(limit[:, 2])) < 1e-9
        checked += len(limit)
    assert checked > 50
    assert all(len(limit) == 0 for _, _, limit, _ in points_in_pattern(exact, DEPTH))


CAMERAS = {
    "none": Camera(1280, 800, np.array([[900, 0, 640], [0, 905, 400], [0, 0, 1.0]]), model="none"),
    "plumb_bob": scenes.COLOUR_CAMERA,
    "rational_polynomial": Camera(
        1280,
        800,
        np.array([[900, 0, 640], [0, 905, 400], [0, 0, 1.0]]),
        np.array([0.1, 0.02, 1e-3, -1e-3, 0.01, 0.15, 0.01, 0.002]),
        "rational_polynomial",
    ),
    "equidistant": Camera(
        1280,
        800,
        np.array([[700, 0, 640], [0, 700, 400], [0, 0, 1.0]]),
        np.array([0.02, -0.01, 0.003, -0.001]),
        "equidistant",
    ),
}


@pytest.mark.parametrize("model", CAMERAS)
def test_every_camera_model_can_be_simulated(model):
    exact = scenes.two_cameras(2, camera=CAMERAS[model], noise=Noise.none())
    test_corners_project_to_their_pixels(exact)
    assert sum(isinstance(label, RgbLabel) for _, label in exact.dataset.detections()) > 10


def test_noise_has_the_size_that_was_asked_for():
    noisy = paper_cell(0, noise=Noise(corner_px=0.3, lidar_m=0.01))
    corners, along_beam, by_depth = [], [], []
    for key, label, sensor, pattern, sensor_T_pattern in detections_at_truth(noisy):
        if isinstance(label, RgbLabel):
            points = se3.apply(sensor_T_pattern, pattern.corners_of(label.ids))
            corners.append(label.pixels - sensor.camera.project(points))
            continue
        points = range_points(noisy.dataset, key).inside
        normal, origin = sensor_T_pattern[:3, 2], sensor_T_pattern[:3, 3]
        true_share = (normal @ origin) / (points @ normal)  # of the measured range
        if sensor.modality == LIDAR3D:
            along_beam.append(np.linalg.norm(points, axis=1) * (1 - true_share))
        else:
            z = points[:, 2]
            by_depth.append(z * (1 - true_share) / (0.0012 + 0.0019 * (z - 0.4) ** 2))
    assert np.std(np.concatenate(corners)) == pytest.approx(0.3, rel=0.03)
    assert np.std(np.concatenate(along_beam)) == pytest.approx(0.01, rel=0.03)
    assert np.std(np.concatenate(by_depth)) == pytest.approx(1.0, rel=0.03)


def test_gross_errors_come_in_the_share_and_the_sizes_asked_for():
    noisy = scenes.random_scene(0, noise=Noise(0.0, 0.0, 0.0, gross_fraction=0.1))
    corner, along_ray = [], []
    for key, label, sensor, pattern, sensor_T_pattern in detections_at_truth(noisy):
        if isinstance(label, RgbLabel):
            points = se3.apply(sensor_T_pattern, pattern.corners_of(label.ids))
            error = label.pixels - sensor.camera.project(points)
            corner.append(np.linalg.norm(error, axis=1))
        else:
            points = range_points(noisy.dataset, key).inside
            normal, origin = sensor_T_pattern[:3, 2], sensor_T_pattern[:3, 3]
            share = 1 - (normal @ origin) / (points @ normal)
            along_ray.append(np.abs(np.linalg.norm(points, axis=1) * share))
    for errors, low, high, right in ((corner, 20, 60, 1e-6), (along_ray, 0.05, 0.5, 1e-5)):
        errors = np.concatenate(errors)
        wrong = errors > right
        assert np.mean(wrong) == pytest.approx(0.1, abs=0.02)
        assert low - 1e-4 <= errors[wrong].min() and errors[wrong].max() <= high + 1e-4


def test_dropouts_leave_fewer_labels():
    full, thin = (scenes.random_scene(0, noise=Noise(dropout=d)) for d in (0.0, 0.3))
    for key, label in thin.dataset.detections():
        before = full.dataset.label(key)
        count, expected = (
            (len(label.ids), len(before.ids))
            if isinstance(label, RgbLabel)
            else (len(label.indices), len(before.indices))
        )
        assert count == pytest.approx(0.7 * expected, abs=4 * np.sqrt(expected))


def test_impossible_noise_is_refused():
    for wrong in ({"corner_px": -0.1}, {"gross_fraction": 1.1}, {"dropout": 1.0}):
        with pytest.raises(ValueError):
            Noise(**wrong)


def test_clouds_hold_the_room_behind_the_boards():
    exact = scenes.lidar_only(0, noise=Noise.none())
    for key, label in exact.dataset.detections():
        cloud = exact.dataset.data.read(key.collection, key.sensor)
        background = np.setdiff1d(np.arange(len(cloud)), label.indices)
        assert len(background) > 500
        nearest_on_board = np.linalg.norm(cloud[label.indices], axis=1).min()
        assert np.linalg.norm(cloud[background], axis=1).max() > nearest_on_board


def test_background_can_be_kept_whole():
    exact = scenes.lidar_only(0, collections=2, sampling=Sampling(background_step=1))
    for key, sensor in product(exact.dataset.collections, exact.dataset.sensors):
        assert len(exact.dataset.data.read(key, sensor)) == 16 * 1875
