"""Errors of boards: of another size, of another shape, bent, thick, their print elsewhere."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Callable, ClassVar, Optional, Tuple

import numpy as np

from atom_core.geometry.rectangle import Rectangle
from atom_core.problem.model_errors import AXES, RADIAN, RATIO, WITH_ALL, ModelError, Rows
from atom_core.problem.residuals import BorderBlock, OrthogonalBlock, ReprojectionBlock


@dataclass(frozen=True)
class BoardError(ModelError):
    """An error of a board, seen by all sensors."""

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change; zero for those of other patterns."""
        mine = rows.patterns == self.target
        change = self._of_block(rows) if np.any(mine) else None
        if change is None or np.all(mine):
            return change
        return change * mine[rows.block.detection, None]

    @abstractmethod
    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        """Return (n, dimension), as if all rows were of this board."""


@dataclass(frozen=True)
class BoardSize(BoardError):
    """By which part a board, its squares and its border, is larger than described."""

    kind = "board_size"
    unit = RATIO
    usual = 0.002

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        block = rows.block
        if isinstance(block, ReprojectionBlock):
            return rows.by_pattern_point(block.corners_in_pattern)
        if isinstance(block, BorderBlock):
            return rows.by_pattern_point(_flat(block.centre)) + _grown(rows, block.half_size)
        return None


@dataclass(frozen=True)
class BoardAspect(BoardError):
    """By which part a board's print is longer in x, and shorter in y, than described."""

    kind = "board_aspect"
    unit = RATIO
    usual = 0.001
    option = WITH_ALL

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        if not isinstance(rows.block, ReprojectionBlock):
            return None
        return rows.by_pattern_point(rows.block.corners_in_pattern * [1.0, -1.0, 0.0])


@dataclass(frozen=True)
class PrintTurn(BoardError):
    """By which angle a board's print is turned on its plate, about the middle of its border [rad].

    Attributes:
        middle_x, middle_y: that middle, in the pattern's plane [m].
    """

    middle_x: float
    middle_y: float

    kind = "print_turn"
    unit = RADIAN
    usual = 0.003  # 2 mm along the side of a plate of 0.7 m
    option = WITH_ALL

    @classmethod
    def of_board(cls, target: str, border: Rectangle) -> PrintTurn:
        """Return that of a board."""
        return cls(target, *(float(value) for value in border.centre))

    def turned(self, in_plane: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Return points (n, 2) of the pattern's plane, turned by angles (n,) about the middle."""
        middle = np.array([self.middle_x, self.middle_y])
        x, y = (in_plane - middle).T
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.column_stack([cosine * x - sine * y, sine * x + cosine * y]) + middle

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        if not isinstance(rows.block, ReprojectionBlock):
            return None
        x, y = (rows.block.corners_in_pattern[:, :2] - [self.middle_x, self.middle_y]).T
        return rows.by_pattern_point(np.column_stack([-y, x, np.zeros(len(x))]))


@dataclass(frozen=True)
class AlongAxis(BoardError):
    """An error of a board along one of its axes.

    Attributes:
        axis: 0 for x, 1 for y.
    """

    axis: int

    kind = "board_border"
    usual = 0.003
    what: ClassVar[str] = ""

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"{self.what}_{AXES[self.axis]}"


@dataclass(frozen=True)
class BorderShift(AlongAxis):
    """How far a board's border lies beside where it is described, seen from its print [m]."""

    what = "border_shift"

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        if not isinstance(rows.block, BorderBlock):
            return None
        return -rows.outward[:, self.axis, None]


@dataclass(frozen=True)
class BorderSize(AlongAxis):
    """How much half the border is longer than described, while the print is right [m]."""

    what = "border_half_size"

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        return _longer_border(rows, self.axis)


@dataclass(frozen=True)
class SeenBorder(ModelError):
    """How much longer half the border is for one sensor: what its labels add or leave out [m].

    It is free in tests of other errors, and never estimated.

    Attributes:
        axis: 0 for x, 1 for y.
    """

    axis: int

    kind = "seen_border"
    is_scalar = False

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change; None of other sensors."""
        return _longer_border(rows, self.axis) if rows.block.sensor == self.target else None


@dataclass(frozen=True)
class Bend(AlongAxis):
    """By how much a board's two edges across an axis lie above its middle, in the pattern's z [m].

    The surface is a parabola over the axis, from the middle of the border to its edges.
    """

    middle: float
    half_m: float

    kind = "board_bend"
    what = "bend"
    step = 0.001
    usual = 0.002

    @classmethod
    def of_board(cls, target: str, border: Rectangle) -> Tuple[Bend, ...]:
        """Return the bends of a board along its two axes."""
        ends = zip(range(len(AXES)), border.centre, border.half_size)
        return tuple(cls(target, axis, float(middle), float(half)) for axis, middle, half in ends)

    def height(self, in_pattern: np.ndarray) -> np.ndarray:
        """Return (n,): the height of the surface at points (n, 2 or 3), at a bend of one."""
        return ((in_pattern[:, self.axis] - self.middle) / self.half_m) ** 2

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        return _on_surface(rows, self.height)


@dataclass(frozen=True)
class BoardTwist(BoardError):
    """By how much two opposite corners of a board lie above its middle, two below, in its z [m].

    Attributes:
        middle_x, middle_y: middle of the border, in the pattern's plane [m].
        half_x, half_y: half its sides [m].
    """

    middle_x: float
    middle_y: float
    half_x: float
    half_y: float

    kind = "board_twist"
    step = 0.001
    usual = 0.002
    option = WITH_ALL

    @classmethod
    def of_board(cls, target: str, border: Rectangle) -> BoardTwist:
        """Return the twist of a board."""
        return cls(target, *border.centre.tolist(), *border.half_size.tolist())

    def height(self, in_pattern: np.ndarray) -> np.ndarray:
        """Return (n,): the height of the surface at points (n, 2 or 3), at a twist of one."""
        x, y = in_pattern[:, 0] - self.middle_x, in_pattern[:, 1] - self.middle_y
        return x * y / (self.half_x * self.half_y)

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        return _on_surface(rows, self.height)


@dataclass(frozen=True)
class BoardThickness(BoardError):
    """How far a board's back lies behind its print, in the pattern's z [m].

    The board's frame is that of its print, which range sensors on the other side do not see.
    """

    kind = "board_thickness"
    step = 0.001
    usual = 0.01

    def height(self, rows: Rows) -> np.ndarray:
        """Return (n,): the height of what is seen, at a thickness of one."""
        return rows.from_behind.astype(float)

    def _of_block(self, rows: Rows) -> Optional[np.ndarray]:
        if not isinstance(rows.block, OrthogonalBlock) or not np.any(rows.from_behind):
            return None
        return _raised(rows, self.height(rows))


# what a board is beside its plane
SURFACES = (Bend, BoardTwist)


def _on_surface(rows: Rows, height: Callable[[np.ndarray], np.ndarray]) -> Optional[np.ndarray]:
    """Return the rows' change as a board rises by a height (n,) at places (n, 2 or 3) on it."""
    if isinstance(rows.block, ReprojectionBlock):
        return _raised(rows, height(rows.block.corners_in_pattern))
    if isinstance(rows.block, OrthogonalBlock):
        return _raised(rows, height(rows.in_plane))
    return None


def _raised(rows: Rows, height: np.ndarray) -> np.ndarray:
    """Return the rows' change as what they see of a board rises by a height (n,)."""
    above = np.zeros((rows.block.count, 3))
    above[:, 2] = height
    return rows.by_pattern_point(above)


def _flat(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def _longer_border(rows: Rows, axis: int) -> Optional[np.ndarray]:
    """Return (n, 1): the change of distances as half the border grows along an axis."""
    if not isinstance(rows.block, BorderBlock):
        return None
    return -np.abs(rows.outward[:, axis, None])


def _grown(rows: Rows, half_size: np.ndarray) -> np.ndarray:
    """Return (n, 1): the change of distances as half sides grow by (n, 2)."""
    return -np.sum(np.abs(rows.outward) * half_size, axis=1, keepdims=True)
