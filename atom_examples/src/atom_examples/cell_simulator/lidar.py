"""LiDARs: ranges along their beams, with noise, lost returns and mixed ones at edges."""

from __future__ import annotations

from typing import Iterator, NamedTuple, Optional, Tuple, Union

import numpy as np

from atom_core.geometry import se3
from atom_core.synthetic.board import is_dark
from atom_core.synthetic.lidar2d import Lidar2dModel
from atom_core.synthetic.lidar_models import AnyLidarModel, LidarModel
from atom_core.synthetic.planted import RangeErrors
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.still import WhileStill

_EDGE_M = 0.03  # a beam whose parts differ more has hit an edge
_SWEEP_MARGIN_RAD = 0.02


class LidarNoise(NamedTuple):
    """How wrong ranges are.

    Attributes:
        sigma_m: standard deviation along the beam.
        dropout: share of the returns that are lost.
        mixed_within_rad: returns as near to an edge lie anywhere between its two sides.
    """

    sigma_m: float = 0.008
    dropout: float = 0.02
    mixed_within_rad: float = 0.0015


class Returns(NamedTuple):
    """Beams that meet something: their ids (n,), exact ranges (n,) [m] and intensities (n,).

    ``other`` (n,) [m] is the range of what a part of the beam meets, where it is on an edge.
    """

    beam: np.ndarray
    range: np.ndarray
    other: np.ndarray
    intensity: np.ndarray
    on_plate: np.ndarray


class Scan(NamedTuple):
    """A cloud in the LiDAR's frame.

    Attributes:
        points: (n, 3) [m] float32.
        intensity: (n,) float32, 0 to 255.
        beam: (n,) ids of beams, ring by ring.
        on_plate: (n,) bool: the beam's centre line truly hits the plate.
    """

    points: np.ndarray
    intensity: np.ndarray
    beam: np.ndarray
    on_plate: np.ndarray


class Lidar:
    """Scans a scene. What stands still is cast once and kept."""

    def __init__(
        self,
        name: str,
        frame: str,
        model: Union[AnyLidarModel, Lidar2dModel],
        noise: LidarNoise,
        errors: RangeErrors = RangeErrors(),  # noqa: B008 (frozen)
    ):
        """Prepare the beams, and four lines around each to find edges.

        Beams are as wide as ``noise`` says; ``errors`` has what is wrong with ranges always.
        """
        self.errors = errors
        self.name, self.frame, self.model, self.noise = name, frame, model, noise
        self._beams = np.stack(
            [model.directions, *_around(model.directions, noise.mixed_within_rad)]
        )
        self._walls: Optional[Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = None
        self._still: WhileStill[Returns] = WhileStill()

    def ring(self, beam: np.ndarray) -> Optional[np.ndarray]:
        """Return the scan layer of beams of a 3D LiDAR, 0 the lowest; None: it has no layers."""
        if not isinstance(self.model, LidarModel):
            return None
        return (beam // self.model.azimuth_steps).astype(np.uint16)

    def exact(self, scene: Scene) -> Returns:
        """Return all beams that meet something within range."""
        world_T_lidar = scene.pose(self.frame)
        distance, reflectivity, on_plate = self._moving_over_still(scene, world_T_lidar)
        centre, around = distance[0], distance[1:]
        nearest, farthest = around.min(axis=0), around.max(axis=0)
        away = np.where(centre - nearest > farthest - centre, nearest, farthest)
        on_edge = (np.abs(away - centre) > _EDGE_M) & np.isfinite(away)
        low, high = self.model.range_m
        beam = np.flatnonzero((centre >= low) & (centre <= high))
        return Returns(
            beam,
            centre[beam],
            np.where(on_edge, away, centre)[beam],
            reflectivity[beam],
            on_plate[beam],
        )

    def capture(self, scene: Scene, rng: Optional[np.random.Generator] = None) -> Scan:
        """Return a scan; without rng, complete and without noise."""
        seen = self._still.seen(scene.arrangement, lambda: self.exact(scene))
        returns = Returns(*(array.copy() for array in seen))
        error_m = np.zeros(0)
        if self.errors != RangeErrors():
            error_m, lost = self._spoiled(scene, returns, rng)
            returns, error_m = Returns(*(array[~lost] for array in returns)), error_m[~lost]
        beam, distance, other, intensity, on_plate = returns
        if rng is not None:
            kept = rng.random(len(beam)) >= self.noise.dropout
            beam, distance, other = beam[kept], distance[kept], other[kept]
            intensity, on_plate = intensity[kept], on_plate[kept]
            error_m = error_m[kept] if len(error_m) else error_m
            mixed = np.flatnonzero(other != distance)
            share = rng.random(len(mixed))
            distance[mixed] += share * (other[mixed] - distance[mixed])
            distance += self.noise.sigma_m * rng.standard_normal(len(distance))
        if len(error_m):
            distance = distance + error_m
        points = (self.model.directions[beam] * distance[:, None]).astype(np.float32)
        return Scan(points, intensity, beam, on_plate)

    def _spoiled(
        self, scene: Scene, returns: Returns, rng: Optional[np.random.Generator]
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return by how much returns read long (n,) [m], and which are lost on dark squares."""
        lidar_T_pattern = se3.inverse(scene.pose(self.frame)) @ scene.world_T_pattern
        points = self.model.directions[returns.beam] * returns.range[:, None]
        in_plane = se3.apply(se3.inverse(lidar_T_pattern), points)[:, :2]
        dark = returns.on_plate & is_dark(lidar_T_pattern, scene.board.pattern, in_plane)
        ring = self.ring(returns.beam)
        rings = np.zeros(len(returns.beam)) if ring is None else ring
        error_m = (
            self.errors.error_m(returns.range, rings.astype(int)) + self.errors.dark_offset_m * dark
        )
        lost = np.zeros(len(dark), dtype=bool)
        if rng is not None and self.errors.dark_lost > 0:
            lost = dark & (rng.random(len(dark)) < self.errors.dark_lost)
        return error_m, lost

    def _moving_over_still(
        self, scene: Scene, world_T_lidar: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ranges (5, n) of beams and lines around, intensities (n,), on the plate (n,)."""
        origin, rotation = world_T_lidar[:3, 3], world_T_lidar[:3, :3]
        if self._walls is None or not np.array_equal(self._walls[0], world_T_lidar):
            distance, reflected = self._cast(scene, slice(None), origin, rotation, still=True)[:2]
            self._walls = (world_T_lidar, distance, reflected, np.zeros(len(reflected), dtype=bool))
        distance, reflected, on_plate = (array.copy() for array in self._walls[1:])
        near = self._near_moving(scene, origin, rotation)
        new, new_reflected, plate = self._cast(scene, near, origin, rotation, still=False)
        before = new < distance[:, near]
        distance[:, near] = np.where(before, new, distance[:, near])
        reflected[near] = np.where(before[0], new_reflected, reflected[near])
        on_plate[near] = before[0] & plate
        return distance, reflected, on_plate

    def _near_moving(self, scene: Scene, origin: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Return the beams (n,) that point to balls around the moving shapes."""
        chosen = np.zeros(len(self.model.directions), dtype=bool)
        for centre, radius in scene.moving_balls():
            to_centre = (centre - origin) @ rotation
            away = np.linalg.norm(to_centre)
            if away <= radius:
                return np.arange(len(chosen))
            angle = np.arcsin(radius / away) + _SWEEP_MARGIN_RAD
            chosen |= self.model.directions @ (to_centre / away) >= np.cos(angle)
        return np.flatnonzero(chosen)

    def _cast(
        self,
        scene: Scene,
        which: Union[slice, np.ndarray],
        origin: np.ndarray,
        rotation: np.ndarray,
        still: bool,
    ) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        lines = self._beams[:, which]
        rays = lines.reshape(-1, 3) @ rotation.T
        hits = scene.cast(origin, rays, still=still, moving=not still)
        distance = hits.distance.reshape(lines.shape[:2])
        count = lines.shape[1]
        met, shape = np.isfinite(distance[0]), hits.shape[:count]
        albedo = np.where(met, scene.albedo[shape], 0.0)
        plate = met & np.isin(shape, scene.plates)
        on_board = np.where(plate, distance[0], 0.0)[:, None] * rays[:count] + origin
        albedo[plate] = scene.printed_albedo(on_board[plate], shape[plate])
        cosine = np.abs(np.einsum("ni,ni->n", rays[:count], hits.normal[:count]))
        intensity = np.where(met, np.rint(100.0 * albedo * (0.3 + 0.7 * cosine)), 0.0)
        return distance, intensity.astype(np.float32), plate


def _around(directions: np.ndarray, angle_rad: float) -> Iterator[np.ndarray]:
    """Yield the directions (n, 3) turned left, right, up and down by an angle."""
    left = np.cross([0.0, 0.0, 1.0], directions)
    left /= np.linalg.norm(left, axis=1)[:, None]
    up = np.cross(directions, left)
    for side in (left, -left, up, -up):
        yield np.cos(angle_rad) * directions + np.sin(angle_rad) * side
