"""How RViz lays out its window, as Qt stores it: `QMainWindow State` of an RViz configuration.

Qt writes it with its QDataStream, big-endian: the dock areas (left, right, ...) as nested lists of
panes, each with its place and size, then the middle, the corners, and the tool bars. Sizes are
those of the window for which it is made; in another one Qt scales them.
"""

from __future__ import annotations

import struct
from typing import List, NamedTuple, Sequence

WIDTH, HEIGHT = 1600, 1000  # of the window
_LEFT_AREA, _RIGHT_AREA, _TOP_BAR_AREA = 0, 1, 2
_TABS, _SEQUENCE, _PANE, _AREAS, _BARS, _VERSION = 0xFA, 0xFC, 0xFB, 0xFD, 0xFC, 0xFF
_HORIZONTAL, _VERTICAL = 1, 2
_LEAST, _MOST = 50, 0x00FFFFFF  # of a pane, in screen pixels
_VISIBLE = 1
_CORNERS = (4, 4, 8, 8)  # of the areas above and below
_BESIDE_THE_VIEW = 4  # separator
_FRAME_HEIGHT = 74  # of the window, without the docks: menu, tools, status line
_MOST_IN_A_COLUMN = 4


class Side(NamedTuple):
    """What stands beside the view.

    Attributes:
        panes: names of panels and displays, from above.
        width: in screen pixels.
    """

    panes: Sequence[str]
    width: int


def window_state(tabs: Side, images: Side) -> str:
    """Return the layout: tabs to the left, the first before the others; images to the right.

    More than four images stand in two columns.
    """
    height = HEIGHT - _FRAME_HEIGHT
    areas: List[bytes] = []
    if tabs.panes:
        inner = bytes([_TABS]) + _int(0) + _items(_VERTICAL, tabs.panes, height)
        nested = bytes([_SEQUENCE]) + _extent(0, height) + inner
        area = bytes([_SEQUENCE, _VERTICAL]) + _int(1) + nested
        areas.append(_int(_LEFT_AREA) + _size(tabs.width, height) + area)
    if images.panes:
        area = _columns(images, height)
        areas.append(_int(_RIGHT_AREA) + _size(images.width, height) + area)
    middle = WIDTH - (tabs.width if tabs.panes else 0) - (images.width if images.panes else 0)
    state = bytes([0, 0, 0, _VERSION]) + _int(0)
    state += bytes([_AREAS]) + _int(len(areas)) + b"".join(areas)
    state += _size(middle, height) + b"".join(_int(corner) for corner in _CORNERS)
    state += bytes([_BARS]) + _int(1) + _int(_TOP_BAR_AREA) + _int(1)
    state += _text("Tools") + bytes([_VISIBLE]) + _int(0) + _int(-1) + _int(0) + _int(0)
    return state.hex()


def _columns(images: Side, height: int) -> bytes:
    """Return one column, or two beside each other."""
    panes = list(images.panes)
    if len(panes) <= _MOST_IN_A_COLUMN:
        return bytes([_SEQUENCE]) + _items(_VERTICAL, panes, height)
    half = -(-len(panes) // 2)
    nested = b""
    for place, column in enumerate((panes[:half], panes[half:])):
        width = images.width // 2
        nested += bytes([_SEQUENCE]) + _extent(place * width, width)
        nested += bytes([_SEQUENCE]) + _items(_VERTICAL, column, height)
    return bytes([_SEQUENCE, _HORIZONTAL]) + _int(2) + nested


def _items(orientation: int, names: Sequence[str], length: int) -> bytes:
    """Return panes one after the other, of equal sizes."""
    made, size = bytes([orientation]) + _int(len(names)), length // len(names)
    for number, name in enumerate(names):
        made += bytes([_PANE]) + _text(name) + bytes([_VISIBLE])
        made += _extent(number * size, size - _BESIDE_THE_VIEW)
    return made


def _extent(begin: int, length: int) -> bytes:
    return _int(begin) + _int(length) + _int(_LEAST) + _int(_MOST)


def _size(width: int, height: int) -> bytes:
    return _int(width) + _int(height)


def _int(value: int) -> bytes:
    return struct.pack(">i", value)


def _text(text: str) -> bytes:
    data = text.encode("utf-16-be")
    return struct.pack(">I", len(data)) + data
