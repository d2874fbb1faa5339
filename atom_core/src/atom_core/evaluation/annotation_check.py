"""Does a border that was drawn by hand lie where the labels of that image have the board?"""

from __future__ import annotations

from typing import List, Optional

import numpy as np

from atom_core.evaluation.observed import Borders, NotMeasurableError, Observed
from atom_core.geometry.polyline import evenly_spaced, offsets_to_segments
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
        key = DetectionKey(*place)
        if key.collection not in test.collections or test.label(key) is None:
            continue
        labeled = _labeled_border(test, observed, key)
        if labeled is None:
            continue
        off_px = min(_mean_offset_px(segments, labeled), _mean_offset_px(labeled, segments))
        size_px = float(np.linalg.norm(np.ptp(labeled.reshape(-1, 2), axis=0)))
        if off_px > max(_LEAST_PX, _PART_OF_BOARD * size_px):
            found.append(
                f"annotation_{key.sensor}.json: the border drawn in collection {key.collection} is "
                f"{off_px:.0f} px away from where the labels of that image have '{key.pattern}', "
                f"and figures of {key.sensor} contain that; draw it anew, or move the file away"
            )
    return found


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
