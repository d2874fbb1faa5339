"""Polylines as stacks of segments (m, 2, 2): start and end point of each, in a plane."""

from __future__ import annotations

from typing import Tuple

import numpy as np

_BLOCK = 400_000  # point-segment couples worked on at once, to bound the memory


def segments_of(points: np.ndarray, closed: bool = False) -> np.ndarray:
    """Return the segments (m, 2, 2) between consecutive points (n, 2).

    A single point becomes one segment without length.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(points) == 1:
        return np.stack([points, points], axis=1)
    following = np.roll(points, -1, axis=0)
    return np.stack([points, following], axis=1)[: len(points) if closed else len(points) - 1]


def evenly_spaced(points: np.ndarray, density: float) -> np.ndarray:
    """Return points (n, 2) along a polyline, as many as its length times the density.

    Each segment has them between its ends, both included; a single point stays one.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(points) < 2:
        return points
    found = []
    for start, end in segments_of(points):
        count = int(round(density * round(float(np.linalg.norm(end - start)))))
        found.append(np.linspace(start, end, max(count, 2)))
    return np.concatenate(found)


def offsets_to_segments(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return (n, 2) from the nearest point of any segment to each point (n, 2).

    Args:
        points: (n, 2).
        segments: (m, 2, 2), m >= 1; they may have no length.
    """
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    if len(segments) == 0:
        raise ValueError("a distance to no segments is not defined")
    step = max(_BLOCK // len(segments), 1)
    blocks = [_offsets(points[i : i + step], segments) for i in range(0, len(points), step)]
    return np.concatenate(blocks) if blocks else np.zeros((0, 2))


def _offsets(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    square = np.sum(along**2, axis=1)
    from_start = points[:, None] - start
    fraction = np.sum(from_start * along, axis=2) / np.where(square > 0, square, 1.0)
    offsets = from_start - np.clip(fraction, 0.0, 1.0)[..., None] * along
    nearest = np.argmin(np.sum(offsets**2, axis=2), axis=1)
    return offsets[np.arange(len(points)), nearest]


def clip_segments(segments: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the parts of segments (m, 2, 2) that lie in the box from low (2,) to high (2,).

    Segments without a part in the box disappear. Source: Liang, Barsky, "A new concept and
    method for line clipping" (ACM Transactions on Graphics 1984).
    """
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    moving = along != 0
    rate = np.where(moving, along, 1.0)
    to_low, to_high = (low - start) / rate, (high - start) / rate
    enter = np.where(moving, np.minimum(to_low, to_high), -np.inf)
    leave = np.where(moving, np.maximum(to_low, to_high), np.inf)
    beside = np.any(~moving & ((start < low) | (start > high)), axis=1)
    first = np.maximum(np.max(enter, axis=1), 0.0)
    last = np.minimum(np.min(leave, axis=1), 1.0)
    kept = (first <= last) & ~beside
    ends: Tuple[np.ndarray, np.ndarray] = tuple(
        start[kept] + fraction[kept, None] * along[kept] for fraction in (first, last)
    )
    return np.stack(ends, axis=1)
