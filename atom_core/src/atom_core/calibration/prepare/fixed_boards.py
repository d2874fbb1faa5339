"""Boards that are configured not to move: whether sensors that do not move either agree."""

from __future__ import annotations

from typing import Dict, List, Sequence, Tuple

import numpy as np

from atom_core.calibration.prepare.connectivity import stand_still
from atom_core.errors import CalibrationError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.problem.measurements import Measurement

_SAME_M, _SAME_SHARE = 0.05, 0.05  # a camera has a board that stands still to so much; of distance
_LEAST, _LEAST_SHARE = 2, 0.25  # detections elsewhere, so that they are no single bad labels


def check_fixed_boards(dataset: Dataset, measurements: Sequence[Measurement]) -> None:
    """Refuse a board that is configured fixed and moves before a sensor that stands still.

    Only sensors and boards count between which no link moves; what a detection alone says of the
    board's middle is enough to tell.

    Raises:
        CalibrationError: naming board and sensor, how far apart they have it, and the remedy.
    """
    seen: Dict[Tuple[str, str], List[Measurement]] = {}
    for m in measurements:
        if dataset.patterns[m.key.pattern].fixed:
            seen.setdefault((m.key.pattern, m.key.sensor), []).append(m)
    for (pattern, sensor), detections in seen.items():
        keys = sorted({m.key.collection for m in detections})
        ends = [dataset.sensors[sensor].frame, dataset.patterns[pattern].parent_frame]
        if not stand_still(dataset, ends, keys):
            continue
        apart_m = _apart_m(dataset, detections)
        if apart_m:
            raise CalibrationError(
                f"board '{pattern}' is configured `fixed: true`, but sensor '{sensor}', which "
                f"stands still, sees it in places up to {apart_m:.2f} m apart; set "
                f"`fixed: false` of it, or use collections of one place alone (-csf)"
            )


def _apart_m(dataset: Dataset, detections: Sequence[Measurement]) -> float:
    """Return the largest distance [m] between the places of a board; 0 where they are one."""
    border = dataset.patterns[detections[0].key.pattern].border
    centre = border.centre_in_pattern[None]
    middles, limits = [], []
    for m in detections:
        candidates = m.likely_candidates()
        if not candidates:
            continue
        middle = se3.apply(candidates[0], centre)[0]
        exact_m = _SAME_M + _SAME_SHARE * float(np.linalg.norm(middle))
        diagonal_m = 2.0 * float(np.linalg.norm(border.half_size))
        middles.append(middle)
        limits.append(exact_m if m.identifies_board else diagonal_m)
    if len(middles) <= _LEAST:
        return 0.0
    places = np.array(middles)
    elsewhere = np.linalg.norm(places - np.median(places, axis=0), axis=1) > np.array(limits)
    if np.sum(elsewhere) < max(_LEAST, _LEAST_SHARE * len(places)):
        return 0.0
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return float(np.max(apart))
