"""Does a border that was drawn by hand lie where the labels of that image have the board?"""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.observed import Borders, NotMeasurableError, Observed
from atom_core.geometry.polyline import evenly_spaced, offsets_to_segments
from atom_core.io.annotations import UNNAMED
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

# By how much a drawn border is off in the mean when it is of another picture, or was drawn
# carelessly; what it is drawn for, such as intrinsics that are a little wrong, is less.
_LEAST_PX, _PART_OF_BOARD = 5.0, 0.05  # the part is of the diagonal that is seen
_PER_PX = 0.5  # points looked at


def misplaced_annotations(test: Dataset, annotations: Borders) -> List[str]:
    """Return a sentence for each drawn border that lies elsewhere than the labels' board.

    Args:
        test: the dataset whose images were drawn in.
        annotations: segments (m, 2, 2) [px] by collection, sensor and pattern; those without a
            label in that image are passed over.
    """
    observed, found = Observed(test), []
    for place, segments in annotations.items():
        off = _off(test, observed, DetectionKey(*place), segments)
        if off is not None and off.px > off.limit_px:
            collection, sensor, pattern = place
            found.append(
                f"annotation_{sensor}.json: the border drawn in collection {collection} is "
                f"{off.px:.0f} px away from where the labels of that image have '{pattern}', "
                f"and figures of {sensor} contain that; draw it anew, or move the file away"
            )
    return found


def with_patterns(test: Dataset, annotations: Borders) -> Tuple[Borders, List[str]]:
    """Return drawn borders by the pattern that each is of, and what the user should know.

    ATOM's files do not say which of several patterns was drawn. It is the one that the labels of
    the image have there; a border that lies on none of them is left out.

    Args:
        test: the dataset whose images were drawn in, with the selected patterns.
        annotations: as read; those of no named pattern have ``UNNAMED`` in its place.
    """
    observed, found = Observed(test), dict(annotations)
    used: Dict[str, List[bool]] = {}
    for place in [place for place in annotations if place[2] == UNNAMED]:
        collection, sensor, _ = place
        segments = found.pop(place)
        offs = {
            pattern: _off(test, observed, DetectionKey(collection, sensor, pattern), segments)
            for pattern in test.patterns
        }
        told = {pattern: off for pattern, off in offs.items() if off is not None}
        near = {pattern: off.px for pattern, off in told.items() if off.px <= off.limit_px}
        if near:
            found[collection, sensor, min(near, key=lambda name: near[name])] = segments
        if told:  # else nothing is compared with it
            used.setdefault(sensor, []).append(bool(near))
    return found, [_whose(sensor, each, list(test.patterns)) for sensor, each in used.items()]


def _whose(sensor: str, used: Sequence[bool], patterns: Sequence[str]) -> str:
    left_out = used.count(False)
    return (
        f"annotation_{sensor}.json does not say which pattern is drawn: "
        f"{used.count(True)} of {len(used)} borders are used for the pattern on whose labels they "
        f"lie"
        + (f", {left_out} lie on none ({', '.join(patterns)}) and are left out" if left_out else "")
        + "; put the pattern's name above the sides of each collection"
    )


class _Off(NamedTuple):
    """How far a drawn border is from the labels' [px], and what is too far."""

    px: float
    limit_px: float


def _off(
    test: Dataset, observed: Observed, key: DetectionKey, segments: np.ndarray
) -> Optional[_Off]:
    """Return it; None where no label of that image tells."""
    if key.collection not in test.collections or test.label(key) is None:
        return None
    labeled = _labeled_border(test, observed, key)
    if labeled is None:
        return None
    off_px = min(_mean_offset_px(segments, labeled), _mean_offset_px(labeled, segments))
    size_px = float(np.linalg.norm(np.ptp(labeled.reshape(-1, 2), axis=0)))
    return _Off(off_px, max(_LEAST_PX, _PART_OF_BOARD * size_px))


def _mean_offset_px(one: np.ndarray, other: np.ndarray) -> float:
    """Return how far segments (n, 2, 2) are from others (m, 2, 2); either may be a part only."""
    points = np.concatenate([evenly_spaced(segment, _PER_PX) for segment in one])
    return float(np.linalg.norm(offsets_to_segments(points, other), axis=1).mean())


def _labeled_border(test: Dataset, observed: Observed, key: DetectionKey) -> Optional[np.ndarray]:
    """Return the border by the image's own labels, as segments (m, 2, 2) [px]; None: untold."""
    try:
        if not test.sensors[key.sensor].kind.measures_range:
            return observed.border(key)
        pixels = observed.limit_pixels(key)
        return np.stack([pixels, pixels], axis=1)
    except NotMeasurableError:
        return None
