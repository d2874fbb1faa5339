"""A colour camera: what it sees, through its lens, with noise."""

from __future__ import annotations

from functools import cached_property
from typing import Optional, Tuple

import numpy as np
from scipy.sparse import csr_matrix

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera
from atom_core.synthetic.planted import CameraErrors
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.scene_model import View
from atom_examples.cell_simulator.still import WhileStill

FINER = 2  # pictures are drawn finer and averaged, so that edges keep their place
_WIDEST = 3.0  # pinhole picture to image, in either direction
_COARSE_PX = 4  # grid on which the distortion is undone exactly; linear in between


def pinhole_view(name: str, frame: str, camera: Camera) -> View:
    """Return the pinhole without distortion that sees all that a camera sees.

    Raises:
        SimulatorError: the lens is too wide for one pinhole.
    """
    return View(name, frame, _pinhole(name, camera)[0])


def _pinhole(name: str, camera: Camera) -> Tuple[Camera, np.ndarray]:
    """Return the pinhole, and where its pixel (0, 0) is in the undistorted image (2,) [px]."""
    columns, rows = np.arange(-1, camera.width + 1), np.arange(-1, camera.height + 1)
    outline = np.concatenate(
        [np.column_stack([columns, np.full(len(columns), y)]) for y in rows[[0, -1]]]
        + [np.column_stack([np.full(len(rows), x), rows]) for x in columns[[0, -1]]]
    )
    undistorted = camera.normalise(outline) * camera.focal_px + camera.centre_px
    first = np.floor(undistorted.min(axis=0)).astype(int)
    width, height = (np.ceil(undistorted.max(axis=0)).astype(int) - first + 1).tolist()
    if width > _WIDEST * camera.width or height > _WIDEST * camera.height:
        raise SimulatorError(
            f"sensor '{name}': its lens is too wide to be drawn; reduce its field of view"
        )
    K = camera.K.copy()
    K[:2, 2] -= first
    return Camera(width, height, K, model="none"), first


class ColourCamera:
    """Takes pictures of a scene with one camera."""

    def __init__(
        self,
        name: str,
        camera: Camera,
        noise_grey: float,
        errors: CameraErrors = CameraErrors(),  # noqa: B008 (frozen)
    ):
        """The way of each fine pixel through the lens is prepared by the first picture.

        Args:
            name: of the view in the scene.
            camera: true intrinsics, distortion included.
            noise_grey: standard deviation of the grey levels.
            errors: blur, vignetting and exposure of its pictures; its intrinsics have theirs.
        """
        self.name, self.camera, self.noise_grey = name, camera, noise_grey
        self.errors, self._shade = errors, _shade(camera, errors.vignetting)
        self._still: WhileStill[np.ndarray] = WhileStill()

    @cached_property
    def _maps(self) -> Tuple[np.ndarray, np.ndarray]:
        """Where each fine pixel is in the drawn picture, as `cv2.remap` takes it."""
        camera = self.camera
        pinhole, first = _pinhole(self.name, camera)
        columns, to_columns = _knots(camera.width)
        rows, to_rows = _knots(camera.height)
        knots = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        undistorted = camera.normalise(knots) * camera.focal_px + camera.centre_px - first
        fine = (undistorted + 0.5) * FINER - 0.5
        x, y = (to_rows @ c.reshape(len(rows), -1) @ to_columns.T for c in fine.T)
        y = FINER * pinhole.height - 1 - y  # drawn pictures start with the bottom row
        return cv2.convertMaps(x.astype(np.float32), y.astype(np.float32), cv2.CV_16SC2)

    def capture(self, scene: Scene, rng: Optional[np.random.Generator] = None) -> np.ndarray:
        """Return the picture (height, width, 3) uint8, red green blue; without rng, no noise."""
        arrangement = (scene.arrangement, scene.gloss)
        picture = self._still.seen(arrangement, lambda: self.drawn(scene))
        return self.developed(picture, rng)

    def drawn(self, scene: Scene) -> np.ndarray:
        """Return the picture (height, width, 3) uint8 of one instant as it arrives at the chip."""
        through_lens = cv2.remap(scene.colours(self.name), *self._maps, cv2.INTER_LINEAR)
        size = (self.camera.width, self.camera.height)
        return cv2.resize(through_lens, size, interpolation=cv2.INTER_AREA)

    def developed(
        self, picture: np.ndarray, rng: Optional[np.random.Generator] = None
    ) -> np.ndarray:
        """Return what the camera makes of a picture (height, width, 3), with its errors, uint8."""
        if self.errors.blur_px or self.errors.vignetting or self.errors.exposure_step:
            picture = self._spoiled(picture, rng)
        if rng is None or self.noise_grey == 0:
            return _rounded(picture)
        noise = rng.standard_normal(picture.shape, dtype=np.float32)
        noise *= self.noise_grey
        noise += picture
        return _rounded(noise)

    def _spoiled(self, picture: np.ndarray, rng: Optional[np.random.Generator]) -> np.ndarray:
        """Return a picture float32 with blur, darker corners, and an exposure of its own."""
        spoiled = picture.astype(np.float32)
        if self.errors.blur_px > 0:
            spoiled = cv2.GaussianBlur(spoiled, (0, 0), self.errors.blur_px)
        gain = 1.0
        if rng is not None and self.errors.exposure_step > 0:
            gain = float(np.exp(self.errors.exposure_step * rng.standard_normal()))
        return np.clip(spoiled * (gain * self._shade), 0, 255)


def _rounded(picture: np.ndarray) -> np.ndarray:
    if picture.dtype == np.uint8:
        return picture.copy()
    return np.clip(np.rint(picture, out=picture), 0, 255, out=picture).astype(np.uint8)


def _shade(camera: Camera, vignetting: float) -> np.ndarray:
    """Return (height, width, 1) float32 the share of light that arrives: 1 in the middle."""
    width, height = camera.width, camera.height
    column, row = np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2
    to_corner = 4.0 * (row[:, None] ** 2 + column**2) / (width**2 + height**2)
    return (1.0 - vignetting * to_corner).astype(np.float32)[..., None]


def _knots(count: int) -> Tuple[np.ndarray, csr_matrix]:
    """Return knots [px] along an image's side, and the matrix from there to its fine pixels.

    A fine pixel lies between two knots, so most of the matrix is zero.
    """
    knots = np.arange(-_COARSE_PX, count + 2 * _COARSE_PX, _COARSE_PX, dtype=float)
    fine = (np.arange(count * FINER) + 0.5) / FINER - 0.5
    distance = np.abs(fine[:, None] - knots) / _COARSE_PX
    return knots, csr_matrix(np.maximum(1.0 - distance, 0.0))
