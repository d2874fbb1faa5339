"""Models of 3D LiDARs as data: which beams they send, how far, how wide, how noisy.

`LIDAR_MODELS` has them by name. Synthetic scenes take one as the beams of a LiDAR
(``lidar_mount(..., LIDAR_MODELS["ouster_64"])``), the simulated cell with ``--lidar ouster_64``.
What drives on a road and what stands in a cell have the same beams; the shortest ranges are those
of the data sheets, but for the HDL-64's, which would see nothing of a cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Mapping, Tuple, Union

import numpy as np

_TURN = 2.0 * np.pi
_FIRINGS_PER_S = 100_000  # of a rosette


@dataclass(frozen=True)
class LidarModel:
    """Beams of a spinning LiDAR; the default is a VLP-16.

    Attributes:
        rings: number of scan layers.
        elevation_deg: lowest and highest layer, others evenly between; or each layer's, ascending.
        azimuth_steps: columns, which are the beams of a layer in one turn.
        range_m: nearest and farthest return.
        stagger_deg: by which azimuth the beam of a layer is ahead of its column, from the lowest
            layer on, again and again; empty: a column is upright.
        sigma_m: standard deviation of a return along its beam.
        divergence_rad: full angle of a beam; at an edge its return may lie between both sides.
    """

    rings: int = 16
    elevation_deg: Tuple[float, ...] = (-15.0, 15.0)
    azimuth_steps: int = 1875
    range_m: Tuple[float, float] = (0.3, 130.0)
    stagger_deg: Tuple[float, ...] = ()
    sigma_m: float = 0.008
    divergence_rad: float = 0.003

    def __post_init__(self) -> None:
        if len(self.elevation_deg) not in (2, self.rings):
            raise ValueError(
                f"elevation_deg has {len(self.elevation_deg)} numbers; give the lowest and the "
                f"highest, or one for each of the {self.rings} rings"
            )

    @property
    def directions(self) -> np.ndarray:
        """(rings * azimuth_steps, 3) unit vectors, ring by ring, in the LiDAR's frame."""
        return _spinning(self.rings, self.elevation_deg, self.azimuth_steps, self.stagger_deg)

    @property
    def azimuth_step_rad(self) -> float:
        """Angle between two beams of a layer."""
        return _TURN / self.azimuth_steps

    @property
    def has_layers(self) -> bool:
        """True: each beam belongs to a scan layer."""
        return True


class _WithoutLayers:
    """What models have in common whose beams belong to no scan layers."""

    @property
    def rings(self) -> int:
        """One: there are no layers."""
        return 1

    @property
    def has_layers(self) -> bool:
        """False: beams belong to no scan layers."""
        return False


@dataclass(frozen=True)
class RosetteModel(_WithoutLayers):
    """Beams of a LiDAR with two turning prisms, which draw a rosette that never closes.

    Attributes:
        field_deg: full angle of the cone that it sees, about x.
        duration_s: of a cloud.
        turns_per_s: of the prisms; of different signs they turn against each other.
        range_m, sigma_m, divergence_rad: as of `LidarModel`.
    """

    field_deg: float
    duration_s: float
    turns_per_s: Tuple[float, float]
    range_m: Tuple[float, float]
    sigma_m: float
    divergence_rad: float

    @property
    def directions(self) -> np.ndarray:
        """(n, 3) unit vectors in order of time, in the LiDAR's frame, x ahead."""
        return _rosette(self.field_deg, self.duration_s, self.turns_per_s)

    @property
    def azimuth_steps(self) -> int:
        """All beams: there is one layer, so to speak."""
        return len(self.directions)


@dataclass(frozen=True)
class GridModel(_WithoutLayers):
    """Beams of a ToF camera or a solid-state LiDAR: the pixels of a pinhole, sent as a cloud.

    Attributes:
        width, height: pixels.
        field_deg: full angle across the width; x looks ahead.
        range_m, sigma_m, divergence_rad: as of `LidarModel`.
    """

    width: int
    height: int
    field_deg: float
    range_m: Tuple[float, float]
    sigma_m: float
    divergence_rad: float

    @property
    def directions(self) -> np.ndarray:
        """(width * height, 3) unit vectors row by row, in the sensor's frame, x ahead."""
        return _grid(self.width, self.height, self.field_deg)

    @property
    def azimuth_steps(self) -> int:
        """All beams: there is one layer, so to speak."""
        return self.width * self.height


AnyLidarModel = Union[LidarModel, RosetteModel, GridModel]

_OS1_64_STAGGER_DEG = (-3.164, -1.055, 1.055, 3.164)
_OS1_128_STAGGER_DEG = (-4.2, -1.4, 1.4, 4.2)
_HDL_64_LOWER = np.linspace(-24.33, -8.83, 32)
_HDL_64_UPPER = np.linspace(-8.33, 2.0, 32)

LIDAR_MODELS: Mapping[str, AnyLidarModel] = {
    "vlp_16": LidarModel(),
    "hdl_32": LidarModel(
        rings=32,
        elevation_deg=(-30.67, 10.67),
        azimuth_steps=2169,
        range_m=(0.3, 100.0),
        divergence_rad=0.003,
    ),
    "hdl_64": LidarModel(
        rings=64,
        elevation_deg=tuple(np.concatenate([_HDL_64_LOWER, _HDL_64_UPPER]).tolist()),
        azimuth_steps=2083,
        range_m=(0.3, 120.0),
        divergence_rad=0.002,
    ),
    "ouster_64": LidarModel(
        rings=64,
        elevation_deg=(-16.6, 16.6),
        azimuth_steps=1024,
        range_m=(0.3, 120.0),
        stagger_deg=_OS1_64_STAGGER_DEG,
        sigma_m=0.010,
        divergence_rad=0.0031,
    ),
    "ouster_128": LidarModel(
        rings=128,
        elevation_deg=(-22.5, 22.5),
        azimuth_steps=1024,
        range_m=(0.3, 120.0),
        stagger_deg=_OS1_128_STAGGER_DEG,
        sigma_m=0.010,
        divergence_rad=0.0031,
    ),
    "livox": RosetteModel(
        field_deg=38.4,
        duration_s=0.3,
        turns_per_s=(7294 / 60, -4664 / 60),
        range_m=(0.5, 90.0),
        sigma_m=0.010,
        divergence_rad=0.003,
    ),
    "tof": GridModel(
        width=240,
        height=180,
        field_deg=62.0,
        range_m=(0.2, 8.0),
        sigma_m=0.005,
        divergence_rad=0.003,
    ),
}


def lidar_model(name: str) -> AnyLidarModel:
    """Return a model by its name.

    Raises:
        ValueError: there is none of that name.
    """
    if name not in LIDAR_MODELS:
        raise ValueError(f"LiDAR model '{name}' is unknown; use {', '.join(LIDAR_MODELS)}")
    return LIDAR_MODELS[name]


def _ahead(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    parts = np.broadcast_arrays(
        np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)
    )
    return _kept(np.stack(parts, axis=-1).reshape(-1, 3))


def _kept(directions: np.ndarray) -> np.ndarray:
    directions.setflags(write=False)
    return directions


@lru_cache(maxsize=8)
def _spinning(
    rings: int, elevation_deg: Tuple[float, ...], steps: int, stagger_deg: Tuple[float, ...]
) -> np.ndarray:
    if len(elevation_deg) == rings:
        elevation = np.radians(elevation_deg)[:, None]
    else:
        elevation = np.radians(np.linspace(elevation_deg[0], elevation_deg[1], rings))[:, None]
    azimuth = np.linspace(-np.pi, np.pi, steps, endpoint=False)[None, :]
    if stagger_deg:
        azimuth = azimuth + np.radians(np.resize(stagger_deg, rings))[:, None]
    return _ahead(azimuth, elevation)


@lru_cache(maxsize=4)
def _rosette(field_deg: float, duration_s: float, turns_per_s: Tuple[float, float]) -> np.ndarray:
    time_s = np.arange(round(_FIRINGS_PER_S * duration_s)) / _FIRINGS_PER_S
    first, second = _TURN * turns_per_s[0] * time_s, _TURN * turns_per_s[1] * time_s
    reach = np.radians(field_deg) / 4.0
    return _ahead(
        reach * (np.cos(first) + np.cos(second)), reach * (np.sin(first) + np.sin(second))
    )


@lru_cache(maxsize=4)
def _grid(width: int, height: int, field_deg: float) -> np.ndarray:
    step = 2.0 * np.tan(np.radians(field_deg) / 2.0) / max(width - 1, 1)
    y, z = np.meshgrid(
        step * ((width - 1) / 2.0 - np.arange(width)),
        step * ((height - 1) / 2.0 - np.arange(height)),
    )
    rays = np.column_stack([np.ones(y.size), y.ravel(), z.ravel()])
    return _kept(rays / np.linalg.norm(rays, axis=1)[:, None])
