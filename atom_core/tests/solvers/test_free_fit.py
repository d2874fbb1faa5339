"""Every detection fitted by itself: what is left is only what is wrong within one."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from problems import problem_of  # noqa: E402

from atom_core.solvers import losses  # noqa: E402
from atom_core.solvers.free_fit import distances, distances_alone, median, medians  # noqa: E402
from atom_core.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from atom_core.synthetic import Noise, scenes  # noqa: E402


@pytest.mark.parametrize("count", [1, 2, 3, 4, 9, 10])
def test_the_median_is_that_of_numpy(count):
    values = np.random.default_rng(count).standard_normal(count)
    before = values.copy()
    assert median(values) == pytest.approx(np.median(values))
    np.testing.assert_array_equal(values, before)


@pytest.fixture(scope="module")
def problem():
    exact = {"noise": Noise.none(), "rgb": 3, "depth": 0, "lidar3d": 0}
    return problem_of(scenes.random_scene, disturbance=(0.1, 0.1), **exact)


def test_medians_are_those_of_each_detection(problem):
    for block in problem.residual_blocks:
        values = np.random.default_rng(0).standard_normal(block.count)
        detections, found = medians(block, values)
        np.testing.assert_array_equal(detections, np.unique(block.detection))
        expected = [np.median(values[block.detection == d]) for d in detections]
        np.testing.assert_allclose(found, expected)


def test_distances_are_lengths_of_residuals_whatever_the_sigmas(problem):
    x = np.full(problem.parameters.size, 0.01)
    expected = [np.linalg.norm(r, axis=1) for r in problem.residuals(x)]
    for factor in (1.0, 5.0):
        sigmas = [factor * s * np.linspace(1.0, 2.0, len(s)) for s in problem.initial_sigmas]
        found = distances(LevenbergMarquardt(problem), x, sigmas)
        for mine, length in zip(found, expected):
            np.testing.assert_allclose(mine, length)


def alone(problem):
    x = np.zeros(problem.parameters.size)
    return distances_alone(problem, x, problem.initial_sigmas, losses.NONE, LevenbergMarquardt)


def test_exact_detections_fit_alone_however_the_sensors_stand(problem):
    together = problem.residuals(np.zeros(problem.parameters.size))
    assert max(np.max(np.abs(r)) for r in together) > 10.0
    for found in alone(problem):
        np.testing.assert_allclose(found, 0.0, atol=0.02)


def test_one_detection_does_not_disturb_the_others(problem):
    """More than ten of them: each keeps its own pose whatever the order of its name."""
    block = problem.residual_blocks[0]
    assert len(problem.detections) > 10
    wrong, pixels = block.detection == block.detection[0], block.pixels.copy()
    pixels[wrong] += 20.0 * np.random.default_rng(1).standard_normal((np.sum(wrong), 2))
    changed = replace(block, pixels=pixels)
    first, *others = alone(
        replace(problem, residual_blocks=(changed, *problem.residual_blocks[1:]))
    )
    assert np.median(first[wrong]) > 5.0
    for found in (first[~wrong], *others):
        np.testing.assert_allclose(found, 0.0, atol=0.5)
