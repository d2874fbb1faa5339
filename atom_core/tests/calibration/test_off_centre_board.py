"""A board whose print is not in its middle: both solvers take the plate where it is."""

from dataclasses import replace

import numpy as np
import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.judge.statistics import residual_table
from atom_core.calibration.options import CalibrationOptions
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import pose
from atom_core.model.truth import with_truth
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import SOLVERS
from atom_core.synthetic import Noise, scenes


@pytest.fixture(scope="module")
def scene():
    return scenes.off_centre_board(
        1,
        collections=6,
        noise=Noise.none(),
        disturbance=(0.03, 0.03),
        sampling=scenes.Sampling(exact_border=True),
    )


def largest_error_m(dataset, scene):
    """Return how far sensors are off in the first one's frame [m]."""
    frames = [sensor.frame for sensor in dataset.sensors.values()]
    errors = []
    for frame in frames[1:]:
        found, true = (
            pose(next(iter(d.collections.values())), d.graph, frames[0], frame)
            for d in (dataset, with_truth(scene.dataset, scene.truth))
        )
        errors.append(np.linalg.norm((se3.inverse(true) @ found)[:3, 3]))
    return max(errors)


def solved(dataset, name):
    options = CalibrationOptions(solver=SolverOptions(loss="none"), solver_name=name)
    return calibrate(dataset, options)


@pytest.mark.parametrize("name", list(SOLVERS))
def test_exact_labels_of_an_off_centre_board_give_the_exact_answer(scene, name):
    result = solved(scene.dataset, name)
    assert result.status == "converged"
    assert largest_error_m(result.dataset, scene) < 1e-6
    assert max(border_rms_m(result)) < 1e-6


def border_rms_m(result):
    """Return how far limit points are from the border, by sensor [m]."""
    table = residual_table(result.problem, result.summary.x)
    rows = {key: value.rms for key, value in table.items() if key[1] == "border" and not key[2]}
    assert rows
    return list(rows.values())


def test_the_same_board_taken_as_centred_leaves_centimetres_at_the_border(scene):
    pattern = scene.dataset.patterns["pattern_1"]
    corners = pattern.corners_by_id
    middle, half = (corners.min(axis=0) + corners.max(axis=0)) / 2.0, pattern.border.half_size
    centred = replace(pattern, border=Rectangle(*(middle - half), *(middle + half)))
    dataset = replace(scene.dataset, patterns={"pattern_1": centred})
    assert min(border_rms_m(solved(dataset, None))) > 0.01
