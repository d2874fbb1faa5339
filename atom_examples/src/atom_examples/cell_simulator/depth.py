"""A depth camera: z-depths with noise, gaps and bleeding edges as structured light has them."""

from __future__ import annotations

from typing import NamedTuple, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera
from atom_core.synthetic.depth import near_jumps
from atom_core.synthetic.planted import DepthErrors
from atom_examples.cell_simulator.rays import Hits
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.still import WhileStill

_STEP_M, _STEP_SHARE = 0.03, 0.02  # a larger jump between neighbours is an edge


class DepthNoise(NamedTuple):
    """How wrong depths are: Gaussian with sigma_m + sigma_per_square_m (z - sigma_from_m)^2.

    Attributes:
        sigma_m, sigma_per_square_m, sigma_from_m: of the standard deviation [m, 1/m, m].
        dropout: share of the pixels without a depth.
        bleeding_px: pixels as near to an edge, on its far side, take depths between its sides.
    """

    sigma_m: float = 0.0012
    sigma_per_square_m: float = 0.0019
    sigma_from_m: float = 0.4
    dropout: float = 0.01
    bleeding_px: int = 1


class DepthCamera:
    """Takes depth images of a scene. With lens distortion it casts rays, without it draws."""

    def __init__(
        self,
        name: str,
        frame: str,
        camera: Camera,
        range_m: Tuple[float, float],
        noise: DepthNoise,
        errors: DepthErrors = DepthErrors(),  # noqa: B008 (frozen)
    ):
        """Prepare the rays of all pixels.

        Args:
            name: of the view in the scene.
            frame: the optical frame.
            camera: intrinsics.
            range_m: nearest and farthest z-depth.
            noise: how wrong depths are.
            errors: what is wrong with them always.
        """
        self.errors = errors
        self.name, self.frame, self.camera = name, frame, camera
        self.range_m, self.noise = range_m, noise
        self._still: WhileStill[np.ndarray] = WhileStill()
        row, column = np.mgrid[0 : camera.height, 0 : camera.width]
        xy = camera.normalise(np.column_stack([column.ravel(), row.ravel()]))
        rays = np.column_stack([xy, np.ones(len(xy))])
        self._along_z = 1.0 / np.linalg.norm(rays, axis=1)
        self._rays = rays * self._along_z[:, None]

    def exact(self, scene: Scene) -> np.ndarray:
        """Return exact z-depths (height, width) [m] float32, out of range too."""
        if self.camera.model == "none" or not np.any(self.camera.D):
            return np.ascontiguousarray(scene.depths(self.name)[::-1])
        z = self._cast(scene).distance * self._along_z
        return z.reshape(self.camera.height, self.camera.width).astype(np.float32)

    def plate_pixels(self, scene: Scene) -> np.ndarray:
        """Return the pixels (n,), row by row, whose rays truly hit the plate within range."""
        hits = self._cast(scene)
        z = hits.distance * self._along_z
        in_range = (z >= self.range_m[0]) & (z <= self.range_m[1])
        return np.flatnonzero(np.isin(hits.shape, scene.plates) & in_range).astype(np.int32)

    def capture(self, scene: Scene, rng: Optional[np.random.Generator] = None) -> np.ndarray:
        """Return depths (height, width) [m] float32, NaN where there is none.

        Without rng there is no noise.
        """
        z = self._still.seen(scene.arrangement, lambda: self.exact(scene)).copy()
        halo, error_m = self._spoiled(z)
        if rng is not None:
            noise = self.noise
            for _ in range(noise.bleeding_px):
                z = _bleeding(z, rng)
            sigma = noise.sigma_m + noise.sigma_per_square_m * (z - noise.sigma_from_m) ** 2
            z = z + sigma * rng.standard_normal(z.shape, dtype=np.float32)
            z[rng.random(z.shape, dtype=np.float32) < noise.dropout] = np.nan
        if halo is not None:
            z = z + error_m
            z[halo] = np.nan
        with np.errstate(invalid="ignore"):
            z[(z < self.range_m[0]) | (z > self.range_m[1])] = np.nan
        return z

    def _spoiled(self, z: np.ndarray) -> Tuple[Optional[np.ndarray], Optional[np.ndarray]]:
        """Return which pixels have no depth, and by how much all read far [m] (height, width)."""
        if self.errors == DepthErrors():
            return None, None
        return near_jumps(z, self.errors.halo_px), self.errors.error_m(z).astype(np.float32)

    def _cast(self, scene: Scene) -> Hits:
        world_T_optical = scene.pose(self.frame)
        return scene.cast(world_T_optical[:3, 3], self._rays @ world_T_optical[:3, :3].T)


def _bleeding(z: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return depths where pixels just beyond an edge lie anywhere between its two sides."""
    nearest = cv2.erode(z, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    beyond = np.flatnonzero(z - nearest > _STEP_M + _STEP_SHARE * z)
    mixed = z.copy()
    share = rng.random(len(beyond), dtype=np.float32)
    mixed.flat[beyond] -= share * (z - nearest).flat[beyond]
    return mixed


def millimetres(depth_m: np.ndarray) -> np.ndarray:
    """Return depths as 16UC1 has them: mm, 0 where there is none."""
    return np.nan_to_num(np.rint(depth_m * 1000.0), nan=0.0).astype(np.uint16)
