"""A board that is twisted: two opposite corners lie above its middle, the others below."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.problem.board_errors import BoardTwist
from atom_core.synthetic import Noise, Planted, make_dataset, random_rig
from atom_core.synthetic.board import BentPattern, charuco, held_before
from atom_core.synthetic.dataset import disturbed
from atom_core.synthetic.planted import BoardErrors

TWIST_M = 0.004
SENSORS = ({"rgb": 2, "depth": 0, "lidar3d": 0}, {"rgb": 1, "depth": 1, "lidar3d": 1})


class Twisted(BentPattern):
    """Its sagitta is that of its corners."""

    def height_m(self, in_plane):
        scaled = (in_plane - self.border.centre) / self.border.half_size
        return self.sagitta_m * np.prod(scaled, axis=1)


@dataclass(frozen=True)
class TwistedBoard(BoardErrors):
    twist_m: float = 0.0

    def true_pattern(self, name, config):
        return Twisted(**vars(super().true_pattern(name, config)), sagitta_m=self.twist_m)


def rig(twist_m, *, rgb, depth, lidar3d, seed=3):
    """Return a dataset of sensors before a board that is twisted, and nobody knows."""
    rng, board = np.random.default_rng(seed), TwistedBoard(twist_m=twist_m)
    sensors, border = random_rig(rng, rgb, depth, lidar3d), board.true_pattern("", charuco()).border
    eye = np.array(sensors.centre) + [0.0, 2.2, 0.5]
    places = sensors.centre + rng.uniform(-0.35, 0.35, (16, 3))
    poses = {"pattern_1": [held_before(eye, place, border, rng) for place in places]}
    planted = Planted(boards={"pattern_1": board})
    made = make_dataset(sensors, poses, Noise(), rng, planted=planted)
    return disturbed(made, (0.05, 0.05), rng).dataset


@pytest.mark.parametrize("sensors", SENSORS)
def test_it_is_named_with_its_size(sensors):
    (found,) = calibrate(rig(TWIST_M, **sensors)).checks
    assert isinstance(found.error, BoardTwist)
    assert found.value == pytest.approx(TWIST_M, rel=0.25)


def test_the_sentence_says_what_is_wrong_and_what_estimates_it():
    result = calibrate(rig(0.01, **SENSORS[0]), CalibrationOptions(intrinsics=("rgb_1", "rgb_2")))
    assert result.status == "inconsistent"
    assert "board pattern_1 is twisted: its corners lie" in result.message
    assert "--model_errors auto" in result.message


@pytest.mark.parametrize("sensors", SENSORS)
def test_auto_estimates_it(sensors):
    result = calibrate(rig(TWIST_M, **sensors), CalibrationOptions(model_errors="auto"))
    assert result.status == "converged"
    (value,) = [v for e, v in result.summary.model_errors.items() if isinstance(e, BoardTwist)]
    assert value == pytest.approx(TWIST_M, rel=0.1)


def test_a_flat_board_is_none():
    result = calibrate(rig(0.0, **SENSORS[1]))
    assert result.status == "converged" and not result.checks


def test_its_height_is_its_own_at_the_corners_and_none_along_the_axes():
    border = replace(charuco(), border_size=(0.04, 0.03))
    border = BoardErrors().true_pattern("", border).border
    twist, (x, y), half = BoardTwist.of_board("", border), border.centre, border.half_size
    corners = border.centre + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    np.testing.assert_allclose(twist.height(corners), [1.0, -1.0, 1.0, -1.0])
    np.testing.assert_allclose(twist.height(np.array([[x, y + 0.1], [x - 0.2, y]])), 0.0)
