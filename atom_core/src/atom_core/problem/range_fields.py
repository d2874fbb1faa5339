"""Errors of range sensors that differ from ray to ray: layers of a LiDAR, waves in a depth image.

They are many small numbers, each held near zero by what is usual, and never named one by one.
Which of them a ray has depends on its direction alone, so that corrected points keep theirs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, List, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.problem.model_errors import (
    RATIO,
    WITH_ALL,
    DepthScale,
    ModelError,
    RangeOffset,
    Rows,
)
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import RangeBlock

_GAP_RAD = float(np.radians(0.1))  # layers of a LiDAR are farther apart
_APART = 4.0  # times the scatter of a layer's elevations
_MOST_LAYERS = 128
_CYCLES = 5.0  # of the shortest waves that are told, over the width of a depth image
_ACROSS = 64  # cells over the width of a depth image


@dataclass(frozen=True)
class LayerOffset(RangeOffset):
    """What must be added to the distances of one layer of a LiDAR, beside its range offset [m].

    Attributes:
        low_rad, high_rad: elevations about the z axis of the sensor's frame between which it lies.
    """

    low_rad: float
    high_rad: float

    kind: ClassVar[str] = "layer_offset"
    usual = 0.005
    stands_alone = False

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"{self.kind}_{self.elevation_deg:.1f}_deg"

    @property
    def elevation_deg(self) -> float:
        """Where the layer lies."""
        return float(np.degrees((self.low_rad + self.high_rad) / 2.0))

    def share(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): one for points (n, 3) of the layer, zero for the others."""
        elevation = elevations(points)
        return ((elevation >= self.low_rad) & (elevation < self.high_rad)).astype(float)


@dataclass(frozen=True)
class DepthWave(DepthScale):
    """By which part depths must grow at the crests of a wave across the image.

    Attributes:
        half_waves: (x, y) how many there are over the width and over the height.
        camera: whose image.
    """

    half_waves: Tuple[int, int]
    camera: Camera = field(compare=False)

    kind: ClassVar[str] = "depth_wave"
    usual = 0.001  # some sixty of them make 0.4 % of the depth
    stands_alone = False

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"{self.kind}_{self.half_waves[0]}_{self.half_waves[1]}"

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change as points move away in proportion to distance and height."""
        if not isinstance(rows.block, RangeBlock) or rows.block.sensor != self.target:
            return None
        return self.share(rows.block.on_own_rays)[:, None] * self.along_rays(rows)

    def along_rays(self, rows: Rows) -> np.ndarray:
        """Return (n, dimension): the rows' change by the error of each point's ray."""
        return rows.by_scale

    def share(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): the height of the wave, -1 to 1, at points (n, 3)."""
        return self.height(*(self.across(points, axis) for axis in range(2)))

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return (n,): the height of the wave, -1 to 1, at places from 0 to 1 across the image."""
        along = [
            np.cos(np.pi * count * place)
            for count, place in zip(self.half_waves, (x, y))
            if count > 0
        ]
        return along[0] if len(along) == 1 else along[0] * along[1]

    def across(self, points: np.ndarray, axis: int) -> np.ndarray:
        """Return (n,): where points (n, 3) lie across the image, from 0 to 1."""
        camera = self.camera
        pixel = camera.focal_px[axis] * (points[:, axis] / points[:, 2]) + camera.centre_px[axis]
        return (pixel + 0.5) / (camera.width, camera.height)[axis]


RayError = Union[LayerOffset, DepthWave]


@dataclass(frozen=True)
class DepthWaves(ModelError):
    """All waves across a camera's image, as a standard deviation: found, not estimated as one."""

    kind: ClassVar[str] = "depth_waves"
    is_scalar = False
    unit = RATIO
    usual = 0.004
    option = WITH_ALL

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return None: what rows depend on are the single waves."""
        return None


@dataclass(frozen=True)
class LayerOffsets(ModelError):
    """By how much a LiDAR's layers differ (RMS) [m]: found, not estimated as one."""

    kind: ClassVar[str] = "layer_offsets"
    is_scalar = False
    usual = 0.005
    option = WITH_ALL

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return None: what rows depend on are the single layers."""
        return None


class RangeField(ABC):
    """The errors of one sensor that differ from ray to ray, its rays taken in cells."""

    def __init__(self, errors: Sequence[RayError], shares: np.ndarray):
        """Take (k,) errors of one sensor, and (cells, k) the parts of them that the cells have."""
        self.errors, self.shares = tuple(errors), shares

    @property
    def sensor(self) -> str:
        """Whose rays."""
        return self.errors[0].target

    @property
    def kind(self) -> str:
        """Of which sort its errors are."""
        return self.errors[0].kind

    @abstractmethod
    def cells(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): which cell points (n, 3) in the sensor's frame are in."""


class LayerField(RangeField):
    """The layers of a LiDAR, each a cell."""

    def __init__(self, layers: Sequence[LayerOffset]):
        """Take the layers, the lowest first."""
        super().__init__(layers, np.eye(len(layers)))
        self._lowest = np.array([layer.low_rad for layer in layers])

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): which layer points (n, 3) in the sensor's frame are in."""
        layer = np.searchsorted(self._lowest, elevations(points), side="right") - 1
        return np.maximum(layer, 0)


class WaveField(RangeField):
    """The waves across a depth image, which is cut into cells far smaller than any of them."""

    def __init__(self, waves: Sequence[DepthWave]):
        """Take the waves of one camera."""
        self._any, camera = waves[0], waves[0].camera
        self._counts = _ACROSS, max(round(_ACROSS * camera.height / camera.width), 1)
        middles = [(np.arange(count) + 0.5) / count for count in self._counts]
        along = [
            {n: np.cos(np.pi * n * middle) for n in {wave.half_waves[axis] for wave in waves}}
            for axis, middle in enumerate(middles)
        ]
        heights = [np.outer(along[1][y], along[0][x]) for x, y in (w.half_waves for w in waves)]
        super().__init__(waves, np.column_stack([height.ravel() for height in heights]))

    def cells(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): which cell of the image points (n, 3) in the camera's frame are in."""
        x, y = (
            np.clip((count * self._any.across(points, axis)).astype(int), 0, count - 1)
            for axis, count in enumerate(self._counts)
        )
        return y * _ACROSS + x


def layer_offsets(problem: Problem, sensor: str) -> List[LayerOffset]:
    """Return the offsets of a LiDAR's layers; none where its points are not in layers."""
    points = [
        block.on_own_rays
        for block in problem.residual_blocks
        if isinstance(block, RangeBlock) and block.sensor == sensor
    ]
    ordered = np.sort(elevations(np.concatenate(points)))
    gaps = np.diff(ordered)
    last = np.flatnonzero(gaps > _GAP_RAD)
    if not 0 < len(last) < _MOST_LAYERS:
        return []
    layers = np.split(ordered, last + 1)
    scatter = np.concatenate([layer - layer.mean() for layer in layers])
    if np.median(gaps[last]) < _APART * np.std(scatter):
        return []
    beside = _GAP_RAD / 2.0
    return [
        LayerOffset(sensor, float(layer[0]) - beside, float(layer[-1]) + beside) for layer in layers
    ]


def depth_waves(sensor: str, camera: Camera) -> List[DepthWave]:
    """Return the waves across a camera's depth image, from long ones to the shortest told."""
    most = int(2.0 * _CYCLES)
    found = []
    for x in range(most + 1):
        for y in range(most + 1):
            across = np.hypot(x, y * camera.width / camera.height) / 2.0
            if 0.0 < across <= _CYCLES:
                found.append(DepthWave(sensor, (x, y), camera))
    return found


def elevations(points: np.ndarray) -> np.ndarray:
    """Return (n,) angles of points (n, 3) above the plane across the z axis [rad]."""
    return np.arctan2(points[:, 2].astype(float), np.hypot(points[:, 0], points[:, 1]))
