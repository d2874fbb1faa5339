"""Picking the points of a board's border in clouds, side by side; without a window.

Points are in the plane of the board [m]. The keys are those of ATOM's tool.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.editing.border_annotation import Outcome
from atom_core.io.annotations import SIDES
from atom_core.io.lidar_annotations import PickedSides

Point = Tuple[float, float]

HELP = (
    "t / r / b / l: top, right, bottom, left side    left click: picks the nearest point",
    "right click, u: gives the last point back    x: clears the side    c: clears the collection",
    ". / ,: next / previous collection    + / -: size    s, q: saves and ends    h: this help",
)
_REACH_M = 0.03  # a click farther from every point picks none


class Face(NamedTuple):
    """The points of one collection that can be picked.

    Attributes:
        lidar_T_plane: (4, 4) the board's plane.
        points: (n, 2) in the plane [m].
    """

    lidar_T_plane: np.ndarray
    points: np.ndarray


class PickedBorder:
    """The picked points of all collections, and which side is being picked.

    Attributes:
        point_size: of the drawn points [px of the window].
    """

    def __init__(
        self, faces: Mapping[str, Face], before: Mapping[str, PickedSides], point_size: int = 3
    ):
        """Begin at the first collection's top side.

        Args:
            faces: by collection; one at least.
            before: what was picked before; points of another plane are laid on this one.
            point_size: at first.
        """
        self._faces, self._keys = dict(faces), list(faces)
        self._others = {key: picked for key, picked in before.items() if key not in faces}
        self._picked: Dict[str, Dict[str, List[Point]]] = {}
        for key, face in self._faces.items():
            old = before.get(key)
            sides = {side: _moved(old, side, face) if old else [] for side in SIDES}
            self._picked[key] = sides
        self.point_size = point_size
        self._at, self._side = 0, SIDES[0]

    @property
    def collection(self) -> str:
        """The collection that is shown."""
        return self._keys[self._at]

    @property
    def face(self) -> Face:
        """What can be picked in it."""
        return self._faces[self.collection]

    @property
    def picked(self) -> Mapping[str, Sequence[Point]]:
        """What is picked in it, by side."""
        return self._picked[self.collection]

    @property
    def title(self) -> str:
        """What the window is called."""
        return f"Collection {self.collection}: {self._side} side"

    @property
    def result(self) -> Dict[str, PickedSides]:
        """What is picked in all collections, those of an earlier run included."""
        now = {
            key: PickedSides(self._faces[key].lidar_T_plane, sides)
            for key, sides in self._picked.items()
            if any(sides.values())
        }
        return {**self._others, **now}

    def click(self, x: float, y: float) -> None:
        """Pick the point that is nearest to a place in the plane [m]; none if all are far."""
        points = self.face.points
        if len(points) == 0:
            return
        distances = np.hypot(points[:, 0] - x, points[:, 1] - y)
        nearest = int(np.argmin(distances))
        point = (float(points[nearest, 0]), float(points[nearest, 1]))
        chosen = self._picked[self.collection][self._side]
        if distances[nearest] <= _REACH_M and point not in chosen:
            chosen.append(point)

    def undo(self) -> None:
        """Give the last point of the side back."""
        self._picked[self.collection][self._side][-1:] = []

    def press(self, key: str) -> Outcome:
        """Do what a key does; one that does nothing is no error."""
        sides = {side[0]: side for side in SIDES}
        if len(key) != 1:
            return Outcome()
        if key in sides:
            self._side = sides[key]
        elif key in ".,":
            self._at = (self._at + (1 if key == "." else -1)) % len(self._keys)
            self._side = SIDES[0]
            return Outcome(save=True)
        elif key == "u":
            self.undo()
        elif key == "x":
            self._picked[self.collection][self._side] = []
        elif key == "c":
            self._picked[self.collection] = {side: [] for side in SIDES}
        elif key in "+-":
            self.point_size = max(1, self.point_size + (1 if key == "+" else -1))
        return Outcome(save=key in "sq", end=key in "sq", help=key == "h")


def _moved(old: PickedSides, side: str, face: Face) -> List[Point]:
    """Return points that were picked in another plane, in this one."""
    points = np.array(old.sides.get(side, ()), dtype=float).reshape(-1, 2)
    plane_T_old = np.linalg.inv(face.lidar_T_plane) @ old.lidar_T_plane
    flat = points @ plane_T_old[:2, :2].T + plane_T_old[:2, 3]
    return [(float(x), float(y)) for x, y in flat]
