"""What is known of a board that a range sensor should see, and how it differs from what it sees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atom_core.geometry import se3
from atom_core.labeling.stillness import SurfaceSighting

NORMAL_RAD, OFF_PLANE_M = 0.03, 0.03  # one sigma of a label
_GATE_SIGMAS, _NARROW_GATE_SIGMAS = 4.0, 2.5
_EXACT = 0.5  # of half the board's diagonal: a prediction that tells the board from others


class Guess(NamedTuple):
    """Where the board should be in a sensor's frame.

    Attributes:
        middle: (3,) of the board [m].
        normal: (3,) of the board, either way.
        half_diagonal_m: of the board.
        drift_m: how far the board may have moved since a camera saw it.
        covariance: (6, 6) of a small rotation about the sensor's axes [rad] and a shift [m].
    """

    middle: np.ndarray
    normal: np.ndarray
    half_diagonal_m: float
    drift_m: float
    covariance: np.ndarray

    def moved(self, moved_T_guessed: np.ndarray) -> Guess:
        """Return the guess after a motion (4, 4) of the sensor's frame."""
        middle = se3.apply(moved_T_guessed, self.middle[None])[0]
        return self._replace(middle=middle, normal=moved_T_guessed[:3, :3] @ self.normal)

    @property
    def sigma_m(self) -> float:
        """Return how exact the middle is: root of the mean variance."""
        jacobian = np.hstack([-se3.skew(self.middle), np.eye(3)])
        variance = np.trace(jacobian @ self.covariance @ jacobian.T) / 3.0
        return float(np.sqrt(variance + self.drift_m**2))

    def vouches(self, found: SurfaceSighting) -> bool:
        """Tell whether what was found is the board though nothing else says so.

        It is where the board must be, and that is known to a part of the board's size.
        """
        exact = self.sigma_m <= _EXACT * self.half_diagonal_m
        return exact and self.agrees(found, _NARROW_GATE_SIGMAS)

    def agrees(self, found: SurfaceSighting, gate_sigmas: float = _GATE_SIGMAS) -> bool:
        """Tell whether what was found may be the board."""
        off = misfit(self.middle, self.normal, found)
        variance = np.einsum("ij,jk,ik->i", off.jacobian, self.covariance, off.jacobian)
        turned = self.drift_m / self.half_diagonal_m
        variance += off.by_kind(turned, self.drift_m, self.drift_m) ** 2
        variance += off.by_kind(NORMAL_RAD, OFF_PLANE_M, OFF_PLANE_M) ** 2
        limit = gate_sigmas * np.sqrt(variance)
        limit += off.by_kind(0.0, 0.0, self.half_diagonal_m)  # the labeled part may be any
        return bool(np.all(np.abs(off.numbers) <= limit))


class Misfit(NamedTuple):
    """How a predicted board differs from what was found.

    Attributes:
        numbers: (n,) the normal's direction [rad], off the surface [m], beside, two numbers [m].
        jacobian: (n, 6) by a rotation of the prediction about the sensor's axes and by a shift.
        directions: how many of the numbers are directions: two by a plane, one by a line.
    """

    numbers: np.ndarray
    jacobian: np.ndarray
    directions: int

    def by_kind(self, direction: float, off: float, beside: float) -> np.ndarray:
        """Return (n,) with a figure for each kind of number."""
        return np.array((*(direction,) * self.directions, off, beside, beside))


def misfit(middle: np.ndarray, normal: np.ndarray, found: SurfaceSighting) -> Misfit:
    """Compare a predicted board, its middle (3,) [m] and its normal (3,), with what was found."""
    axes, known = found.board_axes(normal), found.known_axes
    beside, off = axes[:, :2].T, axes[:, 2]
    normal = normal if normal @ off >= 0 else -normal
    away = middle - found.centre
    numbers = np.concatenate([beside[:known] @ normal, [off @ away], beside @ away])
    jacobian, across_normal = np.zeros((known + 3, 6)), se3.skew(normal)
    jacobian[:known, :3] = -beside[:known] @ across_normal
    moved = np.vstack([off, beside])
    jacobian[known:, :3] = -moved @ se3.skew(middle)
    jacobian[known:, 3:] = moved
    # The nearest normal turns with the prediction about the axes that are known.
    if known < len(beside):
        free = beside[known:]
        jacobian[known, :3] -= (free @ away) @ free @ across_normal
    return Misfit(numbers, jacobian, known)
