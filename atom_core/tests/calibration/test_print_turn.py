"""A print that is glued on its plate askew: cameras see the print, range sensors the plate."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.problem.board_errors import PrintTurn
from atom_core.synthetic import scenes

TURN_DEG = 1.0


def rig(turn_deg, **sensors):
    """Return a dataset whose boards' prints stand turned on their plates, and nobody knows."""
    dataset = scenes.random_scene(1, disturbance=(0.05, 0.05), **sensors).dataset
    patterns = {}
    for name, pattern in dataset.patterns.items():
        turn = PrintTurn.of_board(name, pattern.border)
        angle = np.full(len(pattern.corners_by_id), -np.radians(turn_deg))
        patterns[name] = replace(pattern, corners_by_id=turn.turned(pattern.corners_by_id, angle))
    return replace(dataset, patterns=patterns)


@pytest.mark.parametrize(
    "sensors",
    [
        {"rgb": 1, "depth": 1, "lidar3d": 0, "collections": 20},
        {"rgb": 2, "depth": 0, "lidar3d": 1, "collections": 20},
    ],
)
def test_it_is_named_with_its_angle(sensors):
    result = calibrate(rig(TURN_DEG, **sensors))
    assert result.status == "inconsistent"
    (found,) = result.checks
    assert isinstance(found.error, PrintTurn)
    assert np.degrees(found.value) == pytest.approx(TURN_DEG, abs=0.1)
    assert "is turned on its plate by" in result.message


def test_auto_estimates_it():
    options = CalibrationOptions(model_errors="auto")
    result = calibrate(rig(TURN_DEG, rgb=1, depth=1, lidar3d=0, collections=20), options)
    assert result.status == "converged"
    (value,) = [v for e, v in result.summary.model_errors.items() if isinstance(e, PrintTurn)]
    assert np.degrees(value) == pytest.approx(TURN_DEG, abs=0.1)


def test_a_straight_print_is_none():
    result = calibrate(rig(0.0, rgb=1, depth=1, lidar3d=0, collections=20))
    assert result.status == "converged" and not result.checks
