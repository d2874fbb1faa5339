"""What errors that sensors and boards usually have, and that the data do not exclude, may do.

An error that is too small to be seen is in no residual, in no check, and the same in all
collections. Every one that the checks look for is taken as a further number, expected near zero
with what is usual as its standard deviation. The data tell more of it, or less: what they leave
open is carried to the poses, and so is what the poses would move by if it were estimated (the mean
squared error of an estimate that leaves these numbers at zero; JCGM 100, combined standard
uncertainty).
"""

from __future__ import annotations

from typing import List, Mapping, NamedTuple, Tuple, Type

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.board_errors import BoardSize, SeenBorder
from atom_core.problem.model_errors import DepthScale, ModelError, RangeScale
from atom_core.solvers import losses
from atom_core.solvers.scalars import JointScalars
from atom_core.solvers.shared_equations import SharedEquations

RANGE_SCALES = (RangeScale, DepthScale)
_UNTOLD = 1.0  # information on a scale: a sigma of 100 %
_SEEN = 1e-11  # eigenvalue of information with a unit diagonal; what is below is rounding


class LeftOpen(NamedTuple):
    """What the data leave open of usual errors.

    Attributes:
        errors: (k) of them.
        expected: (k,) their standard deviations, in their units.
        covariance: (k, k) in the equations' units.
        gains: (6 s, k) by how much the shared blocks follow them.
        step: (k,) to where the data have them.
    """

    errors: List[ModelError]
    expected: np.ndarray
    covariance: np.ndarray
    gains: np.ndarray
    step: np.ndarray

    def of_blocks(self, loss: str) -> np.ndarray:
        """Return (6 s, 6 s): what the shared blocks may be off by these errors, as a covariance.

        Args:
            loss: robust loss of the equations.
        """
        return self.gains @ self._spread(loss) @ self.gains.T

    def followers(self, joint: JointScalars, loss: str) -> np.ndarray:
        """Return (k, p) by how much all numbers follow k independent ones of unit variance.

        Those of single collections, too: where a transform has a value in each.

        Args:
            joint: of insets and errors, those that are estimated free in it.
            loss: robust loss of the equations.
        """
        place = {error: j for j, error in enumerate(joint.errors)}
        rest = [place[error] for error in self.errors]
        held = {j for j, error in enumerate(joint.errors) if isinstance(error, SeenBorder)}
        base = [j for j in range(len(joint.errors)) if j not in held and j not in rest]
        scalars = joint.curvature
        follow = _inverse_of_seen(scalars[np.ix_(base, base)]) @ scalars[np.ix_(base, rest)]
        gains = joint.gains[rest] - follow.T @ joint.gains[base]
        values, vectors = np.linalg.eigh(self._spread(loss))
        return (vectors * np.sqrt(np.maximum(values, 0.0))).T @ gains

    def _spread(self, loss: str) -> np.ndarray:
        """Return (k, k) the mean squared errors that are left, in the equations' units."""
        # What is far off counts less, and the step falls short.
        step = self.step * losses.step_length(loss)
        return self.covariance + np.outer(step, step)

    @property
    def told_board_size(self) -> float:
        """How exactly the data tell the size of all boards together, as a part of it.

        What is expected of the size does not count, but what is of all other errors does. Infinity:
        not at all, as of cameras alone. Zero where a solution has estimated it.
        """
        return self._told_together((BoardSize,))

    @property
    def told_ranges(self) -> float:
        """How exactly the data tell by what part all ranges and depths are off alike.

        Infinity: not at all, as of LiDARs without a camera or an arm. Zero without range sensors,
        and where a solution has estimated it.
        """
        return self._told_together(RANGE_SCALES)

    def _told_together(self, kinds: Tuple[Type[ModelError], ...]) -> float:
        """Return the sigma of a number that is the same for all errors of these kinds."""
        places = [j for j, error in enumerate(self.errors) if type(error) in kinds]
        if not places:
            return 0.0
        steps = np.array([self.errors[j].step for j in places])
        covariance = self.covariance[np.ix_(places, places)] * steps[:, None] * steps
        told = np.linalg.inv(covariance) - np.diag(self.expected[places] ** -2.0)
        information = float(np.sum(told))
        return 1.0 / np.sqrt(information) if information > _UNTOLD else np.inf


def left_open(
    equations: SharedEquations, usual: Mapping[ModelError, float], free_borders: bool = False
) -> LeftOpen:
    """Return what the data leave open of errors that are usual.

    Args:
        equations: at the solution, with all errors that sensors and boards may have.
        usual: standard deviations of those that the solution has not estimated, in their units.
        free_borders: believe no sensor where it sees the edges of boards.
    """
    place, total, gradient = equations.place, equations.total, equations.total_gradient
    nuisances = {e for e in place if isinstance(e, SeenBorder)}
    held = set() if free_borders else nuisances
    free = (e for e in place if e not in held and (e in nuisances or e not in usual))
    errors = [e for e in place if e in usual and e not in nuisances]
    base, rest = [*range(equations.shared), *(place[e] for e in free)], [place[e] for e in errors]
    cross = total[np.ix_(base, rest)]
    gains = _inverse_of_seen(total[np.ix_(base, base)]) @ cross
    expected = np.array([usual[error] for error in errors])
    sizes = expected / np.array([error.step for error in errors])
    covariance = _posterior(total[np.ix_(rest, rest)] - cross.T @ gains, sizes)
    step = -covariance @ (gradient[rest] - gains.T @ gradient[base])
    return LeftOpen(errors, expected, covariance, gains[: BLOCK_SIZE * equations.blocks], step)


def _inverse_of_seen(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of information (m, m); zero along directions that nothing sees.

    No row depends on these, so that no error moves them; what is left of them is rounding.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-30))
    values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
    seen = values > _SEEN
    inverse = np.where(seen, 1.0 / np.where(seen, values, 1.0), 0.0)
    return (vectors * inverse) @ vectors.T * scale[:, None] * scale


def _posterior(information: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the covariance (k, k) of numbers of which data tell something, and priors the rest.

    Args:
        information: (k, k) of the data.
        sizes: (k,) standard deviations that are expected.
    """
    # Rounding is far below one, which is what the priors say in these units.
    in_sizes = np.eye(len(sizes)) + information * sizes[:, None] * sizes
    return np.linalg.inv(in_sizes) * sizes[:, None] * sizes
