"""How far a board that stays is turned from one collection to another, beyond the labels' noise."""

from __future__ import annotations

from typing import List, Mapping, Optional, Tuple

import numpy as np

from atom_core.evaluation.observed import Observed
from atom_core.evaluation.statistics import Errors
from atom_core.model.labels import DetectionKey

Seen = Tuple[DetectionKey, DetectionKey]


def turn_beyond_noise(observed: Observed, seen: Mapping[Seen, Errors]) -> Optional[float]:
    """Return the median turn [rad], without the part that the corners' noise makes of it.

    Args:
        observed: the labels.
        seen: errors of the board's poses, of a detection in one collection and one in another.

    Returns:
        None where no board is known by its corners to be turned one way and not the other.
    """
    beyond: List[float] = []
    for keys, errors in seen.items():
        variance = sum(observed.turn_variance(key) for key in keys)
        if errors.rotation_deg is not None and np.isfinite(variance):
            turn = np.radians(errors.rotation_deg)
            beyond.append(np.sqrt(max(turn**2 - variance, 0.0)))
    return float(np.median(beyond)) if beyond else None
