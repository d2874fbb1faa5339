"""Never confidently wrong: what breaks an assumption is harmless, or it is named.

For every planted fault either each sensor is right within three stated sigmas, each of the six
numbers of its pose by itself, and within 20 mm (a sigma of metres would be right about anything);
or the status is not `converged`, and the true cause is among the first two reasons given.
"""

import re
from typing import NamedTuple

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, CalibrationOptions
from atom_core.calibration.refine.held_back import pull_sigma
from atom_core.calibration.refine.model_errors import suggestion
from atom_core.errors import CalibrationError
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import random_scene
from atom_core.synthetic.faults import FAULTS, cell, exchanged, with_fault
from atom_core.synthetic.mistakes import with_scaled_boards

SIGMAS, RIGHT_M = 3.0, 0.020
FIRST = 2
LABELS = r"lidar_1.*labels and data belong"
POINTS = r"points of lidar_1 are .* look at its points \(unit, axes"

pytestmark = pytest.mark.slow


class Row(NamedTuple):
    """A fault, what names its cause, and what seed 0 gave when this was written."""

    fault: str
    cause: str
    figures: str


SMALLER, LONG = "board pattern_1 is .* smaller", r"lidar_\d reads .* mm long"
HARMLESS = (  # right within the stated sigmas of seed 0: largest of them, and farthest sensor
    Row("none", "", "1.9 sigma, 0.7 mm"),
    Row("no ids, rgb_2 upside down", "", "2.0 sigma, 1.1 mm; renumbered with a warning"),
    Row("print 20 mm off centre, camera and depth", "", "1.9 sigma, 13.4 mm; named"),
    Row("print 20 mm off centre", "", "1.7 sigma, 4.1 mm; named"),
    Row("camera on an arm, none", "", "1.5 sigma, 0.1 mm"),
)
NAMED = (  # inconsistent; sigmas and millimetres off
    Row("every LiDAR reads 30 mm long", LONG, "6.0 sigma, 38 mm"),
    Row("blur, LiDARs noisy and 20 mm long, depth ripples", LONG, "6.3 sigma, 24 mm"),
    Row("board 3 % large, camera and LiDAR", SMALLER, "15 sigma, 66 mm"),
    Row("board 10 % large, two cameras and LiDAR", SMALLER, "62 sigma, 240 mm"),
    Row("board 0.5 % large", SMALLER, "8.6 sigma, 6.3 mm"),
    Row("board 5 % large", SMALLER, "7.5 sigma, 59 mm"),
    Row("lidar_1: labels of others in 40 %", LABELS, "5.2 sigma, 4.4 m"),
    Row("lidar_1: labels of others in 40 %, and mirrored", LABELS, "15 sigma, 3.9 m"),
    Row("lidar_1: mirrored in y", POINTS, "93 sigma, 1.8 m"),
    Row("lidar_1: exchanged in 40 %", LABELS, "2.7 m"),
    Row("depth 1 % too far", "depth_1 reads .* too far", "20 mm"),
    Row("K of two cameras swapped", r"focal length of rgb_\d is given", "332 mm"),
    Row("rgb_1: image centre 20 px off", "image centre of rgb_1", "16 sigma, 9.0 mm"),
    Row("rgb_1: focal length 2 % long", "focal length of rgb_1 is given .* long", "43 mm"),
    Row("rgb_1: focal length 10 % long", "focal length of rgb_1 is given .* long", "219 mm"),
)


TWINS = ("lidar_1: labels of others in 40 %", "board 5 % large")  # of rows that tell more


def marked(row):
    return pytest.param(row, marks=[pytest.mark.long] if row.fault in TWINS else [])


def errors_of(result, scene):
    return stated_errors(calibration_results(result, default_solver()).edges, scene.truth)


def largest_in_sigmas(result, scene):
    return max(error.in_sigmas for error in errors_of(result, scene))


def is_right(result, scene):
    """Tell whether every sensor is where it says that it is."""
    farthest_m = max(error.translation_m for error in errors_of(result, scene))
    return largest_in_sigmas(result, scene) <= SIGMAS and farthest_m <= RIGHT_M


def reasons(result):
    """Return what a user reads first: the message, then checks, misfits, and what was left out."""
    said = [result.message, *(suggestion(check) for check in result.checks)]
    said += [one.why for one in (*result.misfits, *result.exclusions)]
    return list(dict.fromkeys(said))[:FIRST]


def holds(result, scene, cause):
    """Tell whether an answer that is not right says so, and names the cause."""
    if is_right(result, scene):
        return True
    named = any(re.search(cause, reason) for reason in reasons(result))
    return result.status not in ("converged", "not_converged") and named


@pytest.mark.sampled(3)
@pytest.mark.parametrize("row", HARMLESS, ids=lambda row: row.fault)
def test_what_does_no_harm(row):
    scene = FAULTS[row.fault](0)
    result = calibrate(scene.dataset)
    assert is_right(result, scene), result.message


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", [0, 1])
def test_waves_of_a_depth_camera_are_named(seed):
    """3.0 and 4.4 of its sigmas off; before, `converged`, with nothing named."""
    scene = FAULTS["depth in steps, 5 % holes, waves of 10 mm"](seed)
    result = calibrate(scene.dataset)
    assert holds(result, scene, "depths of depth_1 have waves of")
    (check,) = result.checks
    assert check.error.title == "depth waves of depth_1" and 0.002 < check.value < 0.005


@pytest.mark.sampled(5)
@pytest.mark.parametrize("row", [*map(marked, NAMED)], ids=lambda row: row.fault)
def test_what_does_harm_is_named(row):
    scene = FAULTS[row.fault](0)
    result = calibrate(scene.dataset)
    assert not is_right(result, scene)
    assert result.status == "inconsistent"
    assert any(re.search(row.cause, reason) for reason in reasons(result)), reasons(result)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(3))
def test_an_arm_that_is_not_where_it_says_is_named(seed):
    """5 mm and 1 deg off; before, 148 mm off with a sigma of 6 mm, and `converged`."""
    scene = FAULTS["camera on an arm, arm 5 mm and 1 deg off"](seed)
    result = calibrate(scene.dataset)
    assert largest_in_sigmas(result, scene) <= SIGMAS and result.status == "inconsistent"
    assert result.message.startswith("the poses of 'flange' in 'rig_base' do not fit")
    assert all(one.likely[0] == "the poses of links that move" for one in result.misfits)


def test_depths_in_another_unit_are_refused():
    with pytest.raises(CalibrationError, match="labels of sensor 'depth_1' are .* another unit"):
        calibrate(FAULTS["depth ten times too far"](0).dataset)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("board 3 % large, camera and LiDAR", "board pattern_1 is .* smaller than described; "),
        ("K of two cameras swapped", r"the focal length of rgb_2 is given .* too long; "),
    ],
)
def test_what_auto_shares_out_by_what_is_usual_is_named(fault, cause):
    """A size and a range scale are alike: both would be made a little wrong, and `converged`."""
    scene = FAULTS[fault](0)
    result = calibrate(scene.dataset, CalibrationOptions(model_errors=AUTO))
    assert result.status == "inconsistent"
    assert re.match(f"{cause}that is .* times what is usual", result.message)


def test_an_error_that_its_prior_holds_back_is_named_before_it_is_three_times_what_is_usual():
    """A board 1 % large was made 0.5 % smaller, the depths 1 % longer: *good*, and 20 mm off."""
    scene = random_scene(1, collections=16, disturbance=(0.05, 0.05))
    dataset = with_scaled_boards(scene.dataset, 1.01)
    result = calibrate(dataset, CalibrationOptions(model_errors=AUTO))
    assert result.status == "inconsistent"
    assert re.match(f"{SMALLER} than described; that is 2.* times what is usual", result.message)
    free = CalibrationOptions(model_errors=AUTO, board_size=("pattern_1",))
    measured = calibrate(dataset, free)
    assert measured.status == "converged" and is_right(measured, scene)


def test_what_the_data_tell_in_part_is_pulled_in_part():
    assert pull_sigma(1.0, 0.0, 0.0) == 1.0  # it is where the data have it
    assert pull_sigma(1.0, 0.6, 0.6) == pytest.approx(0.8)
    assert pull_sigma(1.0, 0.6, 0.7) == pytest.approx((0.64 + 0.49 - 0.36) ** 0.5)
    assert pull_sigma(1.0, 1.0, 1.0) == 0.1  # the data tell nothing, and what moves it is rounding


@pytest.mark.long
def test_what_auto_finds_by_the_data_is_no_contradiction():
    scene = FAULTS["every LiDAR reads 30 mm long"](0)
    result = calibrate(scene.dataset, CalibrationOptions(model_errors=AUTO))
    assert is_right(result, scene) and result.status == "converged"


@pytest.mark.long
@pytest.mark.parametrize("share", [pytest.param(0.2, marks=pytest.mark.long), 0.3])
def test_some_exchanged_data_are_left_out_and_the_labels_named(share):
    """In a draw where most of the rest agree; of others the next test tells."""
    scene = FAULTS[f"lidar_1: exchanged in {100 * share:.0f} %"](2)
    result = calibrate(scene.dataset)
    assert is_right(result, scene) and result.status == "inconsistent"
    assert re.search(LABELS, result.message)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.2, 0.3, 0.4])
@pytest.mark.parametrize("seed", range(9))
def test_exchanged_data_of_many_draws(seed, share):
    """27 draws; before, 16 of 27 were wrong by 0.2 to 3.1 m, 15 of them `converged`."""
    scene = with_fault(cell, exchanged("lidar_1", share))(seed)
    result = calibrate(scene.dataset)
    assert holds(result, scene, LABELS), (result.status, reasons(result))
