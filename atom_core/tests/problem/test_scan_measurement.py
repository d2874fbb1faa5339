"""The cut of a board in a scan: points moved onto their line, what to expect of them and ends."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.geometry import se3
from atom_core.geometry.expected_noise import LIDAR_SIGMA_M
from atom_core.geometry.line import LineFit
from atom_core.model.dataset import DataSource
from atom_core.model.labels import DetectionKey, RangeLabel, RangePoints
from atom_core.model.laser_scan import LaserScan
from atom_core.model.sensor import LIDAR2D
from atom_core.problem.residuals import BorderBlock, OrthogonalBlock
from atom_core.problem.scan_measurement import (
    _moved_onto,
    _sigmas_and_steps,
    _sines,
    measured_in_scan,
    scan_blocks,
)
from atom_core.synthetic import scenes

KEY = DetectionKey("000", "lidar_1", "pattern_1")
BEAM_RAD = np.deg2rad(0.25)
ANGLES_RAD = np.arange(-np.pi / 2, np.pi / 2, BEAM_RAD)
BEAMS = np.column_stack([np.cos(ANGLES_RAD), np.sin(ANGLES_RAD), np.zeros(len(ANGLES_RAD))])
MIDDLE_M = np.array([2.0, 0.3, 0.0])


def along(slant_deg):
    """Return the direction of a cut that the beam to its middle meets at a slant."""
    ahead = np.arctan2(MIDDLE_M[1], MIDDLE_M[0])
    angle = ahead + np.deg2rad(slant_deg)
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def ranges_to(slant_deg):
    """Return how far along each beam the line is, from its equation in the plane of the scan."""
    direction = along(slant_deg)
    normal = np.array([-direction[1], direction[0], 0.0])
    return (normal @ MIDDLE_M) / (BEAMS @ normal)


def cut(slant_deg, half_length_m=0.4):
    """Return which beams meet the board, and the ranges along all."""
    range_m = ranges_to(slant_deg)
    place = (BEAMS * range_m[:, None] - MIDDLE_M) @ along(slant_deg)
    return np.flatnonzero((np.abs(place) < half_length_m) & (range_m > 0.0)), range_m


class OneScan(DataSource):
    """The same scan whatever is asked for."""

    def __init__(self, scan):
        self._scan = scan

    def read(self, collection, sensor):
        return self._scan


@pytest.fixture(scope="module")
def dataset():
    dataset = scenes.random_scene(1, rgb=1, depth=0, lidar3d=1, collections=3).dataset
    scanner = replace(dataset.sensors["lidar_1"], modality=LIDAR2D)
    return replace(dataset, sensors={**dataset.sensors, "lidar_1": scanner})


def measured(dataset, range_m, inside, ends=None, step_rad=BEAM_RAD):
    ends = inside[[0, -1]] if ends is None else ends
    usable = np.where(np.isin(np.arange(len(range_m)), inside), range_m, 0.0)
    usable[0] = 1.0  # some beam has a value, whatever is labeled
    first_rad = ANGLES_RAD[0] if step_rad > 0 else -ANGLES_RAD[0]
    scan = LaserScan(usable, first_rad, step_rad, 0.05, 30.0)
    data = replace(dataset, data=OneScan(scan))
    label = {(KEY.sensor, KEY.pattern): RangeLabel(inside, ends)}
    return measured_in_scan(data.with_labels(KEY.collection, label), KEY)


# --- points onto their line ----------------------------------------------------------------------


def test_moved_points_lie_on_the_line_and_on_their_beams():
    slant_deg, rng = 50.0, np.random.default_rng(0)
    inside, range_m = cut(slant_deg)
    noisy_m = range_m[inside] + 0.01 * rng.standard_normal(len(inside))
    points = BEAMS[inside] * noisy_m[:, None]
    line = LineFit(MIDDLE_M, along(slant_deg), np.zeros(len(points)))
    on_line, deviation_m = _moved_onto(line, points)
    np.testing.assert_allclose(on_line, BEAMS[inside] * range_m[inside, None], atol=1e-12)
    np.testing.assert_allclose(np.cross(on_line, points), 0.0, atol=1e-12)
    sine = np.abs(np.cross(BEAMS[inside], along(slant_deg))[:, 2])
    beyond_m = sine * (noisy_m - range_m[inside])
    np.testing.assert_allclose(np.abs(deviation_m), np.abs(beyond_m), atol=1e-12)
    same_side = np.unique(np.sign(deviation_m * beyond_m))
    assert len(same_side) == 1  # one normal for all of them


def test_both_senses_of_a_line_say_the_same_but_for_the_sign():
    inside, range_m = cut(70.0)
    points = BEAMS[inside] * (range_m[inside] + 0.01)[:, None]
    there, back = (
        _moved_onto(LineFit(MIDDLE_M, sense * along(70.0), np.zeros(1)), points)
        for sense in (1.0, -1.0)
    )
    np.testing.assert_allclose(there[0], back[0])
    np.testing.assert_allclose(there[1], -back[1])


@pytest.mark.parametrize("sine, is_moved", [(0.049, False), (0.051, True)])
def test_a_cut_that_is_seen_from_its_end_is_left_as_it_is(sine, is_moved):
    slant_deg = np.rad2deg(np.arcsin(sine))
    points = MIDDLE_M + np.linspace(-0.1, 0.1, 5)[:, None] * along(slant_deg) + [0.0, 0.003, 0.0]
    on_line, deviation_m = _moved_onto(LineFit(MIDDLE_M, along(slant_deg), np.zeros(5)), points)
    assert bool(np.any(deviation_m)) == is_moved
    assert bool(np.any(on_line != points)) == is_moved
    assert deviation_m.shape == (5,)


# --- what to expect ------------------------------------------------------------------------------


@pytest.mark.parametrize("slant_deg", [10.0, 30.0, 90.0, 120.0])
def test_sines_are_those_of_the_angle_between_beam_and_cut(slant_deg):
    found = _sines(3.0 * MIDDLE_M[None], along(slant_deg))
    np.testing.assert_allclose(found, np.sin(np.deg2rad(slant_deg)))


@pytest.mark.parametrize("sine, expected", [(0.0, 0.05), (0.049, 0.05), (0.051, 0.051)])
def test_sines_are_not_below_a_twentieth(sine, expected):
    slant_deg = np.rad2deg(np.arcsin(sine))
    np.testing.assert_allclose(_sines(MIDDLE_M[None], along(slant_deg)), expected)


def few(slant_deg):
    points = MIDDLE_M + np.linspace(-0.4, 0.4, 9)[:, None] * along(slant_deg)
    ends = points[[0, -1]]
    return RangePoints(points, ends, np.arange(9), np.array([0, 8]), 0)


def test_noise_along_a_slanted_beam_moves_a_point_less_off_the_board():
    points = few(30.0)
    (inside_m, _), _ = _sigmas_and_steps(points, along(30.0), BEAM_RAD)
    across = np.abs(np.cross(points.inside, along(30.0))[:, 2])
    expected_m = LIDAR_SIGMA_M * across / np.linalg.norm(points.inside, axis=1)
    np.testing.assert_allclose(inside_m, expected_m)


@pytest.mark.parametrize("slant_deg", [30.0, 90.0, 140.0])
def test_the_next_beam_would_meet_the_cut_a_step_beyond_each_end(slant_deg):
    points, step_rad = few(slant_deg), 1e-4
    _, steps = _sigmas_and_steps(points, along(slant_deg), step_rad)
    assert steps.shape == (2, 2, 3) and not steps[:, 1].any()
    for end, step in zip(points.limit, steps[:, 0]):
        beyond = end + step
        turned_rad = np.arccos(end @ beyond / np.linalg.norm(end) / np.linalg.norm(beyond))
        assert turned_rad == pytest.approx(step_rad, rel=0.01)
        assert step @ (end - MIDDLE_M) > 0.0  # away from the board
        np.testing.assert_allclose(np.cross(step, along(slant_deg)), 0.0, atol=1e-15)


def test_the_sense_of_the_direction_does_not_matter():
    points = few(40.0)
    one, other = (_sigmas_and_steps(points, s * along(40.0), BEAM_RAD) for s in (1.0, -1.0))
    np.testing.assert_allclose(one[1], other[1], atol=1e-15)
    for mine, theirs in zip(one[0], other[0]):
        np.testing.assert_allclose(mine, theirs)


def test_an_end_is_spread_evenly_over_a_step_and_moved_along_by_noise():
    points = few(30.0)
    (_, end_m), steps = _sigmas_and_steps(points, along(30.0), BEAM_RAD)
    step_m = np.linalg.norm(steps[:, 0], axis=1)
    cosine = np.abs(points.limit @ along(30.0)) / np.linalg.norm(points.limit, axis=1)
    variance = step_m**2 / 12.0 + (LIDAR_SIGMA_M * cosine) ** 2
    np.testing.assert_allclose(end_m**2, variance)


# --- whole detections ----------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_a_labeled_cut_is_measured_as_its_line(dataset, turns):
    inside, range_m = cut(60.0)
    found, remarks = measured(dataset, range_m, inside, step_rad=turns * BEAM_RAD)
    assert remarks == [] and found.implausibilities() == [] and found.candidates() == []
    mirrored = BEAMS * [1.0, turns, 1.0]
    expected = mirrored[inside] * range_m[inside, None]
    np.testing.assert_allclose(found.inside, expected, atol=1e-6)
    np.testing.assert_allclose(found.on_line, expected, atol=1e-5)
    np.testing.assert_allclose(found.deviation_m, 0.0, atol=1e-6)
    assert not found.along_rays and found.border == dataset.patterns["pattern_1"].border
    np.testing.assert_array_equal(found.inside_indices, inside)
    np.testing.assert_array_equal(found.limit_indices, inside[[0, -1]])
    sines = np.abs(np.cross(mirrored[inside], along(60.0) * [1.0, turns, 1.0])[:, 2])
    np.testing.assert_allclose(found.inside_sigma_m, LIDAR_SIGMA_M * sines, rtol=1e-4)
    next_to = mirrored[inside[[0, -1]] + [-1, 1]] * range_m[inside[[0, -1]] + [-1, 1], None]
    np.testing.assert_allclose(found.limit_steps[:, 0], next_to - found.limit, rtol=0.05, atol=1e-4)


def test_a_single_point_has_no_line(dataset):
    inside, range_m = cut(60.0)
    found, remarks = measured(dataset, range_m, inside[:1], inside[:1])
    assert remarks == [] and found.implausibilities() == ["1 point(s) have no line"]
    np.testing.assert_array_equal(found.inside_sigma_m, [LIDAR_SIGMA_M])
    np.testing.assert_array_equal(found.limit_sigma_m, [LIDAR_SIGMA_M])
    assert found.limit_steps.shape == (1, 2, 3) and not found.limit_steps.any()
    np.testing.assert_array_equal(found.on_line, found.inside)
    np.testing.assert_array_equal(found.deviation_m, [0.0])
    assert not found.along_rays


def test_a_label_without_points_is_no_measurement(dataset):
    inside, range_m = cut(60.0)
    found, remarks = measured(dataset, range_m, inside[:0], inside[:0])
    assert found is None
    (remark,) = remarks
    assert "no labeled point has a value" in remark


@pytest.mark.parametrize("rms_m, is_line", [(0.049, True), (0.051, False)])
def test_what_is_no_line_is_told(dataset, rms_m, is_line):
    inside, range_m = cut(90.0)
    found, _ = measured(dataset, range_m, inside)
    side = np.array([1.0, -1.0, -1.0, 1.0])[:, None] * np.array([1.0, 0.0, 0.0])
    four = [[2.0, y, 0.0] for y in (-0.3, -0.1, 0.1, 0.3)] + rms_m * side
    told = replace(found, inside=four).implausibilities()
    assert told == ([] if is_line else [f"the labeled points are no line (RMS {rms_m:.3f} m)"])


def test_a_line_longer_than_the_board_is_told(dataset):
    inside, range_m = cut(90.0, half_length_m=2.0)
    found, _ = measured(dataset, range_m, inside)
    (told,) = found.implausibilities()
    assert "across, the board only" in told


def test_heights_are_those_of_the_line_with_the_deviations_added(dataset):
    inside, range_m = cut(60.0)
    noisy_m = range_m + 0.01 * np.random.default_rng(1).standard_normal(len(range_m))
    found, _ = measured(dataset, noisy_m, inside)
    sensor = dataset.sensors["lidar_1"]
    heights, ends = scan_blocks(sensor, [(4, found), (7, found)])
    assert isinstance(heights, OrthogonalBlock) and isinstance(ends, BorderBlock)
    assert heights.modality == LIDAR2D and not heights.along_rays
    count = len(inside)
    np.testing.assert_array_equal(heights.detection, [4] * count + [7] * count)
    np.testing.assert_array_equal(ends.detection, [4, 4, 7, 7])
    np.testing.assert_array_equal(heights.points, np.vstack([found.on_line] * 2))
    np.testing.assert_array_equal(ends.points, np.vstack([found.limit] * 2))
    far = se3.transform(np.eye(3), np.array([0.0, 0.0, -0.2]))  # a level board below the scan
    residual = heights.residuals(np.tile(far, (8, 1, 1)))[:, 0]
    np.testing.assert_allclose(residual, 0.2 + np.tile(found.deviation_m, 2))


def test_a_cut_without_ends_has_heights_only(dataset):
    inside, range_m = cut(60.0)
    found, _ = measured(dataset, range_m, inside, inside[:0])
    (heights,) = scan_blocks(dataset.sensors["lidar_1"], [(0, found)])
    assert heights.count == len(inside)
