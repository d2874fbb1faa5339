"""Laws of the metrics on plain arrays."""

import numpy as np
import pytest

from atom_core.evaluation import metrics
from atom_core.evaluation.board_pose import board_pose, refine_pose
from atom_core.evaluation.borders import projected_border
from atom_core.evaluation.statistics import Errors, figures
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.polyline import offsets_to_segments
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.labels import DetectionKey
from atom_core.problem.corner_measurement import CornerMeasurement

K = np.array([[900.0, 0, 640], [0, 910.0, 400], [0, 0, 1]])
CAMERAS = {
    "none": Camera(1280, 800, K, model="none"),
    "plumb_bob": Camera(1280, 800, K, np.array([-0.2, 0.05, 0.001, -0.002, 0.01])),
    "equidistant": Camera(1280, 800, K / 2 + np.diag([0, 0, 0.5]), np.full(4, 0.01), "equidistant"),
}
BORDER = Rectangle(-0.04, -0.03, 0.76, 0.57)
GRID = np.array([[0.06 * x, 0.06 * y, 0.0] for y in range(1, 9) for x in range(1, 12)])


def pose(seed, distance=1.5, tilt=0.7):
    rng = np.random.default_rng(seed)
    rotation = se3.random_rotation(tilt, rng)
    centre = rng.uniform(-0.15, 0.15, 3) + [0, 0, distance]
    return se3.transform(rotation, centre - rotation @ [0.36, 0.27, 0.0])


def measured(camera, camera_T_pattern, corners=GRID, sigma=0.0, seed=0):
    pixels = camera.project(se3.apply(camera_T_pattern, corners))
    noise = sigma * np.random.default_rng(seed).standard_normal(pixels.shape)
    key = DetectionKey("000", "rgb", "board")
    return CornerMeasurement(key, camera, np.arange(len(corners)), corners, pixels + noise)


@pytest.mark.parametrize("model", sorted(CAMERAS))
@pytest.mark.parametrize("seed", range(4))
def test_pose_from_corners_is_exact_without_noise(model, seed):
    truth = pose(seed)
    found = board_pose(measured(CAMERAS[model], truth))
    np.testing.assert_allclose(found.camera_T_pattern, truth, atol=1e-9)
    assert found.rms_px < 1e-8


@pytest.mark.parametrize("seed", range(10))
def test_of_both_planar_solutions_the_better_one_is_taken(seed):
    truth = pose(seed, distance=3.0, tilt=0.35)
    measurement = measured(CAMERAS["plumb_bob"], truth, sigma=0.05, seed=seed)
    found = board_pose(measurement)
    assert found.rms_px <= refine_pose(measurement, truth).rms_px + 1e-9
    assert np.degrees(se3.rotation_angle(found.camera_T_pattern[:3, :3].T @ truth[:3, :3])) < 3


def test_corners_on_a_line_give_no_pose():
    assert board_pose(measured(CAMERAS["none"], pose(0), GRID[:11])) is None


@pytest.mark.parametrize("source", sorted(CAMERAS))
@pytest.mark.parametrize("target", sorted(CAMERAS))
def test_carried_corners_are_the_corners_seen_by_the_target(source, target):
    source_T_pattern, target_T_source = pose(1), pose(2, distance=0.3, tilt=0.2)
    here, there = CAMERAS[target], CAMERAS[source]
    carried = metrics.carried_corners(
        there,
        here,
        source_T_pattern,
        target_T_source,
        there.project(se3.apply(source_T_pattern, GRID)),
    )
    expected = here.project(se3.apply(target_T_source @ source_T_pattern, GRID))
    np.testing.assert_allclose(carried, expected, atol=1e-8)


@pytest.mark.parametrize("model", sorted(CAMERAS))
def test_border_distance_agrees_with_brute_force_sampling(model):
    camera, camera_T_pattern = CAMERAS[model], pose(3)
    border = projected_border(camera, camera_T_pattern, BORDER)
    fine = BORDER.sample(2e-5)
    points = se3.apply(camera_T_pattern, np.column_stack([fine, np.zeros(len(fine))]))
    dense = camera.project(points[camera.in_image(points)])
    rng = np.random.default_rng(4)
    pixels = dense[rng.integers(0, len(dense), 150)] + rng.normal(0, 8, (150, 2))
    distance = np.linalg.norm(offsets_to_segments(pixels, border), axis=1)
    brute = np.array([np.min(np.linalg.norm(p - dense, axis=1)) for p in pixels])
    np.testing.assert_allclose(distance, brute, atol=0.01)


def test_border_is_clipped_to_the_image():
    camera = CAMERAS["plumb_bob"]
    beside = se3.transform(np.eye(3), np.array([0.3, -0.25, 1.0]))  # right part out of the image
    border = projected_border(camera, beside, BORDER)
    assert border[..., 0].max() == pytest.approx(1279.5)
    assert border[..., 0].max() <= 1279.5 and border[..., 1].min() >= -0.5
    sides = border[(np.abs(border[:, 0, 0] - border[:, 1, 0]) < 1e-6)]
    assert not np.any(sides[..., 0] > 1270)  # the image's edge is not the board's


def test_border_behind_the_camera_is_nowhere():
    behind = se3.transform(np.eye(3), np.array([0.0, 0.0, -1.0]))
    assert len(projected_border(CAMERAS["none"], behind, BORDER)) == 0


def test_points_out_of_the_image_or_behind_the_camera_do_not_count():
    camera = CAMERAS["none"]
    points = np.array([[0, 0, 1.0], [0, 0, -1.0], [5.0, 0, 1.0], [0.1, 0, 1.0]])
    segments = np.array([[[640.0, 300.0], [640.0, 500.0]]])
    offsets, unseen = metrics.border_offsets(camera, points, segments)
    np.testing.assert_allclose(offsets, [[0, 0], [90, 0]], atol=1e-9)
    assert unseen == 2
    offsets, unseen = metrics.pixel_offsets(camera, points, np.array([[640.0, 402.0]]))
    np.testing.assert_allclose(offsets, [[0, -2], [90, -2]], atol=1e-9)
    assert unseen == 2


def test_nothing_in_the_image_gives_nothing():
    behind = np.array([[0, 0, -1.0]])
    for measure, border in (
        (metrics.border_offsets, np.zeros((1, 2, 2))),
        (metrics.pixel_offsets, np.zeros((1, 2))),
    ):
        offsets, unseen = measure(CAMERAS["none"], behind, border)
        assert offsets.shape == (0, 2) and unseen == 1


def test_nearest_distances_by_brute_force_and_both_directions():
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(40, 3)), rng.normal(size=(30, 3))
    table = np.linalg.norm(a[:, None] - b, axis=2)
    expected = np.concatenate([table.min(axis=1), table.min(axis=0)])
    offsets = metrics.mutual_nearest_offsets(a, b)
    np.testing.assert_allclose(np.linalg.norm(offsets, axis=1), expected)
    np.testing.assert_allclose(offsets[0], a[0] - b[np.argmin(table[0])])
    np.testing.assert_allclose(offsets[-1], b[-1] - a[np.argmin(table[:, -1])])
    np.testing.assert_allclose(metrics.nearest_distances(a, b), table.min(axis=1))


def test_point_to_plane_sees_20_mm_along_the_normal_and_nothing_along_the_plane():
    rng = np.random.default_rng(6)
    a_T_plane = pose(7)
    flat = np.column_stack([rng.uniform(0, 1, (50, 2)), np.zeros(50)])
    other = np.column_stack([rng.uniform(0, 1, (60, 2)) + 0.1, np.full(60, 0.020)])
    plane, points = se3.apply(a_T_plane, flat), se3.apply(a_T_plane, other)
    np.testing.assert_allclose(np.abs(metrics.plane_distances(points, plane)), 0.020, atol=1e-12)


def test_pose_difference_by_hand():
    turned = se3.rotation_from_rotation_vector(np.array([0.0, 0.3, 0.0]))
    a_T_b = pose(8)
    move, turn = se3.pose_difference(a_T_b, a_T_b @ se3.transform(turned, np.array([3, 0, 4])))
    assert (move, turn) == (pytest.approx(5.0), pytest.approx(0.3))


def test_figures_by_hand():
    found = figures(
        [
            Errors.in_image(np.array([[3.0, -4.0], [0.0, 0.0]])),
            Errors.in_image(np.array([[-6.0, 8.0]])),
        ]
    )
    assert found.points == 3
    assert found.rms == pytest.approx(np.sqrt(125 / 3))
    assert (found.mean, found.median) == (5.0, 5.0)
    assert (found.x_mean_abs, found.y_mean_abs) == (3.0, 4.0)
    assert found.x_std_abs == pytest.approx(np.sqrt(6.0))  # of 3, 0 and 6
    assert found.y_std_abs == pytest.approx(np.sqrt(32.0 / 3.0))  # of 4, 0 and 8
    assert found.translation_mm is None
