"""Calibration problems of synthetic scenes, a little away from their solution."""

import numpy as np

from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.calibration.start.boards import initial_boards
from atom_core.calibration.start.disturb import disturbed
from atom_core.problem.builder import build_problem
from atom_core.problem.measurements import read_measurements


def problem_of(scene, seed=0, disturbance=(0.05, 0.05), **options):
    dataset = scene(seed, collections=6, **options).dataset
    free = free_edges(dataset, CalibrationOptions())
    dataset = disturbed(dataset, free, *disturbance, np.random.default_rng(seed))
    measurements, _ = read_measurements(dataset)
    boards = initial_boards(dataset, measurements, free)
    return build_problem(dataset, measurements, boards, free)


def rows(problem, x, sigmas):
    return np.concatenate([(r / s[:, None]).ravel() for r, s in zip(problem.residuals(x), sigmas)])
