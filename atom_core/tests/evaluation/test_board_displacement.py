"""Where the planes of boards have a sensor, against what was planted."""

import numpy as np
import pytest

from atom_core.evaluation.board_displacement import board_displacement
from atom_core.geometry import se3
from atom_core.model.labels import DetectionKey, RangePoints

NONE = np.zeros(0, dtype=int)
TARGET_T_SOURCE = se3.random_move(1.0, 1.0, np.random.default_rng(9))


class Seen:
    """Boards that two sensors see without noise."""

    def __init__(self, count, tilt_rad, seed=0, noise_m=0.0):
        rng = np.random.default_rng(seed)
        self._points, self.keys = {}, []
        for number in range(count):
            flat = np.column_stack([rng.uniform(-0.4, 0.4, (40, 2)), np.zeros(40)])
            turn = se3.rotation_from_rotation_vector(tilt_rad * rng.uniform(-1.0, 1.0, 3))
            board = se3.transform(turn, [0.0, 0.0, 3.0] + rng.uniform(-0.5, 0.5, 3))
            keys = [DetectionKey(str(number), name, "board") for name in ("source", "target")]
            there, here = (flat + noise_m * rng.normal(size=flat.shape) for _ in range(2))
            self._points[keys[1]] = se3.apply(board, here)
            self._points[keys[0]] = se3.apply(se3.inverse(TARGET_T_SOURCE) @ board, there)
            self.keys.append(keys)

    def points(self, key):
        return RangePoints(self._points[key], np.zeros((0, 3)), NONE, NONE, 0)

    def displacement(self, off=None):
        off = np.eye(4) if off is None else off
        return board_displacement(self, [(*keys, off @ TARGET_T_SOURCE) for keys in self.keys])


@pytest.mark.parametrize("seed", range(3))
def test_a_planted_shift_is_found_with_its_size(seed):
    shift_m = 0.05 * np.random.default_rng(seed).normal(size=3)
    found = Seen(12, 0.6, seed, noise_m=0.005).displacement(se3.transform(np.eye(3), shift_m))
    np.testing.assert_allclose(found.shift_m, -shift_m, atol=0.008)
    assert found.told and found.apart_m == pytest.approx(np.linalg.norm(shift_m), abs=0.008)


def test_a_turn_about_the_boards_is_a_turn_and_no_shift():
    middle = np.array([0.0, 0.0, 3.0])
    turn = se3.rotation_from_rotation_vector(np.array([0.0, 0.05, 0.0]))
    found = Seen(12, 0.6).displacement(se3.transform(turn, middle - turn @ middle))
    np.testing.assert_allclose(found.turn_rad, [0.0, -0.05, 0.0], atol=0.002)
    assert found.apart_m < 0.03 and found.turned_rad == pytest.approx(0.05, abs=0.002)


@pytest.mark.parametrize("seed", range(20))
def test_what_chance_makes_is_no_displacement(seed):
    found = Seen(10, 0.6, seed, noise_m=0.01).displacement()
    assert found.apart_m == 0.0 and found.turned_rad == 0.0


@pytest.mark.parametrize("count, tilt_rad", [(1, 0.6), (2, 0.6), (10, 0.0)])
def test_boards_that_leave_a_direction_open_do_not_tell(count, tilt_rad):
    assert not Seen(count, tilt_rad, noise_m=0.005).displacement().told


def test_one_wrong_label_does_not_carry_the_others_away():
    seen = Seen(12, 0.6, noise_m=0.002)
    wrong = seen.keys[3][1]
    seen._points[wrong] = seen._points[wrong] + [0.0, 0.0, 0.5]
    found = seen.displacement()
    assert np.linalg.norm(found.shift_m) < 0.02
