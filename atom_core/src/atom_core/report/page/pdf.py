"""A report on paper: the same blocks as the HTML page, drawn by matplotlib."""

from __future__ import annotations

import io
import textwrap
from contextlib import contextmanager
from typing import Any, Iterator, List, Sequence, Tuple, Union

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_pdf import PdfPages, RendererPdf
from matplotlib.figure import Figure

from atom_core.report.page.blocks import (
    Branch,
    Cell,
    Chart,
    Folded,
    Gallery,
    Page,
    Picture,
    Table,
    Text,
    Tree,
    Viewer,
)
from atom_core.report.page.html import STYLE
from atom_core.report.page.paper import BOTTOM, SIZE_IN, TOP, Item, Paper, literal
from atom_core.report.tables import text_table

_COLUMNS = 108  # of a page of text
_LINE = 8 * 1.5 / (72.0 * SIZE_IN[1])  # of the first sheets, as a part of the height
_HIGHEST, _LOWEST_TOP = 0.6, 0.35  # of the view of the rig, as parts of the height
_WIDE = 124  # columns of a table, up to the margin
_CELL_COLUMNS = 60  # of a table; longer cells have several lines
_COLOURS = {"good": "#00664b", "weak": "#ffd166", "wrong": "#a4161a", "unknown": "#444b50"}
_INK_ON = {"weak": "#1b1f22"}
_GREY = "#5b6770"

Items = List[Item]


def pdf(page: Page) -> bytes:
    """Return the document.

    Args:
        page: what it shows.
    """
    stream = io.BytesIO()
    metadata = {"Title": page.title, "CreationDate": None}
    small = {**STYLE, "font.size": 7.5, "pdf.compression": 9}
    with rc_context(small), _cut_images(), PdfPages(stream, metadata=metadata) as written:
        paper = Paper(written.savefig)
        cover(paper, page)
        paper.end_sheet()
        for section in page.sections:
            lines, items = _told(section.blocks)
            paper.section(section.title, _wrapped_tables(lines), items)
        for sheet in paper.sheets:
            written.savefig(sheet)
    return stream.getvalue()


@contextmanager
def _cut_images() -> Iterator[None]:
    """Have of each image in memory what is shown: matplotlib keeps a view of a sheet of pixels."""
    draw = RendererPdf.draw_image

    def draw_copied(self: RendererPdf, gc: Any, x: float, y: float, im: Any, *more: Any) -> None:
        draw(self, gc, x, y, np.array(im), *more)

    RendererPdf.draw_image = draw_copied
    try:
        yield
    finally:
        RendererPdf.draw_image = draw


def cover(paper: Paper, page: Page) -> None:
    """Write the first sheets: the verdict, a line for each sensor, and the rig."""
    figure = paper.new_sheet()
    figure.text(0.07, 0.955, literal(page.title), fontsize=15, weight="bold")
    colour = _COLOURS.get(page.grade, _COLOURS["unknown"])
    lines = textwrap.wrap(page.sentence, 84)
    height = 0.035 + 0.016 * len(lines)
    band = figure.add_axes((0.07, 0.935 - height, 0.86, height))
    band.set_facecolor(colour)
    band.set_xticks([])
    band.set_yticks([])
    look = {"color": _INK_ON.get(page.grade, "white"), "transform": band.transAxes, "va": "top"}
    band.text(0.015, 0.93, page.grade.upper(), fontsize=11, weight="bold", **look)
    band.text(0.015, 0.93 - 0.022 / height, literal("\n".join(lines)), fontsize=9, **look)
    told = [f"{name}: {value}" for name, value in page.facts] + [page.also]
    for sensor in page.sensors:
        told.append("")
        told.append(f"{sensor.name} ({sensor.modality}): {sensor.word.upper()}. {sensor.why}")
        told += [f"    What to do: {sensor.advice}"] if sensor.advice else []
    figure, free = _written(paper, figure, _wrapped(told).split("\n"), 0.915 - height)
    if page.viewer is not None:
        if free < _LOWEST_TOP:
            figure, free = paper.new_sheet(), TOP
        _draw_rig(figure, page.viewer.still, free)


def _written(paper: Paper, sheet: Figure, lines: Sequence[str], top: float) -> Tuple[Figure, float]:
    """Write lines below a height, on as many sheets as they need.

    Returns:
        The last sheet, and up to which height it is empty.
    """
    left = list(lines)
    while True:
        count = int((top - BOTTOM) / _LINE)
        text, left = "\n".join(left[:count]), left[count:]
        sheet.text(0.07, top, literal(text), fontsize=8, va="top", linespacing=1.25)
        if not left:
            return sheet, top - (text.count("\n") + 2) * _LINE
        sheet, top = paper.new_sheet(), TOP


def _draw_rig(figure: Figure, still: Chart, top: float) -> None:
    """Draw the view of the rig below a height of a sheet."""
    bottom = max(top - _HIGHEST, 2.0 * BOTTOM)
    axes = figure.add_axes((0.02, bottom, 0.96, top - bottom), projection="3d")
    still.draw(axes)
    figure.text(0.07, bottom - 0.02, still.alt, fontsize=7, color=_GREY)


def _wrapped(lines: Sequence[str]) -> str:
    found: List[str] = []
    for line in lines:
        begin = line[: len(line) - len(line.lstrip())]
        found += textwrap.wrap(line, _COLUMNS, subsequent_indent=begin) or [""]
    return "\n".join(found)


def _wrapped_tables(lines: Sequence[str]) -> List[str]:
    """Return lines that fit the page; what is longer goes on in the next one."""
    found: List[str] = []
    for line in lines:
        found += [line[i : i + _WIDE] for i in range(0, max(len(line), 1), _WIDE)]
    return found


def _told(blocks: Sequence[Any]) -> Tuple[List[str], Items]:
    """Return the words of blocks as lines, and their figures."""
    lines: List[str] = []
    items: Items = []
    for block in blocks:
        if isinstance(block, Text):
            lines += [*_wrapped([block.text]).split("\n"), ""]
        elif isinstance(block, Table):
            lines += _table_lines(block)
            lines += [*_wrapped([block.note]).split("\n"), ""]
        elif isinstance(block, Tree):
            lines += [*(line for root in block.roots for line in _branches(root, 0)), ""]
        elif isinstance(block, (Chart, Picture)):
            items.append(block)
        elif isinstance(block, Viewer):
            items.append(block.still)
        elif isinstance(block, Gallery):
            items += block.items
        elif isinstance(block, Folded):
            more, others = _told(block.blocks)
            lines, items = lines + more, items + others
    return lines, items


def _table_lines(block: Table) -> List[str]:
    """Return a table as lines; one that is wider than the page comes in parts, side after side.

    Long cells have several lines, and each part begins with the first column.
    """
    rows = [[_folded(_text(cell)) for cell in row] for row in block.rows]
    titles = list(block.columns)
    widths = [
        max(len(title) + 2, *(len(line) for cell in cells for line in cell.split("\n")), 0) + 2
        for title, *cells in zip(titles, *rows)
    ]
    parts: List[List[int]] = [[]]
    for i in range(1, len(titles)):
        if parts[-1] and widths[0] + sum(widths[k] for k in [*parts[-1], i]) - 2 > _WIDE:
            parts.append([])
        parts[-1].append(i)
    lines: List[str] = []
    for part in parts:
        shown = [[row[i] for i in (0, *part)] for row in rows]
        table = text_table([titles[i] for i in (0, *part)], shown, block.caption)
        lines += [*([""] if lines else []), *table.split("\n")]
    return lines


def _folded(cell: str) -> str:
    """Return a cell as it is, or on several lines; figures keep their type, which is aligned."""
    return cell if len(cell) <= _CELL_COLUMNS else textwrap.fill(cell, _CELL_COLUMNS)


def _branches(branch: Branch, depth: int) -> Iterator[str]:
    note = f"   [{branch.note}]" if branch.note else ""
    yield f"{'  ' * depth}{branch.name}{note}"
    for child in branch.children:
        yield from _branches(child, depth + 1)


def _text(cell: Union[str, Cell]) -> str:
    return cell if isinstance(cell, str) else cell.text
