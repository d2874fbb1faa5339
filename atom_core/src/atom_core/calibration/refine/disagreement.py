"""How much each detection disagrees with all others: the test for whole bad detections.

A detection's rows depend on the parameters through the twist of its pose only. If the detection
were allowed a pose of its own, its six numbers would move by what its gradient asks for; under
random errors alone that gradient has the covariance ``H - H C H``, with H the detection's
information and C the covariance of its twist in the joint solution. The square of one in units of
the other is a chi-square variable of up to six degrees of freedom (Baarda 1968, "A testing
procedure for use in geodetic networks", for a block of unknowns).
"""

from __future__ import annotations

from typing import NamedTuple, Sequence, Tuple

import numpy as np
from scipy.special import chdtri  # scipy.stats has it as chi2.isf, and takes long to load

from atom_core.geometry import se3
from atom_core.problem.camera_blocks import TWIST_SIZE
from atom_core.problem.problem import Problem
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.normal_equations import NormalEquations, summed

CHANCE = 1e-7  # that random errors alone make one detection suspicious
# A detection's points share errors (of the label, the board, the intrinsics): so far off is nobody.
OWN_M, OWN_RAD = 1e-3, 1.7e-3
FAR_SQUARE, MOST = 100.0, 0.5  # most of a detection beyond ten sigmas: it is no detection
_SEEN, _REDUNDANT = 1e-6, 0.03  # shares below which a direction tells nothing
_ENOUGH = 5  # detections, to know the scatter of one sensor's


class Disagreement(NamedTuple):
    """Of all detections of a problem.

    Attributes:
        excess: (d,) chi-square over what ``CHANCE`` allows; beyond 1 is suspicious.
        scatter: (d,) factor on the chi-squares of the detection's sensor, 1 or more: real
            sensors have errors that all points of a detection share.
        mostly_outliers: (d,) more than half of its corners and points are, grossly.
    """

    excess: np.ndarray
    scatter: np.ndarray
    mostly_outliers: np.ndarray

    @property
    def suspicious(self) -> np.ndarray:
        """(d,) what random errors do not explain."""
        return (self.excess > 1.0) | self.mostly_outliers


def disagreement(
    problem: Problem,
    x: np.ndarray,
    equations: NormalEquations,
    squares: Sequence[np.ndarray],
) -> Disagreement:
    """Test all detections.

    Args:
        problem: whose detections.
        x: the solution.
        equations: there.
        squares: for each residual block, squared norms (n,) in units of sigma.
    """
    own = _own_errors(problem.poses(x), OWN_M, OWN_RAD)
    chi_square, freedom = chi_squares(problem, equations, own)
    sensors = np.array([key.sensor for key in problem.detections])
    relative = chi_square / chdtri(np.maximum(freedom, 1), 0.5)
    scatter = np.full(len(sensors), np.median(relative[freedom > 0]) if freedom.any() else 1.0)
    for sensor in np.unique(sensors):
        mine = (sensors == sensor) & (freedom > 0)
        if np.sum(mine) >= _ENOUGH:
            scatter[sensors == sensor] = np.median(relative[mine])
    scatter = np.maximum(scatter, 1.0)
    limit = scatter * chdtri(np.maximum(freedom, 1), CHANCE)
    return Disagreement(chi_square / limit, scatter, _mostly_outliers(problem, squares))


def _own_errors(sensor_T_pattern: np.ndarray, own_m: float, own_rad: float) -> np.ndarray:
    """Return (d, 6, 6): twist covariance of a board that is off by itself, by so much."""
    about_board = np.tile(np.eye(6), (len(sensor_T_pattern), 1, 1))
    about_board[:, 3:, :3] = se3.skew(sensor_T_pattern[:, :3, 3])
    variance = np.array([own_rad] * 3 + [own_m] * 3) ** 2
    return (about_board * variance) @ np.swapaxes(about_board, 1, 2)


def chi_squares(
    problem: Problem, equations: NormalEquations, own: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return chi-squares (d,) and their degrees of freedom (d,).

    Args:
        problem: whose detections.
        equations: at the solution, weighted by the inverse variances.
        own: (d, 6, 6) covariance of the twists that detections may have by themselves.
    """
    count, columns = len(problem.detections), equations.state_jacobians.shape[2]
    all_information, gradient = summed(equations.parts, count, columns)
    # The move is one of the pose; what the intrinsics do to it is in the covariance.
    by_all = all_information[:, :TWIST_SIZE]
    information, gradient = by_all[:, :, :TWIST_SIZE], gradient[:, :TWIST_SIZE]
    covariance = Covariance(equations).states(problem.dependencies, equations.state_jacobians)
    diagonal = np.maximum(np.diagonal(information, axis1=1, axis2=2), 1e-12)
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(information * scale[:, :, None] * scale[:, None, :])
    seen = values > _SEEN * values[:, -1:]
    inverse_root = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
    whitening = inverse_root[:, :, None] * np.swapaxes(vectors, 1, 2) * scale[:, None, :]
    reached = whitening @ information
    redundancy = reached @ np.swapaxes(whitening, 1, 2)
    by_all = whitening @ by_all
    redundancy -= by_all @ covariance @ np.swapaxes(by_all, 1, 2)
    shares, axes = np.linalg.eigh((redundancy + np.swapaxes(redundancy, 1, 2)) / 2.0)
    white = np.einsum("dij,dj->di", whitening, gradient)
    tells = shares > _REDUNDANT
    along = np.where(tells, np.einsum("dji,dj->di", axes, white), 0.0)
    reached = np.swapaxes(axes, 1, 2) @ reached * tells[:, :, None]
    variance = reached @ own @ np.swapaxes(reached, 1, 2)
    variance += np.where(tells, shares, 1.0)[:, :, None] * np.eye(6)
    chi_square = np.einsum("di,di->d", along, np.linalg.solve(variance, along[..., None])[..., 0])
    return chi_square, np.sum(tells, axis=1)


def _mostly_outliers(problem: Problem, squares: Sequence[np.ndarray]) -> np.ndarray:
    count = len(problem.detections)
    items, outliers = np.zeros(count), np.zeros(count)
    for block, square in zip(problem.residual_blocks, squares):
        items += np.bincount(block.detection, minlength=count)
        beyond = block.detection[square > FAR_SQUARE]
        outliers += np.bincount(beyond, minlength=count)
    return outliers > MOST * np.maximum(items, 1)
