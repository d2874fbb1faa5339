"""What one calibration found and how surely, for those that compare calibrations."""

from __future__ import annotations

from typing import NamedTuple, Optional, Tuple

import numpy as np

from atom_core.model.transforms import Edge


class EdgeState(NamedTuple):
    """An edge as a calibration found it.

    Attributes:
        edge: parent and child.
        sensors: that stand on it.
        anchored: it was held.
        parent_T_child: (4, 4).
        sigma: (6,) of turns [rad] and shifts [m] about and along the parent's axes.
        covariance: (6, 6) likewise.
        model_sigma: (6,) likewise, as the assumed noise has it.
        combined_sigma: (6,) likewise, with usual errors of sensors and boards; None: not known.
        detections: of its sensors, that were used; 0: not known.
        freedom: degrees of freedom of Student's t by which `sigma` is wider; infinite: it is not.
        collection: of an edge with a value for each collection, the one whose sigmas these are;
            its pose is that of the first. None: one value holds for all.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    anchored: bool
    parent_T_child: np.ndarray
    sigma: np.ndarray
    covariance: np.ndarray
    model_sigma: np.ndarray
    combined_sigma: Optional[np.ndarray] = None
    detections: int = 0
    freedom: float = np.inf
    collection: Optional[str] = None


class ParameterState(NamedTuple):
    """A parameter of a joint as a calibration found it.

    Attributes:
        joint, name: which.
        unit: of what follows; m or rad.
        value, sigma: with its standard deviation.
        combined_sigma: likewise, with usual errors of sensors and boards; None: not known.
    """

    joint: str
    name: str
    unit: str
    value: float
    sigma: float
    combined_sigma: Optional[float] = None

    def __str__(self) -> str:
        """Return the joint's name and the parameter's."""
        return f"{self.joint} {self.name}"
