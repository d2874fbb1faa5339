"""How wrong simulated measurements are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping

import numpy as np

from atom_core.geometry import expected_noise


@dataclass(frozen=True)
class Noise:
    """Noise of every kind of label; the numbers are those of the paper's cell.

    Attributes:
        corner_px: standard deviation of a corner along each axis [px].
        lidar_m: standard deviation of a return along its beam [m].
        depth_scale: factor on ``depth_sigma_m``; 0 switches the noise of depth images off.
        gross_fraction: share of the labeled items (corners, points inside, limit points) that
            are grossly wrong: a corner by 20-60 px, a range by 5-50 cm along the ray.
        dropout: share of the corners, beams and depth pixels on the board that are lost.
        sensors: the noise of some sensors by name, where it is another one.
        float32: store clouds and depth images in single precision, as files do.
    """

    corner_px: float = 0.3
    lidar_m: float = 0.010
    depth_scale: float = 1.0
    gross_fraction: float = 0.0
    dropout: float = 0.0
    float32: bool = True
    sensors: Mapping[str, Noise] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if min(self.corner_px, self.lidar_m, self.depth_scale) < 0:
            raise ValueError("a standard deviation must not be negative")
        if not (0 <= self.gross_fraction <= 1 and 0 <= self.dropout < 1):
            raise ValueError("gross_fraction must be in [0, 1] and dropout in [0, 1)")

    def of(self, sensor: str) -> Noise:
        """Return the noise of a sensor."""
        return self.sensors.get(sensor, self)

    @classmethod
    def none(cls) -> Noise:
        """Return exact measurements: residuals at the truth vanish to rounding."""
        return cls(corner_px=0.0, lidar_m=0.0, depth_scale=0.0, float32=False)

    def depth_sigma_m(self, z_m: np.ndarray) -> np.ndarray:
        """Return the standard deviation (n,) of z-depths (n,) [m]."""
        return self.depth_scale * expected_noise.depth_sigma_m(z_m)

    def round(self, values: np.ndarray) -> np.ndarray:
        """Return values (any shape) as a file would keep them."""
        return values.astype(np.float32) if self.float32 else values

    def gross_range_errors(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return (count,) shifts along the ray [m], zero where the label is right."""
        wrong = rng.random(count) < self.gross_fraction
        shift = rng.uniform(0.05, 0.5, count) * rng.choice([-1.0, 1.0], count)
        return np.where(wrong, shift, 0.0)

    def corner_errors(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return (count, 2) errors of corners [px]."""
        error = self.corner_px * rng.standard_normal((count, 2))
        wrong = rng.random(count) < self.gross_fraction
        angle, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(20.0, 60.0, count)
        gross = length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return error + np.where(wrong[:, None], gross, 0.0)
