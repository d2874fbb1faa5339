"""Sheets of A4 that are filled from above: headings, lines of text, rows of figures."""

from __future__ import annotations

import textwrap
from typing import Any, Callable, List, Optional, Sequence, Union

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, MaxNLocator

from atom_core import opencv as cv2
from atom_core.report.page.blocks import Chart, Picture
from atom_core.report.page.html import axes_of

Item = Union[Chart, Picture]

SIZE_IN = (8.27, 11.69)
LEFT, RIGHT = 0.07, 0.95  # of the width; what follows in parts of the height, from below
TOP, BOTTOM = 0.965, 0.035
TEXT_SIZE = 6.8
LINE = TEXT_SIZE * 1.2 / (72.0 * SIZE_IN[1])  # matplotlib's lines are 1.2 of their size apart
_HEADING, _HEADING_SIZE = 0.036, 13
_ROW, _GAP = 0.225, 0.012
_TITLE_COLUMNS, _TITLE_SIZE = 62, 7.5  # of a figure's title, which may have several lines
_TICKS = 5  # intervals of an axis at most, so that its numbers do not touch
_ABOUT_WIDE = 0.05  # height of what is around a wide picture
_WIDE = 2.0  # a picture so many times as wide as high gets a row of its own
_FEWEST_LINES = 8  # of a paragraph that goes on on the next sheet
# What an item leaves free of its cell: left, right, below, above.
_MARGINS_OF_CHART, _MARGINS_OF_PICTURE = (0.055, 0.06, 0.046, 0.034), (0.01, 0.01, 0.008, 0.026)


class Paper:
    """Begins a new sheet where something does not fit on the one before.

    Attributes:
        sheets: as filled so far; the last one alone where somebody takes those that are full.
    """

    def __init__(self, full: Optional[Callable[[Figure], None]] = None):
        """Begin without a sheet.

        Args:
            full: takes each sheet that is full; of hundreds, all together need gigabytes.
        """
        self.sheets: List[Figure] = []
        self._full = full
        self._free = 0.0  # the height up to which the last sheet is empty

    def new_sheet(self) -> Figure:
        """Begin the next sheet, and return it; the one before is full."""
        if self._full is not None and self.sheets:
            self._full(self.sheets.pop())
        sheet = Figure(figsize=SIZE_IN, dpi=130)
        FigureCanvasAgg(sheet)
        self.sheets.append(sheet)
        self._free = TOP
        return sheet

    def end_sheet(self) -> None:
        """Leave the rest of the sheet empty."""
        self._free = 0.0

    def section(self, title: str, lines: Sequence[str], items: Sequence[Item]) -> None:
        """Add a heading, paragraphs that empty lines part, and figures, two in a row.

        Args:
            title: the heading.
            lines: of text, no longer than a sheet is wide.
            items: the figures.
        """
        paragraphs, rows = _paragraphs(lines), _rows(items)
        first = _room_for(paragraphs[0]) if paragraphs else _ROW
        self._make_room(_HEADING + first)
        place = {"fontsize": _HEADING_SIZE, "weight": "bold", "va": "top"}
        self.sheets[-1].text(LEFT, self._free, literal(title), **place)
        self._free -= _HEADING
        for paragraph in paragraphs:
            self._paragraph(paragraph)
        for row in rows:
            self._row(row)
        self._free -= _GAP

    def _make_room(self, height: float) -> None:
        if self._free - height < BOTTOM:
            self.new_sheet()

    def _paragraph(self, lines: Sequence[str]) -> None:
        """Write lines; those that do not fit go on on the next sheet, not only a few of them."""
        left = list(lines)
        while left:
            self._make_room(_room_for(left))
            count = int((self._free - BOTTOM) / LINE + 1e-6)
            text, left = "\n".join(left[:count]), left[count:]
            look = {"fontsize": TEXT_SIZE, "va": "top", "family": "monospace"}
            self.sheets[-1].text(LEFT, self._free, literal(text), **look)
            self._free -= LINE * (text.count("\n") + 1)
        self._free -= LINE

    def _row(self, items: Sequence[Item]) -> None:
        width, height = (RIGHT - LEFT) / 2, _ROW
        if _is_wide(items[0]):
            width = RIGHT - LEFT
            height = min(_ROW, width * SIZE_IN[0] / SIZE_IN[1] / _aspect(items[0]) + _ABOUT_WIDE)
        self._make_room(height)
        for i, item in enumerate(items):
            self._draw(item, LEFT + i * width, self._free - height, width, height)
        self._free -= height

    def _draw(self, item: Item, x: float, y: float, width: float, height: float) -> None:
        sheet = self.sheets[-1]
        is_picture = isinstance(item, Picture)
        left, right, below, above = _MARGINS_OF_PICTURE if is_picture else _MARGINS_OF_CHART
        inner = {"left": x + left, "right": x + width - right}
        inner.update(bottom=y + below, top=y + height - above)
        place = sheet.add_gridspec(1, 1, **inner)[0]
        if isinstance(item, Picture):
            axes = sheet.add_subplot(place)
            axes.imshow(cv2.cvtColor(item.image, cv2.COLOR_BGR2RGB), interpolation="nearest")
            axes.set_axis_off()
        else:
            axes = axes_of(sheet, item, place)
            item.draw(axes)
            for drawn in axes.collections:
                drawn.set_rasterized(item.dense)
            _make_room_for_names(sheet, axes, x)
            if isinstance(axes.xaxis.get_major_locator(), AutoLocator):
                axes.xaxis.set_major_locator(MaxNLocator(_TICKS))
        title = textwrap.fill(item.title, _TITLE_COLUMNS)
        axes.set_title(literal(title), fontsize=_TITLE_SIZE)


def literal(text: str) -> str:
    """Return a text as matplotlib must get it to draw it as it is: two `$` are no formula."""
    return text.replace("$", r"\$")


def _make_room_for_names(sheet: Figure, axes: Any, left: float) -> None:
    """Move the left side of axes so that what stands beside it begins at a part of the width."""
    box = axes.yaxis.get_tightbbox(sheet.canvas.get_renderer())
    if box is None:
        return
    begin = box.transformed(sheet.transFigure.inverted()).x0
    if begin < left:
        now = axes.get_position()
        moved = (now.x0 + left - begin, now.y0, now.width - (left - begin), now.height)
        axes.set_position(moved)


def _aspect(item: Item) -> float:
    """Return how many times as wide as high an item is; 1 for a chart, which fits any room."""
    return item.image.shape[1] / item.image.shape[0] if isinstance(item, Picture) else 1.0


def _is_wide(item: Item) -> bool:
    return _aspect(item) > _WIDE


def _rows(items: Sequence[Item]) -> List[List[Item]]:
    """Return the items in rows of two; wide ones by themselves."""
    rows: List[List[Item]] = []
    for item in items:
        if rows and len(rows[-1]) == 1 and not _is_wide(item) and not _is_wide(rows[-1][0]):
            rows[-1].append(item)
        else:
            rows.append([item])
    return rows


def _paragraphs(lines: Sequence[str]) -> List[List[str]]:
    found: List[List[str]] = [[]]
    for line in lines:
        if line.strip():
            found[-1].append(line)
        elif found[-1]:
            found.append([])
    return [paragraph for paragraph in found if paragraph]


def _room_for(paragraph: Sequence[str]) -> float:
    """Return what it needs on a sheet: all of it if it is short."""
    whole = len(paragraph)
    return LINE * (whole if whole <= 3 * _FEWEST_LINES else _FEWEST_LINES)
