"""Corners of a board in one image: the poses they allow, their errors, and what is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.expected_noise import CORNER_SIGMA_PX
from atom_core.model.labels import DetectionKey
from atom_core.model.sensor import RGB
from atom_core.problem.corner_measurement import (
    M_PER_PX,
    NO_PLACE,
    CornerMeasurement,
    _on_a_line,
    corner_blocks,
    measured_corners,
)
from atom_core.synthetic import Noise, scenes

KEY = DetectionKey("000", "rgb_1", "pattern_1")
K = np.array([[900.0, 0.0, 640.0], [0.0, 880.0, 400.0], [0.0, 0.0, 1.0]])
CAMERA = Camera(1280, 800, K, [], "none")
GRID = np.stack(np.meshgrid(np.arange(5), np.arange(4)), axis=-1).reshape(-1, 2)
CORNERS = np.column_stack([0.08 * GRID, np.zeros(len(GRID))])
POSE = se3.from_rpy(np.array([-0.1, 0.05, 1.5]), np.array([0.5, -0.3, 0.2]))


def corners_seen(pose=POSE, corners=CORNERS):
    pixels = CAMERA.project(se3.apply(pose, corners))
    return CornerMeasurement(KEY, CAMERA, np.arange(len(corners)), corners, pixels)


class Proposed(CornerMeasurement):
    """Corners whose poses are given."""

    def candidates(self):
        return list(self.given)


def proposed(poses, seen=None):
    seen = seen or corners_seen()
    measurement = Proposed(KEY, CAMERA, seen.ids, seen.corners_in_pattern, seen.pixels)
    object.__setattr__(measurement, "given", poses)
    return measurement


def moved_sideways(offset_px):
    """Return a pose of a board that faces the camera, all of whose corners are so much off."""
    return se3.transform(np.eye(3), np.array([offset_px * 2.0 / 900.0, 0.0, 2.0]))


FACING = moved_sideways(0.0)


def test_the_first_candidate_is_the_pose_from_which_the_corners_were_seen():
    first, *others = corners_seen().candidates()
    np.testing.assert_allclose(first, POSE, atol=1e-6)
    assert len(others) <= 1


def test_corners_tell_their_count_in_rows_and_information():
    seen = corners_seen()
    assert seen.information == 20 and seen.rows == 40 and seen.identifies_board


@pytest.mark.parametrize("count, has_pose", [(5, False), (6, True)])
def test_six_corners_are_needed(count, has_pose):
    corners = CORNERS[[0, 4, 7, 12, 15, 19]][:count]
    seen = corners_seen(corners=corners)
    assert bool(seen.candidates()) == has_pose
    assert seen.implausibilities() == ([] if has_pose else [NO_PLACE])


def test_corners_of_one_row_have_no_pose():
    row = np.column_stack([0.05 * np.arange(8), np.zeros(8), np.zeros(8)])
    assert corners_seen(corners=row).candidates() == []
    assert corners_seen(corners=row).implausibilities() == [NO_PLACE]


@pytest.mark.parametrize("share, on_a_line", [(0.9e-6, True), (1.1e-6, False)])
@pytest.mark.parametrize("size_m", [1e-4, 1.0, 100.0])
def test_points_are_on_a_line_up_to_a_millionth_of_its_length(share, on_a_line, size_m):
    cross = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -share], [0.0, share]])
    assert _on_a_line(size_m * cross + [3.0, -1.0]) == on_a_line


def test_points_in_one_place_are_on_a_line():
    assert _on_a_line(np.ones((6, 2)))


def test_a_pose_behind_the_camera_is_no_candidate(monkeypatch):
    turned = POSE.copy()
    turned[2, 3] = -1.5
    partly = se3.from_rpy(np.array([0.0, 0.0, 0.0]), np.array([0.5, 0.3, 0.0]))
    broken = np.full((4, 4), np.nan)
    monkeypatch.setattr(
        "atom_core.problem.corner_measurement.planar_poses",
        lambda points, rays: [turned, POSE, partly, broken],
    )
    found = corners_seen().candidates()
    assert len(found) == 1 and found[0] is POSE


def test_errors_are_distances_in_the_image_as_metres():
    errors_m = corners_seen(FACING).errors_m(moved_sideways(6.0))
    np.testing.assert_allclose(errors_m, 6.0 * 0.1 / 30.0)
    assert pytest.approx(0.1) == 30.0 * M_PER_PX
    pixels = corners_seen(FACING).pixels + [3.0, -4.0]
    shifted = replace(corners_seen(FACING), pixels=pixels)
    np.testing.assert_allclose(shifted.errors_m(FACING), 5.0 * M_PER_PX)
    assert len(errors_m) == 20


def test_rms_is_over_corners_not_over_coordinates():
    shift_px = np.zeros((20, 2))
    shift_px[:10] = 3.0, 4.0
    seen = replace(corners_seen(), pixels=corners_seen().pixels + shift_px)
    assert seen._rms_px(POSE) == pytest.approx(5.0 * np.sqrt(0.5))


@pytest.mark.parametrize("second_px, count", [(1.9, 2), (2.1, 1)])
def test_a_second_pose_is_likely_up_to_three_times_the_error_and_half_a_pixel(second_px, count):
    first, second = moved_sideways(0.5 - 1e-9), moved_sideways(second_px)
    seen = corners_seen(FACING)
    likely = proposed([second, first], seen).likely_candidates()  # 3 * 0.5 px + 0.5 px is 2 px
    assert len(likely) == count and likely[0] is first


def test_a_single_pose_is_likely_whatever_its_error():
    far = moved_sideways(50.0)
    assert [*proposed([far]).likely_candidates()] == [far]
    assert proposed([]).likely_candidates() == []


def test_two_equally_good_poses_are_both_likely():
    both = [FACING, FACING.copy()]
    assert len(proposed(both, corners_seen(FACING)).likely_candidates()) == 2


@pytest.mark.parametrize("rms_px, is_told", [(2.9, False), (3.1, True)])
def test_corners_that_fit_no_pose_are_told_with_their_rms(rms_px, is_told):
    seen = corners_seen(FACING)
    told = proposed([moved_sideways(rms_px), FACING], seen).implausibilities()
    assert bool(told) == is_told
    assert not is_told or f"(RMS {rms_px:.1f} px)" in told[0]


def test_a_label_is_measured_with_the_corners_of_its_pattern():
    dataset = scenes.hand_eye(1, collections=3, noise=Noise.none()).dataset
    for key, label in dataset.detections():
        found, remarks = measured_corners(dataset, key)
        assert remarks == [] and found.key == key and found.implausibilities() == []
        assert found.camera is dataset.sensors[key.sensor].camera
        expected = dataset.patterns[key.pattern].corners_of(label.ids)
        np.testing.assert_array_equal(found.corners_in_pattern, expected)
        np.testing.assert_array_equal(found.pixels, label.pixels)
        np.testing.assert_array_equal(found.ids, label.ids)


def test_a_block_stacks_the_corners_of_its_detections_in_order():
    dataset = scenes.hand_eye(1, collections=3).dataset
    sensor = replace(dataset.sensors["rgb_1"], camera=CAMERA)
    some = corners_seen(corners=CORNERS[:7])
    (block,) = corner_blocks(sensor, [(2, some), (5, corners_seen())])
    np.testing.assert_array_equal(block.detection, [2] * 7 + [5] * 20)
    np.testing.assert_array_equal(block.ids, [*range(7), *range(20)])
    np.testing.assert_array_equal(block.sigma, np.full(27, CORNER_SIGMA_PX))
    assert 0.1 < CORNER_SIGMA_PX < 1.0  # corners are found to a part of a pixel
    assert (block.sensor, block.modality, block.camera) == ("rgb_1", RGB, CAMERA)
    residuals = block.residuals(np.tile(POSE, (6, 1, 1)))
    np.testing.assert_allclose(residuals, 0.0, atol=1e-9)
