"""What a report is made of: sections of blocks. HTML and PDF are drawn from the same values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.report.tables import ABSENT

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Text:
    """A paragraph.

    Attributes:
        text: plain.
        warns: whether it is a warning.
    """

    text: str
    warns: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell of a table that has more than its text.

    Attributes:
        text: plain.
        mark: how it is coloured: good, weak, wrong, none, seen.
        title: what else is to be said of it.
    """

    text: str
    mark: str = ""
    title: str = ""


@dataclass(frozen=True)
class Table:
    """A table; the first cell of each row is its heading.

    Attributes:
        caption: what it says.
        columns: headings.
        rows: cells, plain texts or `Cell`.
        matrix: many narrow columns, which stay beside one another on a narrow screen.
        note: below it.
        words: its cells are words rather than numbers.
    """

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Union[str, Cell]]]
    matrix: bool = False
    note: str = ""
    words: bool = False

    @property
    def numeric(self) -> List[bool]:
        """Whether each column holds numbers alone."""
        return [all(_is_number(row[i]) for row in self.rows) for i in range(len(self.columns))]


def _is_number(cell: Union[str, Cell]) -> bool:
    text = cell if isinstance(cell, str) else cell.text
    try:
        float(text.split()[0] if text else "0")
    except (ValueError, IndexError):
        return text == ABSENT
    return True


@dataclass(frozen=True)
class Chart:
    """A figure of numbers.

    Attributes:
        title: above it.
        alt: what it shows, for who does not see it.
        draw: draws it on axes of matplotlib.
        dense: it holds thousands of marks, and is kept as pixels.
        solid: it needs axes of three dimensions.
    """

    title: str
    alt: str
    draw: Callable[[Axes], None]
    dense: bool = False
    solid: bool = False


@dataclass(frozen=True)
class Picture:
    """An image of a sensor with something drawn on it.

    Attributes:
        title, alt: as of a chart.
        image: (height, width, 3) uint8, blue green red.
    """

    title: str
    alt: str
    image: np.ndarray = field(repr=False)


@dataclass(frozen=True)
class Gallery:
    """Charts and pictures side by side where there is room.

    Attributes:
        items: in the order of reading.
        wide: two in a row rather than three.
        title: above them; may be empty.
    """

    items: Sequence[Union[Chart, Picture]]
    wide: bool = False
    title: str = ""


@dataclass(frozen=True)
class Branch:
    """A frame in the tree of transforms, and the ones below it.

    Attributes:
        name: of the frame.
        note: what became of the edge that leads to it; empty: it was given.
        mark: moved, held or nothing.
        children: below it.
    """

    name: str
    note: str = ""
    mark: str = ""
    children: Tuple[Branch, ...] = ()


@dataclass(frozen=True)
class Tree:
    """The tree of transforms."""

    roots: Sequence[Branch]


@dataclass(frozen=True)
class Viewer:
    """The rig in three dimensions, to be turned.

    Attributes:
        scene: numbers for the viewer (`scene.py`).
        still: the same as a figure, for paper and for browsers that cannot draw it.
    """

    scene: Mapping[str, Any] = field(repr=False)
    still: Chart = field(repr=False)


@dataclass(frozen=True)
class Folded:
    """Blocks that are only shown when they are asked for."""

    title: str
    blocks: Sequence[Any]


Block = Union[Text, Table, Chart, Picture, Gallery, Tree, Viewer, Folded]


@dataclass(frozen=True)
class Section:
    """A part of the report.

    Attributes:
        name: for links.
        title: its heading.
        blocks: what it holds.
    """

    name: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class SensorLine:
    """What is said of a sensor in the first screen.

    Attributes:
        name, modality: of the sensor.
        grade: good, weak, wrong or unknown; its colour.
        word: good, weak, wrong, not determined.
        why: in plain words.
        advice: what to do; empty where nothing is to be done.
    """

    name: str
    modality: str
    grade: str
    word: str
    why: str
    advice: str = ""


@dataclass(frozen=True)
class Page:
    """A whole report.

    Attributes:
        title: of the document.
        grade: of the rig; good, weak, wrong or unknown.
        sentence: what it means, and what to do.
        also: the sentence of the other result, where there are two.
        sensors: a line for each.
        viewer: the rig; None where no dataset could be read.
        sections: below the first screen.
        facts: about the report itself, name and value.
    """

    title: str
    grade: str
    sentence: str
    also: str
    sensors: Sequence[SensorLine]
    viewer: Optional[Viewer]
    sections: Sequence[Section]
    facts: Sequence[Tuple[str, str]]


def galleries(title: str, items: List[Union[Chart, Picture]], wide: bool = False) -> List[Gallery]:
    """Return a gallery in a list, none of nothing."""
    return [Gallery(items, wide, title)] if items else []
