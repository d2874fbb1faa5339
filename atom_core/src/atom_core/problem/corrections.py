"""A problem corrected by model errors: its points, corners, borders and cameras as they then are.

What a block was corrected by before is taken back first, so that any values can follow any others.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, Mapping, Optional, Tuple, Type, TypeVar, Union

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, moved_camera
from atom_core.problem.board_errors import (
    SURFACES,
    AlongAxis,
    Bend,
    BoardAspect,
    BoardError,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    BorderSize,
    PrintTurn,
)
from atom_core.problem.direction_errors import DirectionError
from atom_core.problem.model_errors import (
    CameraError,
    ModelError,
    RangeOffset,
    RangeScale,
    Rows,
    rows_of,
)
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import (
    BorderBlock,
    OrthogonalBlock,
    RangeBlock,
    ReprojectionBlock,
    ResidualBlock,
)

Values = Mapping[ModelError, float]
_Error = TypeVar("_Error", bound=ModelError)
_OfRange = TypeVar("_OfRange", RangeOffset, RangeScale)


def corrected(problem: Problem, values: Values, x: np.ndarray) -> Problem:
    """Return the problem with its rows corrected by these values instead of those before.

    Args:
        problem: any.
        values: of the model errors, in their units; those that are not named are zero.
        x: the vector; where points lie on bent boards is taken from it.
    """
    patterns, poses = problem.patterns, problem.poses(x)
    blocks = []
    for block in problem.residual_blocks:
        before, after = (
            _Correction(of_all, block.sensor, patterns[block.detection])
            for of_all in (problem.model_errors, values)
        )
        if isinstance(block, ReprojectionBlock):
            block = _corrected_corners(block, before, after)
        elif isinstance(block, RangeBlock):
            seen, turned = block.on_own_rays, after.turned(block)
            offset_m, scale = after.of_points(RangeOffset, seen), after.of_points(RangeScale, seen)
            block = block.with_range_errors(offset_m, scale, turned)
        if isinstance(block, BorderBlock):
            block = _corrected_border(block, before, after)
        elif isinstance(block, OrthogonalBlock):
            block = _on_surface(block, after, poses, patterns)
        blocks.append(block)
    return replace(problem, residual_blocks=tuple(blocks), model_errors=dict(values))


def corrected_cameras(problem: Problem) -> Dict[str, Camera]:
    """Return the cameras, by sensor, that model errors have moved."""
    moved = {error.target for error in problem.model_errors if isinstance(error, CameraError)}
    return {
        block.sensor: block.camera
        for block in problem.residual_blocks
        if isinstance(block, ReprojectionBlock) and block.sensor in moved
    }


class _Correction:
    """The values that concern one block."""

    def __init__(self, values: Values, sensor: str, patterns: np.ndarray):
        self._sensor, self._patterns = sensor, patterns
        self._values = {
            error: value
            for error, value in values.items()
            if error.target == sensor or isinstance(error, BoardError)
        }

    def of_points(self, kind: Type[_OfRange], points: np.ndarray) -> np.ndarray:
        """Return (n,) of points (n, 3): the values of one kind of error of the block's sensor."""
        result = np.zeros(len(points))
        for error, value in self.of_kind(kind).items():
            if error.target == self._sensor and value != 0.0:
                result += value * error.share(points)
        return result

    def turned(self, block: RangeBlock) -> Optional[np.ndarray]:
        """Return (n, 3) measured points in their right directions [m]; None: no error has them."""
        errors = {e: v for e, v in self._values.items() if isinstance(e, DirectionError)}
        if not any(errors.values()):
            return None
        points = block.measured_points.astype(float)
        for error, value in errors.items():
            points = error.directed(points, value)
        return points

    def of_kind(self, kind: Type[_Error]) -> Dict[_Error, float]:
        """Return the values of a kind."""
        return {e: v for e, v in self._values.items() if isinstance(e, kind)}

    def per_item(self, error: ModelError, value: float) -> np.ndarray:
        """Return (n,): the value where an item's board is the error's, zero elsewhere."""
        return np.where(self._patterns == error.target, value, 0.0)

    @property
    def size(self) -> np.ndarray:
        """(n, 1) factor on what stands on the boards."""
        grown = np.ones(len(self._patterns))
        for error, value in self.of_kind(BoardSize).items():
            grown = grown + self.per_item(error, value)
        return grown[:, None]

    def along_axes(self, kind: Type[AlongAxis]) -> np.ndarray:
        """Return (n, 2) of a kind that has a value for each axis."""
        result = np.zeros((len(self._patterns), 2))
        for error, value in self.of_kind(kind).items():
            result[:, error.axis] += self.per_item(error, value)
        return result

    @property
    def print_size(self) -> np.ndarray:
        """(n, 2) factors on what is printed, along x and y."""
        longer = np.zeros(len(self._patterns))
        for error, value in self.of_kind(BoardAspect).items():
            longer += self.per_item(error, value)
        return self.size * np.column_stack([1.0 + longer, 1.0 - longer])

    def print_turned(self, in_plane: np.ndarray, way: float = 1.0) -> np.ndarray:
        """Return points (n, 2) of the print as it stands on its plate; with -1 the way back."""
        for error, value in self.of_kind(PrintTurn).items():
            in_plane = error.turned(in_plane, way * self.per_item(error, value))
        return in_plane

    def surface_m(self, in_pattern: np.ndarray) -> np.ndarray:
        """Return (n,): how high the bent boards are at points (n, 2 or 3) [m]."""
        height = np.zeros(len(self._patterns))
        surfaces: List[Tuple[Union[Bend, BoardTwist], float]] = [*self.of_kind(Bend).items()]
        surfaces += self.of_kind(BoardTwist).items()
        for error, value in surfaces:
            height += self.per_item(error, value) * error.height(in_pattern)
        return height

    def back_m(self, rows: Rows) -> np.ndarray:
        """Return (n,): how far boards that are seen from behind lie behind their print [m]."""
        height = np.zeros(len(self._patterns))
        for error, value in self.of_kind(BoardThickness).items():
            height += self.per_item(error, value) * error.height(rows)
        return height

    @property
    def numbers(self) -> np.ndarray:
        """(12,) by which the block's camera is moved."""
        result = np.zeros(COUNT)
        for error, value in self.of_kind(CameraError).items():
            result[list(error.numbers)] += value
        return result


def _corrected_corners(
    block: ReprojectionBlock, before: _Correction, after: _Correction
) -> ReprojectionBlock:
    flat = before.print_turned(block.corners_in_pattern[:, :2], -1.0) / before.print_size
    level = block.corners_in_pattern[:, 2] - before.surface_m(flat)
    corners = np.concatenate(
        [after.print_turned(after.print_size * flat), (level + after.surface_m(flat))[:, None]],
        axis=1,
    )
    errors: List[CameraError] = [*before.of_kind(CameraError), *after.of_kind(CameraError)]
    camera = moved_camera(errors[0].camera, after.numbers) if errors else block.camera
    return replace(block, corners_in_pattern=corners, camera=camera)


def _corrected_border(block: BorderBlock, before: _Correction, after: _Correction) -> BorderBlock:
    centre = (block.centre - before.along_axes(BorderShift)) / before.size
    half_size = (block.half_size - before.along_axes(BorderSize)) / before.size
    return replace(
        block,
        centre=after.size * centre + after.along_axes(BorderShift),
        half_size=after.size * half_size + after.along_axes(BorderSize),
    )


def _on_surface(
    block: OrthogonalBlock, after: _Correction, poses: np.ndarray, patterns: np.ndarray
) -> ResidualBlock:
    if not any(after.of_kind(kind) for kind in (*SURFACES, BoardThickness)):
        return block if block.surface_m is None else replace(block, surface_m=None)
    rows = rows_of(block, poses, patterns, *block.linearise(poses))
    return replace(block, surface_m=after.surface_m(rows.in_plane) + after.back_m(rows))
