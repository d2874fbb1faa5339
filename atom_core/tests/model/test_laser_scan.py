"""The scan of a 2D LiDAR as a value: points, what is valid, what is refused."""

import numpy as np
import pytest

from atom_core.errors import DatasetError
from atom_core.model.laser_scan import LaserScan, fields_of, scan_from_fields

FIELDS = {
    "angle_min": -1.0,
    "angle_max": 1.0,
    "angle_increment": 0.5,
    "range_min": 0.1,
    "range_max": 10.0,
    "ranges": [1.0, 2.0, 3.0, 4.0, 5.0],
}


def fields(**changes):
    return {**FIELDS, **changes}


def test_points_lie_in_the_plane_at_the_beams_angles():
    scan = scan_from_fields(FIELDS)
    assert np.allclose(scan.angles, [-1.0, -0.5, 0.0, 0.5, 1.0])
    assert np.allclose(scan.points[2], [3.0, 0.0, 0.0])
    assert np.allclose(scan.points[4], [5.0 * np.cos(1.0), 5.0 * np.sin(1.0), 0.0])


def test_a_sensor_that_turns_clockwise():
    scan = scan_from_fields(fields(angle_min=1.0, angle_max=-1.0, angle_increment=-0.5))
    assert np.allclose(scan.angles, [1.0, 0.5, 0.0, -0.5, -1.0])
    assert np.allclose(scan.points[0], [np.cos(1.0), np.sin(1.0), 0.0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 0.0, 0.05, 10.0, 10.5, -1.0, None])
def test_what_is_not_valid_is_no_point_and_keeps_its_place(bad):
    scan = scan_from_fields(fields(ranges=[1.0, bad, 3.0, 4.0, 5.0]))
    assert scan.valid.tolist() == [True, False, True, True, True]
    assert np.all(np.isnan(scan.points[1])) and np.all(np.isfinite(scan.points[2:]))
    assert scan.beyond.tolist() == [False, bad in (np.inf, 10.0, 10.5), False, False, False]


@pytest.mark.parametrize(
    ("count", "step_deg", "closed"),
    [
        (360, 1.0, True),
        (361, 1.0, True),
        (1440, -0.25, True),
        (359, 1.0, False),
        (541, 0.5, False),
        (897, np.degrees(0.007), True),  # 1.6 steps from the last to the first
    ],
)
def test_whether_the_last_beam_is_the_neighbor_of_the_first(count, step_deg, closed):
    scan = LaserScan(np.ones(count), 0.0, np.radians(step_deg), 0.1, 10.0)
    assert scan.is_closed == closed


def test_a_step_rounded_to_four_decimals_is_taken_from_the_span():
    count = 541
    scan = scan_from_fields(
        fields(angle_min=-2.3562, angle_max=2.3562, angle_increment=0.0087, ranges=[1.0] * count)
    )
    assert scan.angles[-1] == pytest.approx(2.3562, abs=1e-9)


@pytest.mark.parametrize("step", [0.007, 0.004, 0.003, 0.002, 0.001, 0.005, 0.006, 0.008, 0.0087])
def test_a_scan_of_velodyne_laserscan_keeps_the_step_of_its_message(step):
    step = float(np.float32(step))
    count, pi = int(2.0 * np.pi / step), float(np.float32(np.pi))  # as the driver has them
    message = fields(angle_min=-pi, angle_max=pi, angle_increment=step, ranges=[2.0] * count)
    scan = scan_from_fields(message)
    assert scan.angle_increment == step and scan.is_closed
    assert scan_from_fields(fields_of(scan)).angle_increment == step  # through a dataset, too


def test_angle_max_one_step_beyond_the_last_beam_is_usual():
    scan = scan_from_fields(fields(angle_max=1.5))
    assert scan.angle_increment == 0.5


def test_fields_come_back_as_they_were():
    before = fields(intensities=[9.0] * 5, scan_time=0.025, time_increment=1e-5, header={"seq": 1})
    assert fields_of(scan_from_fields(before)) == before


def test_what_a_dataset_lacks_is_filled_in():
    few = {name: FIELDS[name] for name in ("ranges", "angle_min", "angle_increment")}
    written = fields_of(scan_from_fields(few))
    assert written["angle_max"] == 1.0 and written["intensities"] == []
    assert scan_from_fields(few).valid.all()


@pytest.mark.parametrize("none", [np.inf, 0.0, 0, None])
def test_without_a_farthest_range_all_returns_are_valid_and_none_is_infinity(none):
    scan = scan_from_fields(fields(range_max=none, ranges=[1.0, np.inf, 500.0, np.nan, 2.0]))
    assert scan.valid.tolist() == [True, False, True, False, True]
    assert scan.beyond.tolist() == [False, True, False, False, False]
    assert np.isfinite(fields_of(scan)["range_max"])  # JSON has no infinity


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ranges": [np.nan, np.inf, 0.0, 20.0, -1.0]}, "no valid range"),
        ({"ranges": [1.0, 2.0]}, "has 2 ranges, but its angles make 5"),
        ({"ranges": [1.0]}, "at least two"),
        ({"ranges": None}, "no field 'ranges'"),
        ({"ranges": "far"}, "no list of numbers"),
        ({"ranges": [[1.0, 2.0]] * 5}, "a row is needed"),
        ({"angle_increment": 0.0}, "angle_increment is 0"),
        ({"angle_increment": np.nan}, "a finite number is needed"),
        ({"angle_min": None}, "no field 'angle_min'"),
        ({"angle_increment": 3.0, "angle_max": 11.0}, "more than one turn"),
        ({"range_min": 20.0}, "range_min 20 m"),
        ({"range_min": -1.0}, "range_min must be 0 or more"),
        ({"intensities": [1.0, 2.0]}, "5 ranges but 2 intensities"),
    ],
)
def test_bad_scans_are_refused_in_one_sentence(changes, words):
    with pytest.raises(DatasetError, match=words) as error:
        scan_from_fields(fields(**changes))
    assert "\n" not in str(error.value)


def test_a_scan_cannot_be_changed():
    scan = scan_from_fields(FIELDS)
    with pytest.raises(ValueError, match="read-only"):
        scan.ranges[0] = 7.0
