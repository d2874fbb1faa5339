"""Model errors: what all detections of a sensor or a board share, and the model takes for granted.

A LiDAR reads long, a board was printed too large, a camera's focal length is off. Each such error
is one number; rows depend on it beside their detection's pose. The derivatives by it follow from
those by the pose (`Linearisation.by_state`): a pattern that moves by v moves a row as its points do
that move by -v.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Dict, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import pixels_by_numbers
from atom_core.problem.camera_blocks import TWIST_SIZE
from atom_core.problem.residuals import (
    RangeBlock,
    ReprojectionBlock,
    ResidualBlock,
)

METRE, RADIAN, RATIO = "m", "rad", "1"
AXES = ("x", "y")
PHASES = ("sine", "cosine")
WITH_ALL = "--model_errors auto"  # estimates what no option of its own does


@dataclass(frozen=True)
class Rows:
    """The rows of one residual block at one vector.

    Attributes:
        block: whose rows.
        poses: (d, 4, 4) ``sensor_T_pattern`` of all detections.
        patterns: (d,) names of the patterns of all detections.
        residual: (n, dimension).
        by_twist: (n, dimension, 6) derivatives by the left twist of the item's pose.
    """

    block: ResidualBlock
    poses: np.ndarray
    patterns: np.ndarray
    residual: np.ndarray
    by_twist: np.ndarray

    def by_pattern_point(self, moved: np.ndarray) -> np.ndarray:
        """Return (n, dimension): the rows' change as the pattern moves by (n, 3) in its frame."""
        in_sensor = self.block.turned(moved, np.swapaxes(self.poses[:, :3, :3], 1, 2))
        return -self.by_sensor_point(in_sensor)

    def by_sensor_point(self, moved: np.ndarray) -> np.ndarray:
        """Return (n, dimension): the rows' change as the points move by (n, 3) in the sensor."""
        x, y, z = (self.by_twist[:, :, 3 + i] * moved[:, i, None] for i in range(3))
        return -(x + y + z)

    @cached_property
    def by_offset(self) -> np.ndarray:
        """(n, dimension) of range points: the rows' change as they move along their rays."""
        assert isinstance(self.block, RangeBlock)
        return self.by_sensor_point(self.block.rays)

    @cached_property
    def by_scale(self) -> np.ndarray:
        """(n, dimension) of range points: the rows' change by the scale of their distances."""
        assert isinstance(self.block, RangeBlock)
        return self.by_sensor_point(self.block.measured_points)

    def by_intrinsics(self, start: Camera) -> np.ndarray:
        """Return (n, 2, 12): the change of corners by the numbers of a camera, from `start`."""
        block, found = self.block, self._by_intrinsics
        assert isinstance(block, ReprojectionBlock)
        if id(start) not in found:
            points = block.corners_in_sensor(self.poses)
            pixels = self.residual + block.pixels
            found[id(start)] = (start, pixels_by_numbers(start, block.camera, points, pixels))
        return found[id(start)][1]

    @cached_property
    def _by_intrinsics(self) -> Dict[int, Tuple[Camera, np.ndarray]]:
        return {}

    @cached_property
    def outward(self) -> np.ndarray:
        """(n, 2) of limit points: the gradient of their distance in the pattern's plane."""
        return -self.block.turned(self.by_twist[:, 0, 3:], self.poses[:, :3, :2])

    @cached_property
    def from_behind(self) -> np.ndarray:
        """(n,) bool: items of detections whose sensor sees the back of its board."""
        along_normal = np.einsum("di,di->d", self.poses[:, :3, 2], self.poses[:, :3, 3])
        return (along_normal < 0.0)[self.block.detection]

    @cached_property
    def in_plane(self) -> np.ndarray:
        """(n, 2) range points in the pattern's plane, along its x and y [m]."""
        assert isinstance(self.block, RangeBlock)
        return self.block.in_plane(self.poses)


@dataclass(frozen=True)
class ModelError(ABC):
    """One number, zero where the model is right.

    Attributes:
        target: the sensor or the pattern.
    """

    target: str

    kind: ClassVar[str] = ""
    unit: ClassVar[str] = METRE
    step: ClassVar[float] = 0.01  # in which it counts, beside insets in steps of the sampling
    most: ClassVar[float] = 0.5  # beyond it an estimate is cut off
    usual: ClassVar[float] = 0.02  # standard deviation among real sensors and boards, in its unit
    is_scalar: ClassVar[bool] = True  # whether it is estimated beside the poses
    stands_alone: ClassVar[bool] = True  # False: one of many that are never named one by one
    is_named: ClassVar[bool] = True  # False: much like others, it is in combined sigmas alone

    @abstractmethod
    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return (n, dimension): the rows' change by the number; None where they do not depend."""

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return self.kind

    @property
    def title(self) -> str:
        """As it stands in messages."""
        return f"{self.name.replace('_', ' ')} of {self.target}"

    @property
    def option(self) -> str:
        """What estimates it, on the command line; empty: nothing does."""
        return f"--{self.kind} {self.target}"


class ErrorPrior(NamedTuple):
    """What is known of a model error beforehand, in its unit.

    Attributes:
        sigma: standard deviation.
        mean: what is expected.
    """

    sigma: float
    mean: float = 0.0


ErrorPriors = Mapping[ModelError, ErrorPrior]


@dataclass(frozen=True)
class RangeOffset(ModelError):
    """What must be added to all distances of a range sensor [m]."""

    kind = "range_offset"

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change as points move along their rays."""
        if not isinstance(rows.block, RangeBlock) or rows.block.sensor != self.target:
            return None
        return self.share(rows.block.on_own_rays)[:, None] * self.along_rays(rows)

    def along_rays(self, rows: Rows) -> np.ndarray:
        """Return (n, dimension): the rows' change by the error of each point's ray."""
        return rows.by_offset

    def share(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): the part of the value that points (n, 3) in the sensor's frame have."""
        return np.ones(len(points))


@dataclass(frozen=True)
class RangeScale(ModelError):
    """By which part all distances of a range sensor must grow."""

    kind = "range_scale"
    unit = RATIO
    usual = 0.001  # distances are counted by a quartz

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change as points move away in proportion to their distance.

        In units of the noise, which grows in the same proportion: else all ranges would be made
        small, and with them all residuals.
        """
        if not isinstance(rows.block, RangeBlock) or rows.block.sensor != self.target:
            return None
        return rows.by_scale - rows.residual / (1.0 + rows.block.range_scale[:, None])

    def share(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): the part of the value that points (n, 3) in the sensor's frame have."""
        return np.ones(len(points))


@dataclass(frozen=True)
class DepthScale(RangeScale):
    """By which part all depths of a camera must grow."""

    kind = "depth_scale"
    usual = 0.01


@dataclass(frozen=True)
class DepthOffset(RangeOffset):
    """What must be added to all depths of a camera [m]."""

    kind = "depth_offset"
    usual = 0.005

    def share(self, points: np.ndarray) -> np.ndarray:
        """Return (n,): how far points (n, 3) in the sensor's frame move for each metre of depth."""
        return np.sqrt(np.einsum("ni,ni->n", points, points)) / points[:, 2]


@dataclass(frozen=True)
class CameraError(ModelError):
    """One of a camera's numbers (`geometry/intrinsics.py`), or two that change together.

    Attributes:
        label: what it is, without whose.
        numbers: which of the twelve.
        camera: with the given intrinsics.
    """

    label: str
    numbers: Tuple[int, ...]
    camera: Camera = field(compare=False)

    kind = "intrinsics"
    unit = RATIO
    usual = 0.005

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return self.label

    @property
    def option(self) -> str:
        """What estimates it, on the command line."""
        return f"--optimize_intrinsics {self.target}"

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change by the number."""
        block = rows.block
        if not isinstance(block, ReprojectionBlock) or block.sensor != self.target:
            return None
        return rows.by_intrinsics(self.camera)[:, :, list(self.numbers)].sum(axis=2)


@dataclass(frozen=True)
class JointPositionError(ModelError):
    """What is wrong with the positions of a joint.

    It belongs to the chain, not to rows: beside the poses it is only looked for.

    Attributes:
        twists: (d, 6) how the detections' poses change in their sensors' frames.
    """

    twists: np.ndarray = field(compare=False, repr=False)

    is_scalar = False

    def derivatives(self, rows: Rows) -> Optional[np.ndarray]:
        """Return the rows' change as the joint turns or shifts."""
        twists = self.twists[rows.block.detection]
        return np.einsum("nri,ni->nr", rows.by_twist, twists)


@dataclass(frozen=True)
class JointOffset(JointPositionError):
    """What must be added to the positions of a turning joint [rad].

    It is estimated as a parameter of the joint (`joint_blocks.py`).
    """

    kind = "joint_offset"
    unit = RADIAN
    usual = 0.001

    @property
    def option(self) -> str:
        """What estimates it, on the command line."""
        return f"-jsf {self.target} -jpsf position_bias"


@dataclass(frozen=True)
class PrismaticOffset(JointOffset):
    """What must be added to the positions of a prismatic joint [m]."""

    unit = METRE
    usual = 0.001


@dataclass(frozen=True)
class EdgeOffset(JointOffset):
    """That of a turning joint of which only transforms tell [rad]: nothing estimates it."""

    option = ""


@dataclass(frozen=True)
class PrismaticEdgeOffset(PrismaticOffset):
    """Likewise, of a prismatic one [m]."""

    option = ""


@dataclass(frozen=True)
class JointScale(JointPositionError):
    """By which part a joint moves more than its positions say: a gear's or an encoder's ratio."""

    kind = "joint_scale"
    unit = RATIO
    usual = 0.0005
    option = ""


@dataclass(frozen=True)
class JointWave(JointPositionError):
    """What must be added to a turning joint's positions, times their sine or cosine [rad].

    An arm that bends under its weight, or an encoder off the centre of its axis.

    Attributes:
        phase: 0 with the sine, 1 with the cosine.
    """

    phase: int

    kind = "joint_wave"
    unit = RADIAN
    usual = 0.0005
    option = ""

    @property
    def name(self) -> str:
        """What it is, without whose."""
        return f"joint wave with the {PHASES[self.phase]}"


@dataclass(frozen=True)
class JointTilt(JointPositionError):
    """How far a joint's axis is turned from its description, about an axis across it [rad].

    It is like an offset of a neighbour that turns about nearly the same line, and not named.

    Attributes:
        across: 0 or 1, which of two axes.
    """

    across: int

    kind = "joint_tilt"
    unit = RADIAN
    usual = 0.0005
    option = ""
    is_named = False


@dataclass(frozen=True)
class JointShift(JointPositionError):
    """How far a joint's axis is beside its description, across itself [m]: a link's length.

    Along the axis it is the next joint's shift, or what is mounted there. It is like an offset of
    a neighbour, and not named.

    Attributes:
        across: 0 or 1, along which of two axes.
    """

    across: int

    kind = "joint_shift"
    unit = METRE
    usual = 0.0005
    option = ""
    is_named = False


@dataclass(frozen=True)
class TurnTrend(JointPositionError):
    """How far a moving part is turned [rad], in proportion to one of its coordinates.

    It is like errors of sensors and boards, which do the same, and not named.

    Attributes:
        coordinate: three turns and three places of the part in its parent.
        axis: of the parent, about which it is turned.
    """

    coordinate: int
    axis: int

    kind = "turn_trend"
    unit = RADIAN
    usual = 0.0002  # there are three of each axis
    option = ""
    is_named = False


@dataclass(frozen=True)
class ShiftTrend(TurnTrend):
    """Likewise, how far it is beside its place along an axis [m]."""

    kind = "shift_trend"
    unit = METRE


def rows_of(
    block: ResidualBlock,
    poses: np.ndarray,
    patterns: np.ndarray,
    residual: np.ndarray,
    by_state: np.ndarray,
) -> Rows:
    """Return the rows of a block.

    Args:
        block: whose rows.
        poses: (d, 4, 4) of the detections.
        patterns: (d,) names of the detections' patterns.
        residual: (n, dimension).
        by_state: (n, dimension, 6 or 18), see ``Linearisation``.
    """
    return Rows(block, poses, patterns, residual, by_state[:, :, :TWIST_SIZE])
