"""Covariance of the estimated poses, and the directions that the data leave open."""

from __future__ import annotations

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.solvers.normal_equations import NormalEquations

_SMALLEST = 1e-13  # relative eigenvalue below which a direction counts as not seen at all


class Covariance:
    """Inverse of the normal equations, in blocks; never formed as a whole.

    A block's six numbers are rotation [rad] (rotation vector relative to its initial value) and
    translation [m].
    """

    def __init__(self, equations: NormalEquations, scale: float = 1.0):
        """Invert; directions that the data do not see get a huge, finite variance.

        Args:
            equations: undamped, weighted by the inverse variances.
            scale: factor on all variances (the variance of unit weight).
        """
        self._layout = equations.layout
        self._local_inverse = _pseudo_inverse(equations.local)
        self._coupling = self._local_inverse @ equations.cross
        size = equations.shared.shape[0]
        reduced = equations.shared - np.tensordot(
            equations.cross, self._coupling, axes=((0, 1), (0, 1))
        )
        self._scale = scale
        self._shared = _pseudo_inverse(reduced[None])[0] if size else reduced

    @property
    def shared(self) -> np.ndarray:
        """(6 s, 6 s) covariance of all shared blocks."""
        return self._scale * self._shared

    def block(self, index: int) -> np.ndarray:
        """Return the covariance (6, 6) of one parameter block."""
        return self.pairs(np.array([index]), np.array([index]))[0]

    def pairs(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the covariances (n, 6, 6) of block pairs that meet in one collection."""
        layout = self._layout
        result = np.empty((len(rows), 6, 6))
        for i, (row, column) in enumerate(zip(rows, columns)):
            right = self._gain(row) @ self._shared @ self._gain(column).T
            group = layout.group[row]
            if group >= 0 and group == layout.group[column]:
                r, c = 6 * layout.position[row], 6 * layout.position[column]
                right = right + self._local_inverse[group, r : r + 6, c : c + 6]
            result[i] = right
        return self._scale * result

    def _gain(self, index: int) -> np.ndarray:
        """Return (6, 6 s): how a block follows the shared parameters."""
        group, at = self._layout.group[index], 6 * self._layout.position[index]
        if group >= 0:
            return -self._coupling[group, at : at + 6]
        gain = np.zeros((6, len(self._shared)))
        gain[:, at : at + 6] = np.eye(6)
        return gain

    def explained(self, problem: Problem, equations: NormalEquations) -> np.ndarray:
        """Return, for each residual block, how many of its rows the parameters explain.

        The trace of the hat matrix over the block's rows: rows minus this are its redundancy
        (Foerstner 1979, variance components).
        """
        maps = equations.maps
        index = problem.chains.block
        twist_covariance = np.zeros((len(index), 6, 6))
        for k in range(index.shape[1]):
            for m in range(index.shape[1]):
                both = np.flatnonzero((index[:, k] >= 0) & (index[:, m] >= 0))
                pair = self.pairs(index[both, k], index[both, m]) / self._scale
                twist_covariance[both] += maps[both, k] @ pair @ np.swapaxes(maps[both, m], 1, 2)
        return np.array(
            [
                float(np.einsum("dij,dji->", part, twist_covariance))
                for part in equations.detection_information
            ]
        )


def _pseudo_inverse(matrices: np.ndarray) -> np.ndarray:
    """Invert symmetric matrices (n, k, k); eigenvalues are floored, never dropped."""
    if matrices.size == 0:
        return matrices.copy()
    diagonal = np.maximum(np.diagonal(matrices, axis1=1, axis2=2), 1e-12)
    scale = 1.0 / np.sqrt(diagonal)
    scaled = matrices * scale[:, :, None] * scale[:, None, :]
    values, vectors = np.linalg.eigh((scaled + np.swapaxes(scaled, 1, 2)) / 2.0)
    values = np.maximum(values, _SMALLEST * values[:, -1:])
    inverse = (vectors / values[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return inverse * scale[:, :, None] * scale[:, None, :]
