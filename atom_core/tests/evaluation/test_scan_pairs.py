"""Cuts of 2D LiDARs against planes that are known by construction."""

import numpy as np
import pytest

from atom_core.evaluation.observed import NotMeasurableError
from atom_core.evaluation.plane_pairs import to_plane_of_corners, to_plane_of_points
from atom_core.evaluation.scan_pairs import cuts_in_one_plane
from atom_core.geometry import se3
from atom_core.model.labels import DetectionKey, RangePoints

SCAN, OTHER = DetectionKey("000", "scan", "board"), DetectionKey("000", "other", "board")
NONE = np.zeros(0, dtype=int)
IDENTITY = np.eye(4)
LINE_M = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.5, 0.0, 0.0]])
SQUARE_M = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])


class Seen:
    """What two sensors see of a board, each in its own frame."""

    def __init__(self, cut, other=None, camera_T_pattern=None):
        self._points = {SCAN: cut, OTHER: other}
        self._camera_T_pattern = camera_T_pattern

    def points(self, key):
        return RangePoints(self._points[key], np.zeros((0, 3)), NONE, NONE, 0)

    def camera_T_pattern(self, key):
        assert key == OTHER
        return self._camera_T_pattern


def raised(points, height_m):
    return points + [0.0, 0.0, height_m]


@pytest.fixture
def other_T_scan():
    return se3.random_move(2.0, 1.0, np.random.default_rng(0))


@pytest.mark.parametrize("height_m", [0.02, -0.02, 0.0])
def test_a_cut_20_mm_off_the_plane_of_points_is_20_mm_off_on_either_side(height_m, other_T_scan):
    board = se3.apply(other_T_scan, SQUARE_M)
    seen = Seen(raised(LINE_M, height_m), board)
    errors = to_plane_of_points(seen, SCAN, OTHER, other_T_scan)
    np.testing.assert_allclose(errors.distances, 1000.0 * abs(height_m), atol=1e-9)
    assert errors.distances.shape == (len(LINE_M),) and errors.offsets is None


def test_of_a_cut_askew_each_point_has_its_own_height_above_the_points_plane(other_T_scan):
    cut = np.array([[5.0, 2.0, -0.001], [0.0, -3.0, 0.004]])
    seen = Seen(cut, se3.apply(other_T_scan, SQUARE_M))
    errors = to_plane_of_points(seen, SCAN, OTHER, other_T_scan)
    np.testing.assert_allclose(errors.distances, [1.0, 4.0], atol=1e-9)


@pytest.mark.parametrize("few", [SQUARE_M[:2], LINE_M])
def test_points_without_a_plane_are_named_by_their_sensor(few):
    with pytest.raises(NotMeasurableError, match="the points of 'other' have no plane: .+"):
        to_plane_of_points(Seen(LINE_M, few), SCAN, OTHER, IDENTITY)


@pytest.mark.parametrize("measure", [to_plane_of_points, cuts_in_one_plane])
def test_a_sensor_without_a_labeled_point_is_named(measure):
    for cut, other, name in ((LINE_M[:0], SQUARE_M, "scan"), (LINE_M, SQUARE_M[:0], "other")):
        with pytest.raises(NotMeasurableError, match=f"'{name}' has no labeled point"):
            measure(Seen(cut, other), SCAN, OTHER, IDENTITY)


def test_the_board_s_plane_by_corners_is_z_zero_of_its_own_frame(other_T_scan):
    camera_T_pattern = se3.random_move(1.0, 0.7, np.random.default_rng(1))
    in_board = np.array([[0.3, 0.1, 0.005], [-2.0, 0.4, -0.007], [0.1, 9.0, 0.0]])
    cut = se3.apply(se3.inverse(other_T_scan) @ camera_T_pattern, in_board)
    seen = Seen(cut, camera_T_pattern=camera_T_pattern)
    errors = to_plane_of_corners(seen, SCAN, OTHER, other_T_scan)
    np.testing.assert_allclose(errors.distances, [5.0, 7.0, 0.0], atol=1e-9)


def test_cuts_that_meet_or_are_parallel_lie_in_one_plane(other_T_scan):
    crossing = LINE_M @ se3.rotation_from_rotation_vector(np.array([0.0, 0.0, 1.0])).T
    for second in (crossing, LINE_M + [0.0, 0.3, 0.0]):
        seen = Seen(se3.apply(se3.inverse(other_T_scan), LINE_M), second)
        errors = cuts_in_one_plane(seen, SCAN, OTHER, other_T_scan)
        assert errors.distances.shape == (2 * len(LINE_M),)
        np.testing.assert_allclose(errors.distances, 0.0, atol=1e-9)


def test_the_plane_between_two_skew_cuts_is_as_far_from_each():
    """Two crossing lines of which one is raised: all points are half the gap off."""
    along_x = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    along_y = np.array([[0.0, -1.0, 0.03], [0.0, 1.0, 0.03]])
    errors = cuts_in_one_plane(Seen(along_x, along_y), SCAN, OTHER, IDENTITY)
    np.testing.assert_allclose(errors.distances, 15.0, atol=1e-9)


def test_which_of_two_cuts_is_carried_makes_no_difference(other_T_scan):
    rng = np.random.default_rng(2)
    one, other = rng.normal(size=(5, 3)), rng.normal(size=(4, 3))
    there = cuts_in_one_plane(Seen(one, other), SCAN, OTHER, other_T_scan).distances
    back = se3.inverse(other_T_scan)
    here = cuts_in_one_plane(Seen(other, one), SCAN, OTHER, back).distances
    np.testing.assert_allclose(np.sort(there), np.sort(here), rtol=1e-9)
    assert there.max() > 1.0
