"""Standing still is told from moving, whatever the noise of the labels."""

import numpy as np
import pytest

from atom_core.geometry.expected_noise import CORNER_SIGMA_PX, LIDAR_SIGMA_M
from atom_core.labeling.stillness import (
    LIDAR_NOISE,
    CornerSighting,
    StillnessOptions,
    StopDetector,
    motion,
    plane_sighting,
)

GRID = np.stack(np.meshgrid(np.arange(11), np.arange(8)), axis=-1).reshape(-1, 2) * 25.0 + 100.0


def corners(shift, rng, noise_px=0.2, count=88):
    ids = np.sort(rng.permutation(88)[:count])
    return CornerSighting(ids, GRID[ids] + shift + rng.normal(size=(count, 2)) * noise_px)


def board_points(shift, rng, noise_m=0.008, layers=8):
    across, layer = np.meshgrid(np.linspace(-0.4, 0.4, 30), np.linspace(-0.25, 0.25, layers))
    points = np.stack([3.0 + rng.normal(size=across.shape) * noise_m, across, layer], axis=-1)
    return points.reshape(-1, 3) + shift


@pytest.mark.parametrize("count", [4, 8, 22, 88])
def test_corner_noise_alone_is_no_motion(count):
    rng = np.random.default_rng(0)
    moved = [corners(0, rng, count=88).motion(corners(0, rng, count=count)) for _ in range(300)]
    assert np.mean(np.array(moved) > 1.0) <= 0.02


@pytest.mark.parametrize("shift", [(0.6, 0.0), (0.0, -0.6), (3.0, 4.0)])
def test_a_board_that_moved_by_two_sigmas_is_seen_to_move(shift):
    rng = np.random.default_rng(1)
    moved = [corners(0, rng).motion(corners(shift, rng)) for _ in range(50)]
    assert min(moved) > 1.0
    assert np.median(moved) == pytest.approx(np.linalg.norm(shift) / CORNER_SIGMA_PX, rel=0.1)


def test_a_board_that_turns_about_its_middle_is_seen_to_move():
    rng = np.random.default_rng(2)
    still, turned = corners(0, rng), corners(0, rng)
    away = turned.pixels - turned.pixels.mean(axis=0)
    turned.pixels[:] += 0.01 * away[:, ::-1] * [1, -1]
    assert still.motion(turned) > 1.0


def test_without_common_corners_nothing_is_known():
    first, second = (
        CornerSighting(np.arange(9), GRID[:9]),
        CornerSighting(np.arange(9) + 20, GRID[:9]),
    )
    assert first.motion(second) == np.inf


@pytest.mark.parametrize("layers", [4, 8])
def test_range_noise_alone_is_no_motion_even_if_a_layer_comes_and_goes(layers):
    rng = np.random.default_rng(3)
    for _ in range(100):
        first = plane_sighting(board_points(0.0, rng, layers=layers), LIDAR_NOISE)
        second = plane_sighting(board_points(0.0, rng, layers=layers)[30:], LIDAR_NOISE)
        assert motion(first, second) < 1.0


def test_a_plane_that_moved_or_turned_is_seen_to_move():
    rng = np.random.default_rng(4)
    first = plane_sighting(board_points(0.0, rng), LIDAR_NOISE)
    nearer = plane_sighting(board_points([2 * LIDAR_SIGMA_M, 0, 0], rng), LIDAR_NOISE)
    beside = plane_sighting(board_points([0, 0.3, 0], rng), LIDAR_NOISE)
    turned = board_points(0.0, rng)
    turned[:, 0] += 0.1 * turned[:, 1]
    assert min(motion(first, nearer), motion(first, beside)) > 1.0
    assert motion(first, plane_sighting(turned, LIDAR_NOISE)) > 1.0


def run(times_and_shifts, options=None, sensors=("a", "b")):
    rng = np.random.default_rng(5)
    detector = StopDetector(options or StillnessOptions())
    found = []
    for time_s, shift in times_and_shifts:
        for sensor in sensors:
            found.append(detector.add(sensor, time_s, corners(shift, rng)))
    found.append(detector.finish())
    return [stop for stop in found if stop is not None]


def path(still_s=1.5, moving_s=1.0, stops=3, period_s=0.1):
    """A board that stands, moves at 50 px/s, stands, ..."""
    shift, time_s = 0.0, 0.0
    for _ in range(stops):
        for _ in range(int(round(still_s / period_s))):
            yield time_s, (shift, 0.0)
            time_s += period_s
        for _ in range(int(round(moving_s / period_s))):
            shift += 50.0 * period_s
            yield time_s, (shift, 0.0)
            time_s += period_s


def test_each_stop_is_found_once_and_lies_within_the_truth():
    stops = run(path())
    assert len(stops) == 3
    for number, stop in enumerate(stops):
        assert 2.5 * number - 0.11 <= stop.start_s < stop.end_s <= 2.5 * number + 1.5
        assert stop.end_s - stop.start_s > 1.2


def test_a_board_that_never_rests_gives_no_stop():
    assert run(path(still_s=0.1, moving_s=3.0)) == []


def test_a_slow_drift_is_no_stop():
    assert run((t, (2.0 * t, 0.0)) for t in np.arange(0, 10, 0.1)) == []


def test_a_long_stop_is_reported_before_it_ends_and_only_once():
    stops = run(path(still_s=30.0, stops=1))
    assert len(stops) == 1 and stops[0].end_s <= 3.2


def test_a_sensor_that_lost_the_board_for_long_does_not_vouch_for_the_time_between():
    assert run([(0.0, (0, 0)), (0.1, (0, 0)), (20.0, (0, 0)), (20.1, (0, 0))]) == []


def test_time_that_no_sensor_saw_twice_is_no_stop():
    rng = np.random.default_rng(6)
    detector, found = StopDetector(), []
    for sensor, time_s, shift in (("a", 0.0, 0), ("b", 1.0, 0), ("b", 1.4, 90), ("a", 1.5, 90)):
        found.append(detector.add(sensor, time_s, corners((shift, 0.0), rng)))
    assert [*found, detector.finish()] == [None] * 5


def test_a_stop_ends_when_the_board_goes_out_of_sight_and_is_reported_once():
    rng = np.random.default_rng(7)
    detector = StopDetector()
    for time_s in np.arange(0.0, 1.05, 0.1):
        assert detector.add("a", time_s, corners((0.0, 0.0), rng)) is None
    found = [detector.pass_time(1.0 + wait_s) for wait_s in (0.5, 1.4, 1.6, 2.0, 9.0)]
    assert [stop is not None for stop in found] == [False, False, True, False, False]
    assert found[2] == pytest.approx((0.0, 1.0))
    assert detector.finish() is None
    # What comes then is another stop, even where the board stands as before.
    for time_s in np.arange(20.0, 21.05, 0.1):
        detector.add("b", time_s, corners((0.0, 0.0), rng))
    assert detector.finish() == pytest.approx((20.0, 21.0))
