"""The systematic errors that one simulated rig has: what `Realism` made of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any, Dict, Mapping, Tuple

import numpy as np

from atom_core.geometry.rectangle import Rectangle
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import BentPattern
from atom_core.synthetic.realism import Realism

Sides = Tuple[float, float, float, float]  # left, right, top, bottom


@dataclass(frozen=True)
class SensorErrors:
    """Errors of a sensor; each modality has its own kind, this one has none."""

    def true_sensor(self, sensor: Sensor) -> Sensor:
        """Return the sensor as it is, given as the configuration has it."""
        return sensor


@dataclass(frozen=True)
class CameraErrors(SensorErrors):
    """Errors of a colour camera.

    Attributes:
        focal_scale: (x, y) share by which the true focal lengths are longer.
        centre_px: (x, y) true centre minus that of the intrinsics.
        blur_px, vignetting, exposure_step: of its pictures, see `Realism`. The corners of
            synthetic scenes are not found in pictures, and these do nothing to them: in rendered
            boards 0.7 px of blur and 0.3 of vignetting move no corner by more than noise does,
            and lose one in a hundred.
    """

    focal_scale: Tuple[float, float] = (0.0, 0.0)
    centre_px: Tuple[float, float] = (0.0, 0.0)
    blur_px: float = 0.0
    vignetting: float = 0.0
    exposure_step: float = 0.0

    @classmethod
    def drawn(cls, realism: Realism, sensor: Sensor, rng: np.random.Generator) -> CameraErrors:
        """Draw the errors of a camera."""
        focal = realism.focal_scale + realism.focal_sigma * rng.standard_normal(2)
        off = realism.centre_sigma * rng.standard_normal(2)
        assert sensor.camera is not None
        size = (sensor.camera.width, sensor.camera.height)
        return cls(
            (float(focal[0]), float(focal[1])),
            (float(off[0] * size[0]), float(off[1] * size[1])),
            realism.blur_px,
            realism.vignetting,
            realism.exposure_step,
        )

    def true_sensor(self, sensor: Sensor) -> Sensor:
        """Return the camera with its true intrinsics."""
        assert sensor.camera is not None
        K = sensor.camera.K.copy()
        K[[0, 1], [0, 1]] *= 1.0 + np.array(self.focal_scale)
        K[:2, 2] += self.centre_px
        return replace(sensor, camera=replace(sensor.camera, K=K))


@dataclass(frozen=True)
class DepthErrors(SensorErrors):
    """Errors of a depth camera.

    Attributes:
        scale: share of z by which it reads far.
        wave_m, wave_share: amplitude of the waves, constant and as a share of z.
        wave_per_px: (x, y) change of their phase from a pixel to the next [rad].
        wave_phase_rad: their phase at pixel (0, 0).
        halo_px: pixels as near to a jump of the depth have none.
    """

    scale: float = 0.0
    wave_m: float = 0.0
    wave_share: float = 0.0
    wave_per_px: Tuple[float, float] = (0.0, 0.0)
    wave_phase_rad: float = 0.0
    halo_px: int = 0

    @classmethod
    def drawn(cls, realism: Realism, sensor: Sensor, rng: np.random.Generator) -> DepthErrors:
        """Draw the errors of a depth camera."""
        scale = realism.depth_scale + realism.depth_scale_sigma * rng.standard_normal()
        assert sensor.camera is not None
        length_px = sensor.camera.width * rng.uniform(0.25, 0.5)
        direction, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        per_px = 2.0 * np.pi / length_px * np.array([np.cos(direction), np.sin(direction)])
        return cls(
            float(scale),
            realism.depth_wave_m,
            realism.depth_wave_share,
            (float(per_px[0]), float(per_px[1])),
            float(phase),
            realism.depth_halo_px,
        )

    def error_m(self, z_m: np.ndarray) -> np.ndarray:
        """Return by how much a depth image reads far (height, width), of its true depths [m]."""
        row, column = np.mgrid[0 : z_m.shape[0], 0 : z_m.shape[1]]
        phase = self.wave_phase_rad + self.wave_per_px[0] * column + self.wave_per_px[1] * row
        return self.scale * z_m + (self.wave_m + self.wave_share * z_m) * np.sin(phase)


@dataclass(frozen=True)
class RangeErrors(SensorErrors):
    """Errors of a LiDAR.

    Attributes:
        offset_m, scale: it reads long by ``offset_m + scale * range``.
        ring_offsets_m: (rings,) by which its layers read long beside that.
        dark_offset_m, dark_lost: dark squares read longer, and so many of their returns are lost.
        divergence_rad: full angle of its beams.
    """

    offset_m: float = 0.0
    scale: float = 0.0
    ring_offsets_m: Tuple[float, ...] = ()
    dark_offset_m: float = 0.0
    dark_lost: float = 0.0
    divergence_rad: float = 0.0

    @classmethod
    def drawn(cls, realism: Realism, rings: int, rng: np.random.Generator) -> RangeErrors:
        """Draw the errors of a LiDAR with so many layers; 0: layers have no offsets."""
        offset, scale = rng.standard_normal(2)
        return cls(
            float(realism.lidar_offset_m + realism.lidar_offset_sigma_m * offset),
            float(realism.lidar_scale + realism.lidar_scale_sigma * scale),
            tuple((realism.ring_offset_sigma_m * rng.standard_normal(rings)).tolist()),
            realism.dark_offset_m,
            realism.dark_lost,
            realism.beam_divergence_rad,
        )

    def error_m(self, ranges_m: np.ndarray, rings: np.ndarray) -> np.ndarray:
        """Return by how much returns (n,) read long, of their true ranges and layers (n,) [m]."""
        error = self.offset_m + self.scale * ranges_m
        return error + np.array(self.ring_offsets_m)[rings] if self.ring_offsets_m else error


def _four(factor: float, sides: Sides) -> Sides:
    left, right, top, bottom = sides
    return (factor * left, factor * right, factor * top, factor * bottom)


@dataclass(frozen=True)
class BoardErrors:
    """Errors of a board.

    Attributes:
        scale: share by which it is larger, print and plate.
        shift_m: (x, y) by which the print is off its place on the plate.
        bend_m: sagitta over its width; positive: the sides lie deeper than the middle.
        thickness_m: how far its back lies behind its print.
    """

    scale: float = 0.0
    shift_m: Tuple[float, float] = (0.0, 0.0)
    bend_m: float = 0.0
    thickness_m: float = 0.0

    @classmethod
    def drawn(cls, realism: Realism, rng: np.random.Generator) -> BoardErrors:
        """Draw the errors of a board."""
        scale = realism.board_scale + realism.board_scale_sigma * rng.standard_normal()
        return cls(float(scale), realism.print_shift_m, realism.bend_m, realism.thickness_m)

    def true_config(self, config: PatternConfig) -> PatternConfig:
        """Return the configuration of the board as it is, but for shift and bend."""
        larger, (x, y) = 1.0 + self.scale, config.border_size
        inner_size = None if config.inner_size is None else larger * config.inner_size
        return replace(
            config,
            size=larger * config.size,
            border_size=(larger * x, larger * y),
            border=None if config.border is None else _four(larger, config.border),
            inner_size=inner_size,
        )

    def true_pattern(self, name: str, config: PatternConfig) -> Pattern:
        """Return the board as it is, given as the configuration has it."""
        pattern = pattern_from_config(name, self.true_config(config))
        if self.shift_m != (0.0, 0.0):
            (x, y), border = self.shift_m, pattern.border
            moved = Rectangle(
                border.x_min - x, border.y_min - y, border.x_max - x, border.y_max - y
            )
            pattern = replace(pattern, border=moved)
        if self.bend_m == 0.0 and self.thickness_m == 0.0:
            return pattern
        return BentPattern(**vars(pattern), sagitta_m=self.bend_m, thickness_m=self.thickness_m)


@dataclass(frozen=True)
class Planted:
    """The errors of one rig; ``Planted()`` has none.

    Attributes:
        sensors: errors by sensor.
        boards: errors by pattern.
        moving_edge_sigma_m, moving_edge_sigma_rad: how far moving transforms are off.
        moving: true ``parent_T_child`` (4, 4) of moving edges by edge and collection.
    """

    sensors: Mapping[str, SensorErrors] = field(default_factory=dict)
    boards: Mapping[str, BoardErrors] = field(default_factory=dict)
    moving_edge_sigma_m: float = 0.0
    moving_edge_sigma_rad: float = 0.0
    moving: Mapping[Tuple[Edge, str], np.ndarray] = field(default_factory=dict)

    def document(self) -> Dict[str, Any]:
        """Return all but the moving edges as JSON has it; names and units as of the attributes."""
        return {
            "sensors": {name: asdict(errors) for name, errors in self.sensors.items()},
            "boards": {name: asdict(errors) for name, errors in self.boards.items()},
            "moving_edge_sigma_m": self.moving_edge_sigma_m,
            "moving_edge_sigma_rad": self.moving_edge_sigma_rad,
        }

    def of(self, sensor: str) -> SensorErrors:
        """Return the errors of a sensor."""
        return self.sensors.get(sensor, SensorErrors())

    def of_board(self, pattern: str) -> BoardErrors:
        """Return the errors of a board."""
        return self.boards.get(pattern, BoardErrors())
