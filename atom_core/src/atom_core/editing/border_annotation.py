"""Drawing a board's border by hand, side by side and collection by collection; without a window.

Points are pixels of the image. What a key does is ATOM's; the file's form is in io/annotations.py.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.io.annotations import SIDES

Point = Tuple[float, float]
Lines = Dict[str, List[Point]]  # clicked points by side

CHANGING_KEYS = (
    "n / p: next / previous side    . / ,: next / previous collection    u: takes a step back",
    "r: removes the last point    x: clears the side    c: clears the collection    + / -: size",
)
HELP = (
    "left click: adds a point",
    *CHANGING_KEYS,
    "s: saves and ends    q: ends without saving    h: this help",
)
_COLOURS = dict(zip(SIDES, ((0, 0, 255), (0, 200, 0), (255, 0, 0), (0, 220, 255))))


class Outcome(NamedTuple):
    """What a key asks of the window.

    Attributes:
        save: write the file now.
        end: close the window.
        help: show which keys there are.
    """

    save: bool = False
    end: bool = False
    help: bool = False


class BorderAnnotation:
    """The points of all collections, and which side is being drawn.

    Attributes:
        lines: clicked points by collection and side.
        point_size: of the drawn points [px of the window].
    """

    def __init__(self, keys: Sequence[str], lines: Mapping[str, Lines], point_size: int = 10):
        """Begin at the first collection's top side.

        Args:
            keys: of the collections that have an image, in order; one at least.
            lines: what was drawn before; also of other collections, which stay as they are.
            point_size: at first.
        """
        self._keys = list(keys)
        self._before: List[Dict[str, Lines]] = []  # a step back each
        self.lines: Dict[str, Lines] = {}
        self.replace(lines)
        self.point_size = point_size
        self._at, self._side = 0, 0

    @property
    def collection(self) -> str:
        """The collection that is shown."""
        return self._keys[self._at]

    @property
    def side(self) -> str:
        """The side that is drawn."""
        return SIDES[self._side]

    @property
    def title(self) -> str:
        """What the window is called."""
        return f"Collection {self.collection}: {self.side} side"

    def show(self, key: str) -> None:
        """Go to a collection's top side, unless it is shown already; it must have an image."""
        if key != self.collection:
            self._at, self._side = self._keys.index(key), 0

    def draw(self, picture: np.ndarray, scale: float = 1.0) -> None:
        """Draw the points of the collection into a picture (height, width, 3) of its image.

        Args:
            picture: changed in place; blue, green, red.
            scale: of the picture to the image.
        """
        for side, points in self.lines[self.collection].items():
            pixels = [(int(round(x * scale)), int(round(y * scale))) for x, y in points]
            for begin, end in zip(pixels, pixels[1:]):
                cv2.line(picture, begin, end, _COLOURS[side], 1, cv2.LINE_AA)
            marker = cv2.MARKER_CROSS if SIDES.index(side) % 2 else cv2.MARKER_SQUARE
            for at in pixels:
                cv2.drawMarker(picture, at, _COLOURS[side], marker, self.point_size, 2)

    def replace(self, lines: Mapping[str, Lines]) -> None:
        """Draw other lines from now on, such as another program wrote; no step goes back there."""
        self.lines = {
            key: {side: list(lines.get(key, {}).get(side, [])) for side in SIDES}
            for key in dict.fromkeys([*self._keys, *lines])
        }
        self._before = []

    def click(self, x: float, y: float) -> None:
        """Add a point [px] to the side."""
        self._before.append(deepcopy(self.lines))
        self.lines[self.collection][self.side].append((float(x), float(y)))

    def press(self, key: str) -> Outcome:
        """Do what a key does; one that does nothing is no error."""
        if len(key) != 1:
            return Outcome()
        if key == "u" and self._before:
            self.lines = self._before.pop()
            return Outcome()
        before = deepcopy(self.lines)
        outcome = self._press(key)
        if self.lines != before:
            self._before.append(before)
        return outcome

    def _press(self, key: str) -> Outcome:
        drawn = self.lines[self.collection]
        if key in "np":
            self._step_side(1 if key == "n" else -1)
        elif key in ".,":
            self._step_collection(1 if key == "." else -1)
            return Outcome(save=True)
        elif key == "r":
            drawn[self.side] = drawn[self.side][:-1]
        elif key == "x":
            drawn[self.side] = []
        elif key == "c":
            self.lines[self.collection] = {side: [] for side in SIDES}
            self._side = 0
        elif key in "+-":
            self.point_size = max(1, self.point_size + (1 if key == "+" else -1))
        return Outcome(save=key == "s", end=key in "sq", help=key == "h")

    def _step_side(self, step: int) -> None:
        before, side = self.collection, self._side
        self._side += step
        if not 0 <= self._side < len(SIDES):
            self._step_collection(step)
            self._side = 0 if step > 0 else len(SIDES) - 1
        here = self.lines[self.collection]
        last = self.lines[before][SIDES[side]][-1:]
        if step > 0 and self.collection == before and not here[self.side]:
            here[self.side] = list(last)  # sides meet in a corner

    def _step_collection(self, step: int) -> None:
        self._at = (self._at + step) % len(self._keys)
        self._side = 0
