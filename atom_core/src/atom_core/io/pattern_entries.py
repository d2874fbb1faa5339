"""Patterns of a dataset: what the configuration says of a board, and what was stored of it."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Tuple

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.model.pattern import (
    Pattern,
    border_from_document,
    corners_from_document,
    geometry_document,
)

_SAME_M = 1e-6


def pattern_of_entry(pattern: Pattern, stored: Mapping[str, Any]) -> Tuple[Pattern, List[str]]:
    """Return a pattern with the corners of its entry, and warnings where the two differ.

    Corners belong to the labels, which name them, so that the stored ones hold. A border that
    differs beside the same corners was corrected in the configuration.

    Args:
        pattern: as the configuration describes it.
        stored: its entry under ``patterns``; may be empty.

    Raises:
        KeyError, ValueError, TypeError: corners or frame are malformed.
    """
    if "corners" not in stored:
        return pattern, []
    corners, border = corners_from_document(stored), pattern.border
    if (stored.get("frame") or {}).get("corners"):
        border = border_from_document(stored)
    agree = corners.shape == pattern.corners_by_id.shape and np.allclose(
        corners, pattern.corners_by_id, atol=_SAME_M, equal_nan=True
    )
    same_border = np.allclose(border.corners, pattern.border.corners, rtol=0.0, atol=_SAME_M)
    warnings = []
    if not agree:
        places = "" if same_border else f" and patterns.{pattern.name}.frame.corners"
        warnings.append(
            f"pattern '{pattern.name}': its corners{'' if same_border else ' and its border'} "
            f"differ from what the configuration says; the dataset's own are used "
            f"(patterns.{pattern.name}.corners{places})"
        )
    elif not same_border:
        border = pattern.border
        warnings.append(
            f"pattern '{pattern.name}': its border differs from the one that was collected with "
            f"(patterns.{pattern.name}.frame.corners); that of the configuration is used, correct "
            f"its border_size if this is not the board's"
        )
    return Pattern(**{**pattern.__dict__, "corners_by_id": corners, "border": border}), warnings


def with_borders(stored: Mapping[str, Any], dataset: Dataset) -> Dict[str, Any]:
    """Return the entries of the patterns with the borders that were used, the same ones as is."""
    result = dict(stored)
    for name, pattern in dataset.patterns.items():
        entry = stored.get(name)
        if not isinstance(entry, Mapping) or not (entry.get("frame") or {}).get("corners"):
            continue
        before = border_from_document(entry).corners
        if not np.allclose(before, pattern.border.corners, rtol=0.0, atol=_SAME_M):
            frame = {**entry["frame"], **geometry_document(pattern)["frame"]}
            result[name] = {**entry, "frame": frame}
    return result
