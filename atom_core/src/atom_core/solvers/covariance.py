"""Covariance of the estimated poses, and the directions that the data leave open."""

from __future__ import annotations

import copy
from typing import Dict, Mapping, Optional

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.problem.problem import Problem
from atom_core.solvers.normal_equations import NormalEquations
from atom_core.solvers.scalars import JointScalars

# Results have this of what is not seen at all: JSON has no infinity.
LARGEST_SIGMA = 1e6
LARGEST_VARIANCE = LARGEST_SIGMA**2
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
        inverse = _pseudo_inverse(equations.local, np.diagonal(equations.local, axis1=1, axis2=2))
        coupling = inverse @ equations.cross
        size = equations.shared.shape[0]
        reduced = equations.shared - np.tensordot(equations.cross, coupling, axes=((0, 1), (0, 1)))
        self._scale = scale
        self.error_sigmas: Dict[ModelError, float] = {}  # in their units, of those estimated
        self.of_model: Covariance = self  # as the assumed noise has it
        self.freedom = np.inf  # degrees of freedom of Student's t by which it was made wider
        self._combined: Optional[Covariance] = None
        # What elimination leaves of an unseen direction is rounding: measure it against before.
        diagonal = np.diagonal(equations.shared)[None]
        self._shared = _pseudo_inverse(reduced[None], diagonal)[0] if size else reduced
        self._shared[self._layout.idle] = 0.0  # they do not vary
        self._shared[:, self._layout.idle] = 0.0
        self._cross = -coupling @ self._shared
        self._local = inverse - self._cross @ np.swapaxes(coupling, 1, 2)

    def bordered(self, joint: JointScalars) -> Covariance:
        """Return the covariance when scalars are estimated beside the poses."""
        result = copy.copy(self)
        variance, layout = joint.covariance(), self._layout
        parts = [layout.split(gain) for gain in joint.gains]
        shared = np.array([part[0] for part in parts]).T  # (6 s, k)
        local = np.stack([part[1] for part in parts], axis=-1)  # (g, 6 w, k)
        result._shared = self._shared + shared @ variance @ shared.T
        result._cross = self._cross + local @ (variance @ shared.T)
        result._local = self._local + (local @ variance) @ np.swapaxes(local, 1, 2)
        sigmas = np.sqrt(np.diagonal(variance) * self._scale)
        result.error_sigmas = {
            error: float(error.step * sigma)
            for error, sigma in zip(joint.errors, sigmas)
            if error is not None
        }
        return result

    def robust(
        self, factors: np.ndarray, by_error: Mapping[ModelError, float], freedom: float = np.inf
    ) -> Covariance:
        """Return the covariance with larger standard deviations, and this one as its model's.

        Args:
            factors: (6 s,) on those of the shared blocks' numbers.
            by_error: on those of the model errors.
            freedom: degrees of freedom of Student's t in the factors; infinite: there is none.
        """
        result = copy.copy(self)
        result.of_model, result.freedom = self, freedom
        result._shared = self._shared * factors[:, None] * factors
        result._cross = self._cross * factors
        result.error_sigmas = {e: by_error.get(e, 1.0) * s for e, s in self.error_sigmas.items()}
        return result

    def with_combined(
        self, systematic: np.ndarray, followers: Optional[np.ndarray] = None
    ) -> Covariance:
        """Return the covariance, and as its `combined` one what is the same in all collections too.

        Args:
            systematic: (6 s, 6 s) covariance of that, of the shared blocks' numbers.
            followers: (k, p) by how much all numbers follow k independent ones of unit variance,
                which make it; None: what is of one collection follows nothing.
        """
        result, combined = copy.copy(self), copy.copy(self)
        idle = self._layout.idle
        systematic = systematic.copy()
        systematic[idle], systematic[:, idle] = 0.0, 0.0  # they do not vary
        combined._shared = self._shared + systematic / self._scale
        if followers is not None and len(followers):
            parts = [self._layout.split(numbers) for numbers in followers]
            shared = np.array([part[0] for part in parts]).T  # (6 s, k)
            local = np.stack([part[1] for part in parts], axis=-1)  # (g, 6 w, k)
            shared[idle] = 0.0
            combined._cross = self._cross + local @ shared.T / self._scale
            combined._local = self._local + local @ np.swapaxes(local, 1, 2) / self._scale
        result._combined = combined
        return result

    @property
    def has_combined(self) -> bool:
        """Whether it is known what is the same in all collections."""
        return self._combined is not None

    @property
    def combined(self) -> Covariance:
        """The covariance with what is the same in all collections, where that is known."""
        return self._combined or self

    @property
    def shared(self) -> np.ndarray:
        """(6 s, 6 s) covariance of all shared blocks."""
        return self._scale * self._shared

    def block(self, index: int) -> np.ndarray:
        """Return the covariance (6, 6) of one parameter block."""
        return self.pairs(np.array([index]), np.array([index]))[0]

    def pairs(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the covariances (n, 6, 6) of block pairs.

        Args:
            rows: (n,) indices of parameter blocks.
            columns: (n,) indices of the other ones. Two blocks of collections must belong to the
                same one: others are not computed.
        """
        layout = self._layout
        group, other = layout.group[rows], layout.group[columns]
        if np.any((group >= 0) & (other >= 0) & (group != other)):
            raise ValueError("the two blocks of a pair belong to different collections")
        r, c = layout.position[rows], layout.position[columns]
        result = np.empty((len(rows), BLOCK_SIZE, BLOCK_SIZE))
        both = (group < 0) & (other < 0)
        result[both] = _tiles(self._shared[None])[0, r[both], c[both]]
        mixed, turned = (group >= 0) & (other < 0), (group < 0) & (other >= 0)
        cross = _tiles(self._cross)
        result[mixed] = cross[group[mixed], r[mixed], c[mixed]]
        result[turned] = np.swapaxes(cross[other[turned], c[turned], r[turned]], 1, 2)
        own = (group >= 0) & (other >= 0)
        result[own] = _tiles(self._local)[group[own], r[own], c[own]]
        return self._scale * result

    def states(self, index: np.ndarray, jacobians: np.ndarray) -> np.ndarray:
        """Return the covariances (n, c, c) of what depends on some blocks each.

        Args:
            index: (n, k) blocks of each, -1 where there are fewer.
            jacobians: (n, k, c, 6) by the numbers of the blocks: of twists (c = 6), or of the
                states of detections.
        """
        result = np.zeros((len(index), jacobians.shape[2], jacobians.shape[2]))
        for k in range(index.shape[1]):
            for m in range(k + 1):
                both = np.flatnonzero((index[:, k] >= 0) & (index[:, m] >= 0))
                pair = self.pairs(index[both, k], index[both, m])
                right = np.swapaxes(jacobians[both, m], 1, 2)
                part = jacobians[both, k] @ pair @ right
                result[both] += part if m == k else part + np.swapaxes(part, 1, 2)
        return result

    def explained(self, problem: Problem, equations: NormalEquations) -> np.ndarray:
        """Return, for each residual block, how many of its rows the parameters explain.

        The trace of the hat matrix over the block's rows: rows minus this are its redundancy
        (Foerstner 1979, variance components).
        """
        covariance = self.states(problem.dependencies, equations.state_jacobians) / self._scale
        explained = []
        for part in equations.parts:
            own = part.gradient.shape[1]
            mine = covariance[part.detection][:, :own, :own]
            explained.append(float(np.einsum("dij,dji->", part.information, mine)))
        return np.array(explained)


def _tiles(matrices: np.ndarray) -> np.ndarray:
    """View matrices (g, 6 r, 6 c) as blocks (g, r, c, 6, 6)."""
    groups, rows, columns = matrices.shape
    n = BLOCK_SIZE
    return matrices.reshape(groups, rows // n, n, columns // n, n).swapaxes(2, 3)


def _pseudo_inverse(matrices: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
    """Invert symmetric matrices (n, k, k); eigenvalues are floored, never dropped.

    Args:
        matrices: positive semidefinite up to rounding.
        diagonal: (n, k) the sizes against which an eigenvalue is small.
    """
    if matrices.size == 0:
        return matrices.copy()
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-12))
    scaled = matrices * scale[:, :, None] * scale[:, None, :]
    values, vectors = np.linalg.eigh((scaled + np.swapaxes(scaled, 1, 2)) / 2.0)
    values = np.maximum(values, _SMALLEST * np.maximum(values[:, -1:], 1.0))
    inverse = (vectors / values[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return inverse * scale[:, :, None] * scale[:, None, :]
