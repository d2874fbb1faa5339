"""How far a calibration is from the truth, beside what it says that it may be."""

from __future__ import annotations

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth
from atom_core.report.edge_results import EdgeResult


class StatedError(NamedTuple):
    """One estimated edge.

    Attributes:
        edge, sensors: which one, and who stands on it.
        error: (6,) calibrated minus true, turns [rad] and shifts [m] about the parent's axes.
        sigma: (6,) as stated.
        combined_sigma: (6,) likewise, with usual errors of sensors and boards.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    error: np.ndarray
    sigma: np.ndarray
    combined_sigma: np.ndarray

    @property
    def translation_m(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.error[3:]))

    @property
    def in_sigmas(self) -> float:
        """The largest of the six numbers, each in its own sigma."""
        return _largest(self.error, self.sigma)

    @property
    def in_combined_sigmas(self) -> float:
        """Likewise, in combined ones."""
        return _largest(self.error, self.combined_sigma)


def _largest(error: np.ndarray, sigma: np.ndarray) -> float:
    return float(np.max(np.abs(error) / np.maximum(sigma, 1e-12)))


def stated_errors(edges: Sequence[EdgeResult], truth: Truth) -> List[StatedError]:
    """Return the errors of the estimated edges that the truth knows of."""
    found = []
    for result in edges:
        true = truth.edges.get(result.edge)
        if result.anchored or true is None:
            continue
        turn = se3.rotation_vector_from_rotation(result.parent_T_child[:3, :3] @ true[:3, :3].T)
        error = np.concatenate([turn, result.parent_T_child[:3, 3] - true[:3, 3]])
        sigmas = result.sigma, result.combined_sigma
        found.append(StatedError(result.edge, result.sensors, error, *sigmas))
    return found
