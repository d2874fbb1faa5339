"""Borders of a board picked by hand in the clouds of a LiDAR, in files as ATOM's tool writes them.

``annotation_<sensor>.json`` stands beside the dataset. Per collection it holds the board's plane,
for each side the picked points laid on the plane and the line through them, and where neighbouring
sides meet. Lengths are in metres, in the LiDAR's frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.annotations import PLANE, SIDES, metadata
from atom_core.io.atomic import write_json_atomically
from atom_core.io.json_text import load_json
from atom_core.io.structure import OTHER_KIND

Point = Tuple[float, float]
# Between which sides a corner is, in the order of the rectangle's corners: from the top left on.
CORNERS = {
    "left-top": ("left", "top"),
    "top-right": ("top", "right"),
    "right-bottom": ("right", "bottom"),
    "bottom-left": ("bottom", "left"),
}
_HALF_LINE_M = 0.75  # of a side's line beyond its middle
_LEAST = 2  # points of a line
_PARALLEL = 1e-3


class PickedSides(NamedTuple):
    """What was picked in one collection.

    Attributes:
        lidar_T_plane: (4, 4) the plane in which the points are.
        sides: picked points (x, y) in the plane, by side.
    """

    lidar_T_plane: np.ndarray
    sides: Mapping[str, Sequence[Point]]


class Line(NamedTuple):
    """A line in a plane: its middle (2,) and its unit direction (2,)."""

    middle: np.ndarray
    direction: np.ndarray


def write_picked_sides(path: Path, picked: Mapping[str, PickedSides]) -> None:
    """Write what was picked, by collection.

    Raises:
        OutputError: the file cannot be written.
    """
    document: Dict[str, Any] = {"_metadata": metadata()}
    for collection, sides in picked.items():
        document[collection] = _entry(sides)
    write_json_atomically(path, document)


def read_picked_sides(path: Path) -> Dict[str, PickedSides]:
    """Return what was picked, by collection; nothing where there is no file.

    Raises:
        DatasetError: the file is malformed.
    """
    if not path.is_file():
        return {}
    try:
        document = load_json(path.read_text(encoding="utf-8"))
        return {key: _picked(entry) for key, entry in document.items() if key != "_metadata"}
    except OTHER_KIND as error:
        raise DatasetError(
            f"{path}: not a file of picked borders ({error}); pick again, or move the file away"
        ) from None


def corners_of(picked: PickedSides) -> Optional[np.ndarray]:
    """Return the board's corners (4, 3) in the LiDAR's frame, in the order of `CORNERS`.

    None where a side has fewer than two points, or neighbours do not meet.
    """
    lines = {side: line_through(picked.sides.get(side, ())) for side in SIDES}
    found = []
    for one, other in CORNERS.values():
        first, second = lines[one], lines[other]
        if first is None or second is None:
            return None
        sides = np.column_stack([first.direction, -second.direction])
        if abs(np.linalg.det(sides)) < _PARALLEL:
            return None
        along = np.linalg.solve(sides, second.middle - first.middle)
        found.append(first.middle + along[0] * first.direction)
    return _in_space(picked.lidar_T_plane, np.array(found))


def line_through(points: Sequence[Point]) -> Optional[Line]:
    """Return the line nearest to points; None of fewer than two different ones."""
    given = np.array(points, dtype=float).reshape(-1, 2)
    if len(given) < _LEAST or np.ptp(given, axis=0).max() == 0.0:
        return None
    middle = given.mean(axis=0)
    _, _, rows = np.linalg.svd(given - middle, full_matrices=False)
    return Line(middle, rows[0])


def _in_space(lidar_T_plane: np.ndarray, points: np.ndarray) -> np.ndarray:
    return se3.apply(lidar_T_plane, np.column_stack([points, np.zeros(len(points))]))


def _entry(picked: PickedSides) -> Dict[str, Any]:
    frame = picked.lidar_T_plane
    normal = frame[:3, 2]
    numbers = dict(zip("ABC", normal.tolist()), D=float(-normal @ frame[:3, 3]))
    entry: Dict[str, Any] = {PLANE: {**numbers, "lidar_T_plane": frame.tolist()}}
    for side in SIDES:
        entry[side] = _side(frame, picked.sides.get(side, ()))
    corners = corners_of(picked)
    entry["intersections"] = {
        name: dict(zip("xyz", point)) for name, point in zip(CORNERS, _lists(corners))
    }
    return entry


def _lists(corners: Optional[np.ndarray]) -> List[List[float]]:
    return [] if corners is None else corners.tolist()


def _side(frame: np.ndarray, points: Sequence[Point]) -> Dict[str, Any]:
    given = np.array(points, dtype=float).reshape(-1, 2)
    entry: Dict[str, Any] = {"picked_pts": _in_space(frame, given).T.tolist()}
    line = line_through(points)
    if line is not None:
        reach = _HALF_LINE_M * line.direction
        ends = _in_space(frame, np.array([line.middle - reach, line.middle + reach]))
        entry["start"], entry["end"] = ends.tolist()
        entry["direction"] = (frame[:3, :2] @ line.direction).tolist()
    return entry


def _picked(entry: Mapping[str, Any]) -> PickedSides:
    frame = np.array(entry[PLANE]["lidar_T_plane"], dtype=float)
    if frame.shape != (4, 4):
        raise ValueError("lidar_T_plane is no 4 x 4 matrix")
    sides: Dict[str, Sequence[Point]] = {}
    for side in SIDES:
        points = np.array(entry[side].get("picked_pts") or np.zeros((3, 0)), dtype=float)
        flat = se3.apply(se3.inverse(frame), points.reshape(3, -1).T)
        sides[side] = [(float(x), float(y)) for x, y in flat[:, :2]]
    return PickedSides(frame, sides)
