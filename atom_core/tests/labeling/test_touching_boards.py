"""Boards at walls, on easels, with black squares that read longer, and before uneven layers."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from hard_labels import judged, measured, world_T_sensor
from hard_scenes import hard_frame
from touching_boards import (
    UNEVEN,
    against,
    another_leaning,
    leaning,
    on_an_easel,
    with_longer_black,
)

from atom_core import native
from atom_core.geometry import se3

pytestmark = pytest.mark.skipif(not native.available(), reason="the compiled core is not built")

LAYERS = ("16 layers", "64 layers")
RANGE_KINDS = (*LAYERS, "rosette", "tof", "depth")
MOST_TILT_DEG, MOST_OFF_M = 0.5, 0.002


def plane_off(frame, seen, indices):
    """Return how far the plane through labeled points is turned [deg] and off [m]."""
    board_T_sensor = se3.inverse(frame.scene.world_T_board) @ world_T_sensor(frame)
    x, y, z = se3.apply(board_T_sensor, seen.points[indices]).T
    design = np.column_stack([x - x.mean(), y - y.mean(), np.ones(len(x))])
    slope_x, slope_y, off = np.linalg.lstsq(design, z, rcond=None)[0]
    return np.degrees(np.hypot(slope_x, slope_y)), abs(off)


@pytest.mark.parametrize("kind", LAYERS)
def test_a_board_that_leans_at_a_wall_is_labeled_on_its_own_plane(kind):
    found = 0
    for number in range(6):
        frame = leaning(number, kind)
        seen = measured(frame)
        at_seed, by_search = judged(frame, seen)
        assert not at_seed.false and not by_search.false
        if not at_seed.found:
            continue
        found += 1
        tilt_deg, off_m = plane_off(frame, seen, at_seed.labeled.label.indices)
        assert tilt_deg < MOST_TILT_DEG and off_m < MOST_OFF_M
    assert found >= 3


@pytest.mark.parametrize("kind", [*LAYERS, UNEVEN])
@pytest.mark.parametrize("number", [3, 8, 29, 58])
def test_a_board_of_another_size_that_leans_at_a_wall_is_not_labeled(kind, number):
    frame = another_leaning(number, kind)
    assert not any(label.false for label in judged(frame, measured(frame)))


@pytest.mark.parametrize("kind", RANGE_KINDS)
def test_a_board_at_a_wall_is_refused_with_what_helps(kind):
    frame = against(1, kind, 0.0)
    at_seed, _ = judged(frame, measured(frame))
    assert not at_seed.labeled.detected
    assert "hold it farther away" in at_seed.labeled.reason


def test_a_board_on_an_easel_is_found_by_uneven_layers():
    for number in (0, 4, 12):
        frame = on_an_easel(number, UNEVEN)
        at_seed, by_search = judged(frame, measured(frame))
        assert at_seed.found, at_seed.labeled.reason
        assert by_search.found, by_search.labeled.reason


@pytest.mark.parametrize(
    "difficulty, numbers",
    [
        ("only another board", (2, 4, 22, 42)),  # 9 to 14 % larger; the sparse layers show it
        ("another one, cut", (9, 16, 17, 24, 40, 41, 45, 57)),  # up to 45 % larger
    ],
)
def test_a_board_of_another_size_before_uneven_layers_is_not_labeled(difficulty, numbers):
    for number in numbers:
        frame = hard_frame(difficulty, UNEVEN, number)
        assert not any(label.false for label in judged(frame, measured(frame))), number


def test_a_board_that_ends_between_layers_far_apart_is_refused_with_what_helps():
    frame = hard_frame("another one, cut", UNEVEN, 16)
    at_seed, _ = judged(frame, measured(frame))
    assert not at_seed.labeled.detected
    assert "layers are 60 cm apart where it ends" in at_seed.labeled.reason
    assert "let a camera see it" in at_seed.labeled.reason


@pytest.mark.parametrize("kind", LAYERS)
@pytest.mark.parametrize("longer_m", [0.05, 0.08])
def test_black_squares_behind_the_white_ones_are_named(kind, longer_m):
    frame, seen = with_longer_black(3, kind, longer_m)
    at_seed, _ = judged(frame, seen)
    assert not at_seed.labeled.detected
    assert "returns from the black squares lie" in at_seed.labeled.reason
    behind_mm = float(at_seed.labeled.reason.split(" lie ")[1].split(" mm")[0])
    assert behind_mm == pytest.approx(1000.0 * longer_m, abs=6.0)
