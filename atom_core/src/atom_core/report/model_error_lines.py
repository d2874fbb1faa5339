"""What a calibration says of errors of sensors and boards: estimated, or seen in the data.

The screen and the report say the same: both get entries ``model_errors`` of ``calibration.json``.
"""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.calibration.refine.error_words import remedy
from atom_core.problem.model_errors import METRE

_SHOWN_SIGMAS = 2.0  # an expected error of the model that is less is only in the document

Entries = Sequence[Mapping[str, Any]]


def estimated_errors(errors: Entries) -> List[str]:
    """Return a sentence for each error that was estimated, and for each family of them."""
    alone = [e for e in errors if e["estimated"] and e.get("family") is None]
    told = [
        str(e["sentence"])
        for e in alone
        if e.get("prior_sigma") is None or abs(e["value"]) > _SHOWN_SIGMAS * e["sigma"]
    ]
    return told + _families(errors)


def shown_errors(errors: Entries) -> List[str]:
    """Return a sentence for each error that the data show and that was left, with the remedy."""
    lines = []
    for error in errors:
        if error["estimated"] or error.get("family") is not None:
            continue
        others = ", ".join(error.get("rivals", ()))
        if others:
            lines.append(f"{error['sentence']}; these boards cannot tell it from: {others}")
        else:
            lines.append(f"{error['sentence']} ({remedy(error['option'])})")
    return lines


def _families(errors: Entries) -> List[str]:
    """Return a line for the errors of each sensor that are many and of one sort."""
    values: Dict[Tuple[str, str, str], List[float]] = {}
    for error in errors:
        if error.get("family") is not None:
            key = error["family"], error["target"], error["unit"]
            values.setdefault(key, []).append(error["value"])
    lines = []
    for (family, target, unit), sizes in values.items():
        rms = math.sqrt(float(np.mean(np.square(sizes))))
        size = f"{1e3 * rms:.2g} mm" if unit == METRE else f"{100.0 * rms:.2g} %"
        lines.append(f"{len(sizes)} {family}s of {target}, {size} each (RMS)")
    return lines
