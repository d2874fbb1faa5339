"""Corners of a ChArUco in an image.

OpenCV only finds the markers. Which square each one fills, where the corners between them are
expected, and the corners themselves follow here, the same for every version of OpenCV: its own
interpolation is half a pixel off in x and y up to 4.11 (opencv_contrib PR 3024, opencv PR 28380),
and changed the layout of boards with an even number of rows at 4.6 (opencv_contrib issue 3291).
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.aruco import detect_markers, marker_squares
from atom_core.geometry.camera import Camera
from atom_core.labeling.board_view import BoardView, off_their_neighbours
from atom_core.labeling.charuco_layout import (
    CURRENT,
    LEGACY,
    Layout,
    corner_grid,
    layouts_of,
    on_squares,
    rows_needed,
)
from atom_core.labeling.likely_lens import likely_lens
from atom_core.labeling.marker_search import (
    Likenesses,
    likenesses,
    once,
    search_markers,
    smoothed_where_flat,
)
from atom_core.labeling.marker_share import MarkerShare, measure_share
from atom_core.labeling.other_dictionary import dictionary_seen
from atom_core.labeling.saddle import Corners, refine
from atom_core.labeling.view_quality import over_exposed_share

LEAST_MARKERS = 3
_LEAST_FITTING = 0.75  # of the markers, for a layout to be right
_LEAST_ROOM = 0.5  # of squares without a marker that would be in view: the board has them not
_LEAST_OWN = 0.5  # of the markers, that the board has at all
_LEAST_TELLING = 8  # markers that tell of another board: fewer, read wrongly, fit one by chance
_FEWEST_CORNERS = 2  # of a board, along a side
_LEAST_QUALITY, _LEAST_CONTRAST = 0.75, 5.0
_LEAST_PITCH_PX = 4.5  # between lines of corners: below it nothing exact can be said
_LARGEST_MOVE_SQUARES, _LARGEST_MOVE_PX = 0.15, 4.0
_DISPLACED_WORTH, _LEAST_LEAD = 2, 2  # of a marker, in corners; of the right layout, in corners
_NO_MARKERS = np.zeros(0, dtype=int), np.zeros((0, 4, 2))
AUTO = "auto"


@dataclass(frozen=True)
class FoundCorners:
    """Corners that were found.

    Attributes:
        ids: (n,) row by row from the top left (docs/conventions.md).
        corners: their places and quality.
        markers: number of markers found.
        dropped: corners in view whose local refit was off.
        in_view: corners that the fitted board has in the image.
        reason: why there are none.
    """

    ids: np.ndarray
    corners: Corners
    markers: int
    dropped: int = 0
    in_view: int = 0
    reason: str = ""


class CharucoFinder:
    """Finds the corners of one ChArUco."""

    def __init__(
        self, columns: int, rows: int, marker_share: float, dictionary: str, legacy: object = AUTO
    ):
        """Set the board.

        Args:
            columns: number of inner corners along x.
            rows: number of inner corners along y.
            marker_share: side of a marker over the side of a square.
            dictionary: name of the markers.
            legacy: the layout before OpenCV 4.6 (True), since (False), or whichever fits ("auto").
        """
        self.dictionary, self.marker_share = dictionary, marker_share
        options = (CURRENT, LEGACY) if legacy == AUTO else (bool(legacy),)
        even = (rows + 1) % 2 == 0
        self.layouts = [Layout(columns, rows, option) for option in options if even or not option]
        if not self.layouts:  # an odd number of rows has one layout
            self.layouts = [Layout(columns, rows, CURRENT)]

    def find(self, grey: np.ndarray, camera: Optional[Camera] = None) -> FoundCorners:
        """Find the corners in a grey image (height, width) uint8.

        Where next to no markers are seen, a print with black and white exchanged is looked for,
        and an image that its driver mirrors is named. Markers of another size than configured are
        named; where blur may make them look so, both sizes are tried.
        """
        smooth = smoothed_where_flat(grey)
        ids, outlines, alike, twice, unread = search_markers(smooth, self.dictionary)
        if len(ids) < LEAST_MARKERS and alike.negative >= LEAST_MARKERS:
            negative = cv2.bitwise_not(smooth)
            if len(detect_markers(negative, self.dictionary)[0]) > len(ids):
                grey, smooth = cv2.bitwise_not(grey), negative
                ids, outlines, alike, twice, unread = search_markers(negative, self.dictionary)
        if len(ids) < LEAST_MARKERS:
            why = self._mirrored(smooth, alike) or self._of_another_dictionary(smooth, unread)
            return _none(len(ids), why or _few(len(ids), twice, self.dictionary))
        camera = self._likely_lens(grey, ids, outlines, camera)
        measured = self._measured(ids, outlines, camera)
        if measured is not None and measured.contradicts(self.marker_share):
            return _none(len(ids), self._other_share(measured))
        found = self._on_board(grey, smooth, ids, outlines, camera)
        if measured is None or not measured.differs(self.marker_share):
            return found
        other = self._with_share(measured.share)._on_board(grey, smooth, ids, outlines, camera)
        return max(found, other, key=lambda one: float(np.sum(one.corners.quality)))

    def _on_board(
        self,
        grey: np.ndarray,
        smooth: np.ndarray,
        ids: np.ndarray,
        outlines: np.ndarray,
        camera: Optional[Camera],
    ) -> FoundCorners:
        """Find the corners of the board on which the markers stand."""
        views = self._fitting(ids, outlines, self.layouts, camera)
        if not views:
            alike = likenesses(smooth, outlines, self.dictionary)
            why = self._mirrored(smooth, alike) or self._why_nothing_fits(
                grey, ids, outlines, camera
            )
            return _none(len(ids), why)
        views += self._fitting(ids, outlines, self._rivals(ids), camera)
        return self._of_the_right_layout(grey, views, len(ids), camera)

    def _likely_lens(
        self, grey: np.ndarray, ids: np.ndarray, outlines: np.ndarray, camera: Optional[Camera]
    ) -> Optional[Camera]:
        """Return the camera, with a lens where it has none and the board is bent."""
        placed = []
        for layout in self.layouts:
            board, known = on_squares(ids, layout, self.marker_share)
            placed.append((board, outlines[known].reshape(-1, 2)))
        return likely_lens(camera, placed, (grey.shape[1], grey.shape[0]))

    def _rivals(self, ids: np.ndarray) -> List[Layout]:
        """Return other boards on which most markers may stand as on this one.

        That is the layout that was not asked for, one square farther left, also of a row less,
        since an odd number of rows has one alone; and boards that have more rows, where markers
        are seen that only these have.
        """
        columns, rows, _ = self.layouts[0]
        needed = rows_needed(ids, columns)
        others = [*layouts_of(columns, rows), *layouts_of(columns, rows - 1)[1:]]
        others += layouts_of(columns, needed) if needed > rows else []
        return [one for one in others if one not in self.layouts and one.rows >= _FEWEST_CORNERS]

    def _measured(
        self, ids: np.ndarray, outlines: np.ndarray, camera: Optional[Camera]
    ) -> Optional[MarkerShare]:
        """Return how large the markers are in their squares, by the first layout that fits."""
        for layout in self.layouts:
            squares = marker_squares(layout.columns + 1, layout.rows + 1, layout.legacy)
            known = ids < len(squares)
            measured = measure_share(squares[ids[known]], outlines[known], camera)
            if measured is not None:
                return measured
        return None

    def _with_share(self, share: float) -> CharucoFinder:
        changed = copy(self)
        changed.marker_share = share
        return changed

    def _other_share(self, measured: MarkerShare) -> str:
        return (
            f"the markers have {measured.share:.2f} of their squares' sides; the configuration "
            f"says {self.marker_share:.2f} (inner_size over size): measure both, and correct them"
        )

    def _of_the_right_layout(
        self,
        grey: np.ndarray,
        views: List[Tuple[Layout, BoardView, int]],
        markers: int,
        camera: Optional[Camera],
    ) -> FoundCorners:
        """Return the corners of the layout that the picture shows.

        Where the number of columns of squares is odd, most markers stand in one layout as in the
        other, one square farther left. The others stand elsewhere, and a column of corners is
        expected where there is none. A board that was not asked for is named where it is clearly
        the right one.
        """
        if len(views) == 1:
            return self._corners(grey, *views[0][:2], markers, camera)
        asked, others = [], [(-np.inf, self.layouts[0])]
        for layout, view, displaced in views:
            found = self._corners(grey, layout, view, markers, camera)
            worth = float(len(found.ids) - _DISPLACED_WORTH * displaced)
            if layout in self.layouts:
                asked.append((worth, found))
            else:
                others.append((worth, layout))
        asked.sort(key=lambda one: one[0])
        (second, _), (first, found) = ([(-np.inf, asked[0][1])] + asked)[-2:]
        most, right = max(others, key=lambda one: one[0])
        if most - first >= _LEAST_LEAD:
            return _none(markers, self._named(right, markers))
        if first - second < _LEAST_LEAD:
            return _none(
                markers,
                f"the {markers} markers seen fit this board as OpenCV prints it since 4.6 and as "
                f"it did before, one square apart; show more of the board, or write legacy: true "
                f"(before 4.6) or false into the pattern's configuration",
            )
        return found

    def _mirrored(self, smooth: np.ndarray, alike: Likenesses) -> str:
        """Say that this board is seen when left and right are exchanged; empty if it is not."""
        mirrored = np.ascontiguousarray(smooth[:, ::-1])
        images = []
        if alike.mirrored >= LEAST_MARKERS:
            images.append(mirrored)
        if alike.mirrored_negative >= LEAST_MARKERS:
            images.append(cv2.bitwise_not(mirrored))
        for image in images:
            ids, outlines = once(*detect_markers(image, self.dictionary))
            if len(ids) >= LEAST_MARKERS and self._fitting(ids, outlines, self.layouts, None):
                return (
                    f"the pattern is mirrored: {len(ids)} markers of {self.dictionary} stand as on "
                    f"this board only when left and right are exchanged; switch the mirroring off "
                    f"in the camera's driver, or print the board anew if it is the print"
                )
        return ""

    def _of_another_dictionary(self, smooth: np.ndarray, unread: np.ndarray) -> str:
        """Say that this board is seen, printed with markers of another dictionary, or ''."""
        columns, rows, _ = self.layouts[0]
        seen = dictionary_seen(smooth, unread, (columns + 1) * (rows + 1) // 2)
        ids, outlines = once(*detect_markers(smooth, seen)) if seen else _NO_MARKERS
        if len(ids) < _LEAST_TELLING or not self._fitting(ids, outlines, self.layouts, None):
            return ""
        return (
            f"no board with markers of {self.dictionary} is seen, but {len(ids)} markers of {seen} "
            f"stand as on it: correct dictionary (that, or a larger one of its kind), or take the "
            f"other board out of view"
        )

    def _fitting(
        self,
        ids: np.ndarray,
        outlines: np.ndarray,
        layouts: List[Layout],
        camera: Optional[Camera],
    ) -> List[Tuple[Layout, BoardView, int]]:
        """Return the layouts that most markers fit, with the number of those that do not."""
        fits = []
        for layout in layouts:
            view, fitting = _fit(ids, outlines, layout, self.marker_share, camera)
            if view is not None and np.mean(fitting) >= _LEAST_FITTING:
                fits.append((layout, view, int(np.sum(~fitting))))
        return fits

    def _why_nothing_fits(
        self, grey: np.ndarray, ids: np.ndarray, outlines: np.ndarray, camera: Optional[Camera]
    ) -> str:
        """Try what is often mistaken in a configuration; name what would fit, or the exposure."""
        right = self._another_board(grey.shape, ids, outlines, camera)
        if right is not None:
            return self._named(right, len(ids))
        seen = f"{len(ids)} markers of {self.dictionary} are seen, but they do not stand as on this"
        white = over_exposed_share(grey, outlines.reshape(-1, 2))
        if white > 0.0:
            return (
                f"{seen} board: the picture is over-exposed ({white:.0%} of it about them is as "
                f"white as can be), so that markers may be read wrongly; give the camera less "
                f"light, or a shorter exposure, and if they stay where they are, check dimension "
                f"(inner corners), size and inner_size"
            )
        return (
            f"{seen} board; check dimension (inner corners), size and inner_size, or if there are "
            f"two"
        )

    def _named(self, right: Layout, markers: int) -> str:
        """Say that the markers stand as on another board."""
        columns, rows, _ = self.layouts[0]
        guess = (right.columns, right.rows)
        swapped = "rows and columns are swapped; " if guess == (rows, columns) else ""
        wrong = f"dimension is {{x: {columns}, y: {rows}}}"
        fits = f"{{x: {right.columns}, y: {right.rows}}} fits the markers"
        if guess == (columns, rows):
            layout = str(right.legacy).lower()
            wrong, fits = "its even number of rows is laid out otherwise", f"legacy: {layout} fits"
        return f"{markers} markers are seen, but the board is another: {swapped}{wrong}, {fits}"

    def _another_board(
        self,
        shape: Tuple[int, ...],
        ids: np.ndarray,
        outlines: np.ndarray,
        camera: Optional[Camera],
    ) -> Optional[Layout]:
        """Return the board that the markers stand as on, of those that are often mistaken for this.

        Where a marker stands depends on the number of columns alone. Rows are as many as the
        marker of the highest number needs; more of them may be out of sight, so where the columns
        are those configured, or its rows, the other number is believed as well, unless the image
        (height, width) has room for what would be seen of them.
        """
        if len(ids) < _LEAST_TELLING:
            return None
        columns, rows, _ = self.layouts[0]
        found = []
        near = (n + i for i in (-1, 1, -2, 2) for n in (columns, rows))
        stated = {rows: columns, columns: rows}
        for right in (n for n in dict.fromkeys((rows, columns, *near)) if n >= _FEWEST_CORNERS):
            right_rows = max(rows_needed(ids, right), stated.get(right, 0), _FEWEST_CORNERS)
            layouts = [Layout(right, right_rows, option) for option in (CURRENT, LEGACY)]
            found += self._fitting(ids, outlines, layouts, camera)
        if not found:
            return None
        layout, view, _ = min(found, key=lambda fit: fit[2])
        needed = max(rows_needed(ids, layout.columns), _FEWEST_CORNERS)
        further = corner_grid(layout)[needed * layout.columns :] + 0.5  # in squares beyond them
        room = _inside(view.project(further), shape) if len(further) else np.zeros(1)
        return layout._replace(rows=needed) if np.mean(room) > _LEAST_ROOM else layout

    def _corners(
        self,
        grey: np.ndarray,
        layout: Layout,
        view: BoardView,
        markers: int,
        camera: Optional[Camera],
    ) -> FoundCorners:
        """Refine the corners twice: near the markers, then near what the first ones say."""
        board = corner_grid(layout)
        black = (
            np.arange(len(board)) % layout.columns + np.arange(len(board)) // layout.columns
        ) % 2
        first_is_black = (black == 0) != (layout.legacy and (layout.rows + 1) % 2 == 0)
        gap = (1.0 - self.marker_share) / 2.0
        ids, corners = _refined(grey, view, board, gap, first_is_black, 2)
        in_view = len(ids)
        good = _acceptable(corners, view.axes_px(board[ids]))
        if np.sum(good) >= 6:
            try:
                view = BoardView(board[ids[good]], corners.pixels[good], camera)
            except ValueError:
                return _none(markers, "the corners found lie on a line")
            ids, corners = _refined(grey, view, board, gap, first_is_black, 3)
            in_view = len(ids)
            good = _acceptable(corners, view.axes_px(board[ids]))
            good &= ~off_their_neighbours(board[ids], corners.pixels, good, camera)
        kept = Corners(*(values[good] for values in vars(corners).values()))
        return FoundCorners(ids[good], kept, markers, int(np.sum(~good)), in_view)


def _fit(
    ids: np.ndarray,
    outlines: np.ndarray,
    layout: Layout,
    marker_share: float,
    camera: Optional[Camera],
) -> Tuple[Optional[BoardView], np.ndarray]:
    """Return the board's view, and which of its markers stand as the layout says.

    Markers that the board has not are of something else; where they are many, so are the others.
    """
    board, known = on_squares(ids, layout, marker_share)
    if np.sum(known) < max(LEAST_MARKERS, _LEAST_OWN * len(ids)):
        return None, np.zeros(0, dtype=bool)
    try:
        view = BoardView(board, outlines[known].reshape(-1, 2), camera)
    except ValueError:
        return None, np.zeros(0, dtype=bool)
    return view, view.inliers.reshape(-1, 4).all(axis=1)


def _refined(
    grey: np.ndarray,
    view: BoardView,
    board: np.ndarray,
    gap: float,
    first_is_black: np.ndarray,
    iterations: int,
) -> Tuple[np.ndarray, Corners]:
    """Return ids and places of the corners expected in the image."""
    expected, axes = view.project(board), view.axes_px(board)
    pitch = np.abs(np.linalg.det(axes)) / np.linalg.norm(axes, axis=1).max(axis=1)
    seen = _inside(expected, grey.shape)
    ids = np.flatnonzero(seen & (pitch >= _LEAST_PITCH_PX) & view.of_use(board))
    return ids, refine(grey, expected[ids], axes[ids], gap, first_is_black[ids], iterations)


def _inside(pixels: np.ndarray, shape: Tuple[int, ...]) -> np.ndarray:
    """Return (n,) bool, which pixels (n, 2) are in an image (height, width)."""
    return np.all((pixels >= 2) & (pixels <= [shape[1] - 3, shape[0] - 3]), axis=1)


def _acceptable(corners: Corners, axes_px: np.ndarray) -> np.ndarray:
    side = np.linalg.norm(axes_px, axis=1).min(axis=1)
    good = corners.moved_px <= np.maximum(
        np.minimum(_LARGEST_MOVE_SQUARES * side, _LARGEST_MOVE_PX), 1.0
    )
    return good & (corners.quality >= _LEAST_QUALITY) & (corners.contrast >= _LEAST_CONTRAST)


def _few(count: int, twice: int, dictionary: str) -> str:
    if count + twice >= LEAST_MARKERS:
        return (
            f"{twice} markers of {dictionary} are seen twice or more, so that none of them tells "
            f"which board it is on: there is another board with these markers, or a picture of "
            f"one; take it out of view"
        )
    if count == 0:
        return f"no marker of {dictionary} is seen"
    return f"{count} marker(s) of {dictionary} are seen, {LEAST_MARKERS} are needed"


def _none(markers: int, reason: str) -> FoundCorners:
    empty = np.zeros(0)
    corners = Corners(np.zeros((0, 2)), empty, empty, empty)
    return FoundCorners(np.zeros(0, dtype=int), corners, markers, reason=reason)
