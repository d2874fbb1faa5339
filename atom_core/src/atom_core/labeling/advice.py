"""What to do about labels that fail again and again: a line with the numbers that are known.

Numbers come from where other sensors see the board, from the sensor's intrinsics and the print of
the board, and from where the sensor itself has found it. Where none of these tells, the labeler's
own reason stands alone.
"""

from __future__ import annotations

import re
from typing import Mapping, NamedTuple, Optional, Sequence

import numpy as np

from atom_core.labeling.rgb import LEAST_SHARE
from atom_core.labeling.view_quality import ForeseenView
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, Pattern

LEAST_FAILURES = 2
_LEAST_CELL_PX = 2.2  # of a marker: all boards of test pictures are found; at 1.6 px few are
_LEAST_SQUARE_PX = 8.0  # of a chessboard
_BEYOND = 1.05  # of what was found: clearly farther, more slanted


class Failure(NamedTuple):
    """A label that failed.

    Attributes:
        reason: the labeler's.
        view: what the sensor would see of the board where others see it; None: nobody tells.
    """

    reason: str
    view: Optional[ForeseenView] = None


def same_reason(reason: str) -> str:
    """Return a reason without its numbers: what two of the same kind have in common."""
    return re.sub(r"\d+(\.\d+)?", "#", reason)


def least_square_px(config: PatternConfig) -> float:
    """Return the side of a square [px] from which on a camera finds a board reliably."""
    if config.pattern_type != CHARUCO or config.inner_size is None or config.dictionary is None:
        return _LEAST_SQUARE_PX
    bits = int(config.dictionary[len("DICT_")])
    return _LEAST_CELL_PX * (bits + 2) * config.size / config.inner_size


def advice(
    failures: Sequence[Failure],
    found: Sequence[Mapping[str, float]],
    pattern: Pattern,
    config: PatternConfig,
) -> str:
    """Return what to do about failures of one kind.

    Args:
        failures: of a sensor before a pattern, for the same reason, at least one.
        found: figures of the labels that the sensor did find (`view_quality`).
        pattern: the board.
        config: its print.
    """
    reason = failures[-1].reason
    views = [failure.view for failure in failures if failure.view is not None]
    if not views:
        return reason
    view = ForeseenView._make(np.median(np.array(views, dtype=float), axis=0).tolist())
    remedy = _from_behind(view) or _out_of_image(view, pattern, config)
    remedy = remedy or _too_small(view, config) or _beyond_what_was_found(view, found)
    if remedy:
        return remedy
    where = f"the board stands {view.distance_m:.1f} m away, tilted {view.tilt_deg:.0f} deg"
    return f"{reason} ({where})"


def _from_behind(view: ForeseenView) -> str:
    if not (np.isfinite(view.frontal_px) and view.tilt_deg > 90.0):
        return ""
    return f"board seen from behind (tilted {view.tilt_deg:.0f} deg): turn its print to the camera"


def _out_of_image(view: ForeseenView, pattern: Pattern, config: PatternConfig) -> str:
    if not np.isfinite(view.frontal_px):
        return ""
    count = pattern.corner_count
    least = int(np.ceil(LEAST_SHARE * count)) if config.pattern_type == CHARUCO else count
    if view.in_image >= least:
        return ""
    return (
        f"board out of the image: {view.in_image:.0f} of its {count} corners lie in it, {least} "
        f"are needed: move it towards the middle of the image"
    )


def _too_small(view: ForeseenView, config: PatternConfig) -> str:
    least = least_square_px(config)
    if not view.square_px < least:  # also where it is not known
        return ""
    if view.frontal_px >= least:
        return (
            f"board too slanted ({view.square_px:.0f} px across a square, {least:.0f} are needed; "
            f"tilted {view.tilt_deg:.0f} deg): turn it towards the sensor"
        )
    nearer_m = view.distance_m * view.square_px / least
    return (
        f"board too small ({view.square_px:.0f} px per square, {least:.0f} are needed): come "
        f"nearer than {nearer_m:.1f} m"
    )


def _beyond_what_was_found(view: ForeseenView, found: Sequence[Mapping[str, float]]) -> str:
    distances = [f["distance_m"] for f in found if "distance_m" in f]
    tilts = [f["tilt_deg"] for f in found if "tilt_deg" in f]
    if distances and view.distance_m > _BEYOND * max(distances):
        return (
            f"board too far ({view.distance_m:.1f} m): come nearer than {max(distances):.1f} m, "
            f"from where it was found"
        )
    if tilts and view.tilt_deg > _BEYOND * max(tilts):
        return (
            f"board too slanted ({view.tilt_deg:.0f} deg): turn it to less than {max(tilts):.0f} "
            f"deg, at which it was found"
        )
    return ""
