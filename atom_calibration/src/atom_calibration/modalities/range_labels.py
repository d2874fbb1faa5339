"""What the modalities that measure ranges have in common: labels of points in messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, List, Optional

import numpy as np

from atom_core.labeling.stillness import PlaneSighting, PointNoise, plane_sighting
from atom_core.model.labels import Label, RangeLabel

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

_MOST_POINTS = 400  # of a label that tell where the board is


def read_range_label(part: Any) -> Label:
    """Return the points and limit points of a PatternLabels."""
    return RangeLabel(np.array(part.idxs, dtype=int), np.array(part.idxs_limit_points, dtype=int))


def write_range_label(label: Label, part: Any) -> None:
    """Put points and limit points into a PatternLabels."""
    assert isinstance(label, RangeLabel)
    part.idxs, part.idxs_limit_points = label.indices.tolist(), label.limit_indices.tolist()


def plane_of_label(frame: Frame, label: Label, noise: PointNoise) -> Optional[PlaneSighting]:
    """Return the plane that labeled points lie in; None if they make none.

    Args:
        frame: the data.
        label: of points in it.
        noise: of the sensor.
    """
    assert isinstance(label, RangeLabel) and frame.ros.points is not None
    step = max(len(label.indices) // _MOST_POINTS, 1)
    points = frame.ros.points(frame, label.indices[::step])
    return plane_sighting(points[np.all(np.isfinite(points), axis=1)], noise)


def range_labels(frame: Frame) -> List[RangeLabel]:
    """Return the labels of a frame in which something was found."""
    found = [labeled.label for labeled in frame.labels.values() if labeled.detected]
    return [label for label in found if isinstance(label, RangeLabel)]
