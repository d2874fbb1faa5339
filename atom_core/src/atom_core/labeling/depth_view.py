"""What the steps of the depth labeler share: an image with its rays, its planes and regions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.geometry.plane import plane_basis

_SPECK_M, _SPECK_SIGMAS = 0.02, 8.0  # by which neighbours are alike
_FEW_HOLES, _LEAST_AROUND = 0.97, 0.25
_NEAREST_PX, _WIDER = 3, 2  # sides of the squares that are filled from, one after the other
QUANTUM_M = 0.001  # what rounding adds to a depth's noise
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)  # for morphology


@dataclass(frozen=True)
class DepthOptions:
    """What a board looks like in a depth image.

    Attributes:
        step: every n-th pixel inside, in both directions, is labeled.
        least_pixels: a smaller region is no board.
        plane_sigmas: how far from the plane a pixel may be.
        largest_angle_deg: between the ray and the board's normal.
        least_border_share: of the region's border that must lie on the board's.
        least_coverage: of the board's part in view that the region must cover.
        least_before_share: of the pixels around the region that must lie behind its plane.
        image_margin_px: the region's border this near the image's edge is not the board's.
    """

    step: int = 3
    least_pixels: int = 400
    plane_sigmas: float = 3.5
    largest_angle_deg: float = 76.0
    least_border_share: float = 0.7
    least_coverage: float = 0.8
    least_before_share: float = 0.6
    image_margin_px: int = 2


class Plane(NamedTuple):
    """1/z = inverse_depth . (x, y, 1) of a normalised pixel; ``scale``: noise over the model's."""

    inverse_depth: np.ndarray
    scale: float

    def z(self, rays: np.ndarray) -> np.ndarray:
        """Return the depth (...) [m] at normalised pixels (..., 2)."""
        a, b, c = self.inverse_depth
        return 1.0 / np.maximum(a * rays[..., 0] + b * rays[..., 1] + c, 1e-3)


class PlaneAxes:
    """Coordinates [m] in a plane."""

    def __init__(self, plane: Plane):
        length = float(np.linalg.norm(plane.inverse_depth))
        self.normal = plane.inverse_depth / length  # normal . point = offset
        self.offset = 1.0 / length
        self._basis = plane_basis(self.normal)

    def to_plane(self, rays: np.ndarray) -> np.ndarray:
        """Return (n, 2) [m] where the rays of normalised pixels (n, 2) meet the plane."""
        directions = np.column_stack([rays, np.ones(len(rays))]).astype(float)
        along = self.offset / np.maximum(directions @ self.normal, 1e-6)
        return (directions * along[:, None]) @ self._basis[:, :2]

    def to_camera(self, in_plane: np.ndarray) -> np.ndarray:
        """Return points (n, 3) [m] in the camera's frame."""
        return in_plane @ self._basis[:, :2].T + self.offset * self.normal

    def angle_deg(self, ray: np.ndarray) -> float:
        """Return the angle between a ray (2,) and the normal."""
        direction = np.append(ray, 1.0)
        cosine = abs(float(direction @ self.normal)) / float(np.linalg.norm(direction))
        return float(np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))))


class Region(NamedTuple):
    """A part of the image: its mask (uint8), and where its first pixel is (row, column)."""

    mask: np.ndarray
    top: int
    left: int

    @property
    def window(self) -> Tuple[slice, slice]:
        """Return the rows and columns of the image that the mask covers."""
        height, width = self.mask.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)


class DepthView(NamedTuple):
    """A depth image, and what is looked for in it.

    Attributes:
        depth_m: (height, width) [m], NaN where there is no depth.
        solid_m: the same with small holes filled, to tell what hangs together.
        square_m: side of the pattern's squares; dark ones may be holes.
        rays: (height, width, 2) normalised pixels.
        camera: its intrinsics.
        half_size: (2,) half of the board's width and height [m].
        options: what a board looks like.
    """

    depth_m: np.ndarray
    solid_m: np.ndarray
    square_m: float
    rays: np.ndarray
    camera: Camera
    half_size: np.ndarray
    options: DepthOptions

    @property
    def focal_px(self) -> float:
        """Return the mean of the two focal lengths."""
        return float(self.camera.focal_px.mean())

    @property
    def diagonal_m(self) -> float:
        """Return the board's diagonal."""
        return 2.0 * float(np.hypot(*self.half_size))

    def tolerance_m(self, plane: Plane, z_m: np.ndarray) -> np.ndarray:
        """Return how far from a plane a pixel of some depth [m] may be."""
        return self.options.plane_sigmas * plane.scale * depth_sigma_m(z_m) + QUANTUM_M


def step_m(z_m: float) -> float:
    """Return by how much neighbours on one board may differ: noise, slant, rounding."""
    z = min(z_m, 8.0)
    return 0.02 + 3.0 * float(depth_sigma_m(np.array(z)))


def without_specks(depth_m: np.ndarray) -> np.ndarray:
    """Return depths without pixels that less than two of their eight neighbours are like.

    Args:
        depth_m: (height, width) float32 [m], NaN where there is no depth.
    """
    z = np.nan_to_num(depth_m, nan=0.0)
    padded = cv2.copyMakeBorder(z, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    step = (_SPECK_M + _SPECK_SIGMAS * depth_sigma_m(np.minimum(z, 8.0))).astype(np.float32)
    height, width = z.shape
    alike = np.zeros(z.shape, np.uint8)
    for y, x in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)):
        alike += cv2.absdiff(padded[y : y + height, x : x + width], z) < step
    return np.where(alike < 2, np.float32(np.nan), depth_m)


def filled(depth_m: np.ndarray, reach_px: int) -> np.ndarray:
    """Return depths with the mean of those around where there is none, in small holes.

    The nearest ones are taken: across an edge a mean of what is on both sides lies on neither.

    Args:
        depth_m: (height, width) float32 [m], NaN where there is no depth.
        reach_px: side of the square about a pixel of which a quarter must have a depth.
    """
    if np.mean(np.isfinite(depth_m)) > _FEW_HOLES:
        return depth_m
    stays = ~np.isfinite(depth_m) & (_mean_around(depth_m, reach_px)[1] < _LEAST_AROUND)
    solid_m, side_px = depth_m, _NEAREST_PX
    while True:
        mean, share = _mean_around(solid_m, min(side_px, reach_px))
        solid_m = np.where(np.isfinite(solid_m) | (share < _LEAST_AROUND), solid_m, mean)
        if side_px >= reach_px:
            return np.where(stays, np.float32(np.nan), solid_m)
        side_px = _WIDER * side_px + 1


def _mean_around(depth_m: np.ndarray, side_px: int) -> Tuple[np.ndarray, np.ndarray]:
    """Return the mean of the depths in a square about each pixel, and their share of it."""
    size = (side_px | 1, side_px | 1)
    share = cv2.blur(np.isfinite(depth_m).astype(np.float32), size)
    return cv2.blur(np.nan_to_num(depth_m, nan=0.0), size) / np.maximum(share, 1e-6), share


def closed(mask: np.ndarray) -> np.ndarray:
    """Return the mask with lost pixels inside filled; its outline stays."""
    padded = cv2.copyMakeBorder(mask, 2, 2, 2, 2, cv2.BORDER_REPLICATE)
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, CROSS)[2:-2, 2:-2]


def spread(count: int, wanted: int) -> np.ndarray:
    """Return about as many of ``count`` indices as wanted, at no regular distance."""
    if count <= wanted:
        return np.arange(count)
    number = np.arange(wanted)
    # golden ratio: a regular step would pick lines of pixels
    return ((number + (number * 0.6180339887) % 1.0) * count / wanted).astype(int)
