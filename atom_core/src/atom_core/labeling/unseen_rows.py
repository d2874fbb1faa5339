"""Rows of corners that a board is configured to have and that no picture shows."""

from __future__ import annotations

from typing import Iterable, NamedTuple, Optional

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.labeling.board_view import BoardView
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import Pattern

_LEAST_PICTURES = 5  # in which the row would be seen
_LEAST_CORNERS = 6  # of a label, to tell where the others would be
_LEAST_SHARE = 0.75  # of a row: found before the unseen one, and of that in the image
_MARGIN_SQUARES = 0.5  # around a corner, which its picture must show
REMEDY = "correct dimension and border and collect again, or uncover the board"


class SeenRows(NamedTuple):
    """What one picture tells of a board's rows.

    Attributes:
        rows: how many, counted from the first, up to the last one with a corner found.
        is_next_in_view: whether the row after it would be in the picture.
    """

    rows: int
    is_next_in_view: bool


def seen_rows(label: RgbLabel, pattern: Pattern, camera: Camera) -> SeenRows:
    """Return how many rows of the board a label has, and whether one more would be in view.

    It would be where most corners of the row before it are found, and most of its own would lie
    within the image, half a square from its edge.
    """
    row, column = np.divmod(np.asarray(label.ids, dtype=int), pattern.columns)
    rows = int(np.max(row)) + 1
    found = np.sum(row == rows - 1)
    enough = len(row) >= _LEAST_CORNERS and min(np.ptp(row), np.ptp(column)) > 0
    if rows >= pattern.rows or not enough or found < _LEAST_SHARE * pattern.columns:
        return SeenRows(rows, False)
    board = np.column_stack([column, row]).astype(float)
    try:
        view = BoardView(board, label.pixels, camera)
    except ValueError:
        return SeenRows(rows, False)
    further = np.column_stack([np.arange(pattern.columns), np.full(pattern.columns, rows)])
    further = further.astype(float)
    margin_px = _MARGIN_SQUARES * np.linalg.norm(view.axes_px(further), axis=1).max(axis=1)
    limit_px = np.array([camera.width, camera.height]) - 1.0 - margin_px[:, None]
    pixels = view.project(further)
    inside = np.all((pixels >= margin_px[:, None]) & (pixels <= limit_px), axis=1)
    return SeenRows(rows, bool(np.mean(inside & view.of_use(further)) >= _LEAST_SHARE))


def unseen_rows_remark(pattern: Pattern, pictures: Iterable[SeenRows]) -> Optional[str]:
    """Say that no picture shows the board's last rows, where many would; None if that is not so.

    A ChArUco with rows too many is labeled all the same, for the markers of its first rows stand
    as on the board; but its border is not where the configuration has it.
    """
    seen = list(pictures)
    rows = max((one.rows for one in seen), default=pattern.rows)
    count = sum(one.is_next_in_view for one in seen if one.rows == rows)
    if rows >= pattern.rows or count < _LEAST_PICTURES:
        return None
    missing = pattern.rows - rows
    last = "row" if missing == 1 else f"{missing} rows"
    return (
        f"no picture shows a corner of the last {last} of pattern '{pattern.name}', though {count} "
        f"have room for one: the board has {pattern.columns} x {rows} inner corners, not "
        f"{pattern.columns} x {pattern.rows}, and its border is elsewhere, or something covers "
        f"that part of it in all pictures"
    )
