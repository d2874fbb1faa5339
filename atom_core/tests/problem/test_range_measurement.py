"""What points of a range sensor say of a board: its poses, its size, steps across its border."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.expected_noise import LIDAR_SIGMA_M
from atom_core.model.dataset import DataSource, pose
from atom_core.model.labels import DetectionKey, RangeLabel
from atom_core.problem.range_measurement import (
    POINTS_LOOKED_AT,
    measured_in_cloud,
    measured_in_depth_image,
)
from atom_core.synthetic import Noise, scenes

KEY = DetectionKey("000", "lidar_1", "pattern_1")
BEAM_RAD, LAYER_RAD = np.deg2rad(0.2), np.deg2rad(2.0)
MEASURED = {"lidar_1": measured_in_cloud, "depth_1": measured_in_depth_image}


@lru_cache(maxsize=1)
def scene():
    """A rig before a board whose pattern is off its centre, 0.82 x 0.64 m."""
    return scenes.off_centre_board(2, collections=6, noise=Noise.none())


BORDER = scene().dataset.patterns["pattern_1"].border
SIZE_M = 2.0 * BORDER.half_size


class OneCloud(DataSource):
    """The same cloud (n, 3) whatever is asked for."""

    def __init__(self, cloud):
        self._cloud = cloud

    def read(self, collection, sensor):
        return self._cloud


def sensor_T_board(incidence=0.4):
    rotation = se3.rotation_from_rotation_vector(np.array([0.2, np.pi - incidence, 0.1]))
    return se3.transform(rotation, np.array([0.3, -0.1, 2.5]))


def measured(inside, limit):
    """Return the measurement of points (n, 3) on the board and (m, 3) on its border."""
    cloud = np.concatenate([inside, limit])
    every, of_border = np.arange(len(cloud)), np.arange(len(inside), len(cloud))
    label = RangeLabel(every[: len(inside)], of_border)
    dataset = replace(scene().dataset, data=OneCloud(cloud))
    dataset = dataset.with_labels(KEY.collection, {(KEY.sensor, KEY.pattern): label})
    found, remarks = measured_in_cloud(dataset, KEY)
    assert remarks == []
    return found


def on_board(step=0.02):
    """Points (n, 3) on a board and (m, 3) on its border, in the sensor's frame."""
    low, high = BORDER.centre - BORDER.half_size, BORDER.centre + BORDER.half_size
    x, y = (np.arange(a + step / 2, b, step) for a, b in zip(low, high))
    flat = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    around = BORDER.sample(step)
    return tuple(
        se3.apply(sensor_T_board(), np.column_stack([p, np.zeros(len(p))])) for p in (flat, around)
    )


def scan(board):
    """Return a plane's points (layers, beams, 3) that lie on the board, and their rays."""
    azimuth, elevation = np.arange(-0.5, 0.5, BEAM_RAD), np.arange(-0.3, 0.3, LAYER_RAD)
    across, up = np.meshgrid(azimuth, elevation)
    rays = np.stack([np.sin(across) * np.cos(up), np.sin(up), np.cos(across) * np.cos(up)], -1)
    normal, origin = board[:3, 2], board[:3, 3]
    points = rays * ((normal @ origin) / (rays @ normal))[..., None]
    flat = se3.apply(se3.inverse(board), points)[..., :2]
    shape = flat.shape[:-1]
    return points, BORDER.signed_distance(flat.reshape(-1, 2))[0].reshape(shape)


# --- poses ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("with_border", [True, False])
def test_one_of_the_four_poses_of_a_rectangle_is_the_boards(with_border):
    inside, limit = on_board(step=0.01)
    found = measured(inside, limit if with_border else limit[:0])
    poses = found.candidates()
    assert len(poses) == 4
    truth = sensor_T_board()
    angles = [se3.rotation_angle(p[:3, :3].T @ truth[:3, :3]) for p in poses]
    best = poses[int(np.argmin(angles))]
    assert min(angles) < np.deg2rad(2.1)  # orientations in the plane are tried in steps of 4 deg
    centre = np.array([*BORDER.centre, 0.0])
    assert np.linalg.norm(se3.apply(best, centre) - se3.apply(truth, centre)) < 0.01
    count = len(inside[:: len(inside) // POINTS_LOOKED_AT])
    for found_pose in poses:  # all have the points on the board
        assert np.max(np.abs(found.errors_m(found_pose)[:count])) < 1e-6
        flat = se3.apply(se3.inverse(found_pose), inside)[:, :2]
        assert np.max(BORDER.signed_distance(flat)[0]) < 0.03
    facing = [p[:3, :3] @ [0.0, 0.0, 1.0] for p in poses]
    assert sorted(np.sign([f @ truth[:3, 2] for f in facing])) == [-1, -1, 1, 1]


def test_points_on_one_line_have_no_pose():
    line = np.outer(np.linspace(0.0, 1.0, 9), [1.0, 0.2, 0.1]) + [0.0, 0.0, 2.0]
    found = measured(line, line[:0])
    assert found.candidates() == [] and len(found.implausibilities()) == 1


def test_errors_are_heights_over_the_plane_and_distances_to_the_border():
    inside, limit = on_board()
    found, truth = measured(inside, limit), sensor_T_board()
    step = len(inside) // POINTS_LOOKED_AT
    assert step > 1
    np.testing.assert_allclose(found.errors_m(truth), 0.0, atol=1e-9)
    raised = truth @ se3.transform(np.eye(3), np.array([0.0, 0.0, 0.03]))
    count = len(inside[::step])
    np.testing.assert_allclose(found.errors_m(raised)[:count], -0.03, atol=1e-9)
    np.testing.assert_allclose(found.errors_m(raised)[count:], 0.0, atol=1e-9)
    assert len(found.errors_m(truth)) == count + len(limit)
    assert found.rows == len(inside) + len(limit) and found.information == len(limit)
    assert not found.with_atom_residuals().along_rays and found.along_rays


# --- what is wrong with points -------------------------------------------------------------------


def test_sound_points_have_nothing_wrong_and_their_size_is_told():
    inside, limit = on_board()
    found = measured(inside, limit)
    assert found.implausibilities() == []
    assert found.diagonal_m == pytest.approx(np.hypot(*SIZE_M))
    assert found.extent_m == pytest.approx(np.hypot(*(SIZE_M - 0.02)), rel=0.01)


@pytest.mark.parametrize("factor, is_too_large", [(1.1, False), (1.25, True)])
def test_a_label_larger_than_its_board_is_told(factor, is_too_large):
    inside, _ = on_board()
    middle = inside.mean(axis=0)
    found = measured(middle + factor * (inside - middle), inside[:0]).implausibilities()
    assert len(found) == is_too_large
    if is_too_large:
        assert "the label is 1.2" in found[0] and "the board only 1.04 m" in found[0]


@pytest.mark.parametrize("count, words", [(5, ["only 5 points"]), (6, [])])
def test_few_points_do_not_tell(count, words):
    inside, _ = on_board()
    chosen = np.linspace(0, len(inside) - 1, count).astype(int)
    found = measured(inside[chosen], inside[:0]).implausibilities()
    assert len(found) == len(words) and all(w in f for w, f in zip(words, found))


@pytest.mark.parametrize("rms_m, is_plane", [(0.04, True), (0.06, False)])
def test_what_is_no_plane_is_told(rms_m, is_plane):
    inside, _ = on_board()
    heights = np.where(np.arange(len(inside)) % 2, rms_m, -rms_m)
    bent = inside + np.outer(heights, sensor_T_board()[:3, 2])
    found = measured(bent, inside[:0]).implausibilities()
    assert found == ([] if is_plane else [f"the labeled points are no plane (RMS {rms_m:.3f} m)"])


# --- steps of sampling ---------------------------------------------------------------------------


@pytest.mark.parametrize("limits_are_inside", [True, False])
def test_the_step_from_a_limit_point_is_to_the_next_beam_of_its_layer(limits_are_inside):
    board = sensor_T_board()
    points, distance = scan(board)
    inside, limit, expected = [], [], []
    for layer, beyond in zip(points, distance):
        seen = np.flatnonzero(beyond < 0.0)
        if len(seen) < 9:
            continue  # of a corner
        for at, outward in (seen[0], -1), (seen[-1], 1):
            limit.append(layer[at])
            expected.append(np.abs(layer[at + outward] - layer[at]))
        inside.append(layer[seen] if limits_are_inside else layer[seen[1:-1]])
    steps = measured(np.concatenate(inside), np.array(limit)).limit_steps
    np.testing.assert_allclose(steps @ board[:3, 2], 0.0, atol=1e-9)  # on the board
    np.testing.assert_allclose(np.abs(steps[:, 0]), expected, rtol=0.05, atol=1e-4)
    assert len(limit) > 10 and not steps[:, 1].any()  # layers are no direction of sampling


def test_without_points_or_a_plane_there_are_no_steps():
    inside, limit = on_board()
    for some, border in (inside[:2], limit), (inside, limit[:0]), (inside[:1].repeat(9, 0), limit):
        steps = measured(some, border).limit_steps
        assert steps.shape == (len(border), 2, 3) and not steps.any()


# --- whole detections ----------------------------------------------------------------------------


def detections(sensor):
    """Yield the measurements of a sensor with the true poses of their boards."""
    dataset = scene().dataset
    for key, _ in dataset.detections():
        if key.sensor == sensor:
            collection, frame = dataset.collections[key.collection], dataset.sensors[sensor].frame
            sensor_T_world = pose(collection, dataset.graph, frame, dataset.world)
            truth = sensor_T_world @ scene().truth.boards[key.pattern, key.collection]
            yield MEASURED[sensor](dataset, key), truth


@pytest.mark.parametrize("sensor", MEASURED)
def test_a_detection_without_noise_lies_on_its_true_board(sensor):
    every = list(detections(sensor))
    assert len(every) >= 2
    for (found, remarks), truth in every:
        assert found is not None and not remarks and found.implausibilities() == []
        count = len(found.errors_m(truth)) - len(found.limit)
        np.testing.assert_allclose(found.errors_m(truth)[:count], 0.0, atol=1e-6)
        assert np.all(found.inside_sigma_m == LIDAR_SIGMA_M) == (sensor == "lidar_1")
        assert np.all(np.linalg.norm(found.limit_steps[:, 0], axis=1) > 1e-4)


def test_the_step_of_a_pixel_is_to_its_neighbours():
    camera = scene().dataset.sensors["depth_1"].camera
    for (found, _), truth in detections("depth_1"):
        np.testing.assert_allclose(found.limit_steps @ truth[:3, 2], 0.0, atol=1e-6)
        for axis in (0, 1):
            before, after = found.limit, found.limit + found.limit_steps[:, axis]
            moved = (after[:, :2] / after[:, 2:] - before[:, :2] / before[:, 2:]) * camera.focal_px
            np.testing.assert_allclose(moved, np.tile(np.eye(2)[axis], (len(moved), 1)), atol=1e-4)
        np.testing.assert_allclose(
            found.limit_sigma_m, found.limit[:, 2] / np.min(camera.focal_px), rtol=1e-9
        )
