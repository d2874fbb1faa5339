"""Calibration patterns: corners by id and the physical border, in the pattern's frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.geometry.rectangle import Rectangle

BoardKey = Tuple[str, Optional[str]]  # pattern, collection (None for a fixed pattern)

CHARUCO, CHESSBOARD = "charuco", "chessboard"
_MOST_CORNERS = 1_000_000  # of a pattern; no camera sees as many
_BORDER_STEP_M = 0.02  # spacing of ATOM's border samples


@dataclass(frozen=True)
class Pattern:
    """A flat board with corners that cameras see and a border that range sensors see.

    Attributes:
        name: its key in config and dataset.
        kind: charuco or chessboard.
        frame: frame of the board (x along the columns, y along the rows).
        parent_frame: the frame in which its pose is estimated.
        fixed: True when one pose holds for all collections.
        columns, rows: numbers of inner corners.
        square_m: side of a square [m].
        corners_by_id: (n, 2) [m]; row i is the corner with id i, NaN where there is none.
        border: the board's physical edges [m].
    """

    name: str
    kind: str
    frame: str
    parent_frame: str
    fixed: bool
    columns: int
    rows: int
    square_m: float
    corners_by_id: np.ndarray
    border: Rectangle

    def board_key(self, collection: str) -> BoardKey:
        """Return which of the board's poses holds in a collection."""
        return (self.name, None if self.fixed else collection)

    @property
    def corner_count(self) -> int:
        """Number of inner corners."""
        return self.columns * self.rows

    @property
    def first_corner(self) -> np.ndarray:
        """(2,) position of corner 0 [m]."""
        return self.corners_by_id[0]

    def corners_of(self, ids: np.ndarray) -> np.ndarray:
        """Return the corners (n, 3) of ids (n,), z = 0 [m].

        Raises:
            ValueError: an id that the pattern does not have.
        """
        ids = np.asarray(ids, dtype=int)
        known = (ids >= 0) & (ids < len(self.corners_by_id))
        known[known] &= np.isfinite(self.corners_by_id[ids[known], 0])
        if not np.all(known):
            raise ValueError(
                f"corner id {ids[~known][0]} is not on pattern '{self.name}' "
                f"({self.columns} x {self.rows} corners)"
            )
        return np.column_stack([self.corners_by_id[ids], np.zeros(len(ids))])


def grid_corners(kind: str, columns: int, rows: int, square_m: float) -> np.ndarray:
    """Return corners (rows * columns, 2) [m] in the order of their ids.

    A chessboard has its origin at the first inner corner, a ChArUco at the outer corner of the
    printed squares (docs/conventions.md).
    """
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    grid = np.column_stack([column.ravel(), row.ravel()]).astype(float)
    return (grid + 1.0 if kind == CHARUCO else grid) * square_m


def board_border(
    kind: str,
    columns: int,
    rows: int,
    square_m: float,
    sides_m: Tuple[float, float, float, float],
) -> Rectangle:
    """Return the board's edges [m]: the printed squares, and left, right, top, bottom of them."""
    start = 0.0 if kind == CHARUCO else -square_m
    left, right, top, bottom = sides_m
    return Rectangle(
        start - left,
        start - top,
        start + (columns + 1) * square_m + right,
        start + (rows + 1) * square_m + bottom,
    )


def pattern_from_config(name: str, config: Any) -> Pattern:
    """Return the pattern that a ``PatternConfig`` describes."""
    columns, rows = config.dimension
    return Pattern(
        name=name,
        kind=config.pattern_type,
        frame=config.link,
        parent_frame=config.parent_link,
        fixed=config.fixed,
        columns=columns,
        rows=rows,
        square_m=config.size,
        corners_by_id=grid_corners(config.pattern_type, columns, rows, config.size),
        border=board_border(config.pattern_type, columns, rows, config.size, config.border_sides),
    )


def geometry_document(pattern: Pattern) -> Dict[str, Any]:
    """Return the pattern's part of a dataset (corners, frame, transitions) as ATOM writes it."""
    named = ("top_left", "top_right", "bottom_right", "bottom_left")
    corners = dict(zip(named, pattern.border.corners))
    sides = {
        "top": ("top_left", "top_right"),
        "bottom": ("bottom_left", "bottom_right"),
        "left": ("top_left", "bottom_left"),
        "right": ("top_right", "bottom_right"),
    }
    return {
        "corners": [
            {"id": i, "x": float(x), "y": float(y)}
            for i, (x, y) in enumerate(pattern.corners_by_id)
            if np.isfinite(x)
        ],
        "frame": {
            "corners": {name: _xy(corner) for name, corner in corners.items()},
            "lines_sampled": {
                side: _line(corners[start], corners[end]) for side, (start, end) in sides.items()
            },
        },
        "transitions": {"vertical": [], "horizontal": []},
    }


def corners_from_document(document: Mapping[str, Any]) -> np.ndarray:
    """Return corners by id (n, 2) [m] of a dataset's pattern; NaN rows where an id is absent.

    Raises:
        ValueError: an id that no board has, or that stands twice.
    """
    by_id: Dict[int, Tuple[float, float]] = {}
    for entry in document["corners"]:
        number = int(entry["id"])
        if not 0 <= number < _MOST_CORNERS:
            raise ValueError(f"corner id {entry['id']} is not within 0 and {_MOST_CORNERS - 1}")
        if number in by_id:
            raise ValueError(f"corner id {number} stands there twice")
        by_id[number] = entry["x"], entry["y"]
    corners = np.full((1 + max(by_id), 2), np.nan)
    corners[list(by_id)] = list(by_id.values())
    return corners


def border_from_document(document: Mapping[str, Any]) -> Rectangle:
    """Return the border of a dataset's pattern [m]."""
    corners = document["frame"]["corners"].values()
    xs, ys = [c["x"] for c in corners], [c["y"] for c in corners]
    return Rectangle(min(xs), min(ys), max(xs), max(ys))


def _line(start: np.ndarray, end: np.ndarray) -> List[Dict[str, float]]:
    count = max(int(round(np.linalg.norm(end - start) / _BORDER_STEP_M)), 2)
    return [_xy(start + s * (end - start)) for s in np.linspace(0.0, 1.0, count)]


def _xy(point: np.ndarray) -> Dict[str, float]:
    return {"x": float(point[0]), "y": float(point[1])}
