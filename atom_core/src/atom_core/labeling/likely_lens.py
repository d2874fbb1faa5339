"""A lens for pictures whose camera_info has none, as of a camera that is not calibrated yet.

Where a wide lens bends a board, no homography has all of it, and markers seem to stand elsewhere
than on the board. Then the lens is taken that straightens the board best. It only tells where
corners are looked for; no label has anything of it.
"""

from __future__ import annotations

from typing import Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.labeling.board_view import BoardView

_FOCAL_LENGTHS = (4.0, 2.4, 1.7, 1.3, 1.0, 0.8, 0.65)  # of a fisheye, in the camera's own
_LEAST_POINTS = 24
_BENT_PX, _CLEARLY = 1.0, 0.5  # mean misfit without a lens; what of it one may leave
_FARTHEST_PX = 20.0  # of a misfit that counts

Placed = Tuple[np.ndarray, np.ndarray]


def likely_lens(
    camera: Optional[Camera], layouts: Sequence[Placed], size_px: Tuple[int, int]
) -> Optional[Camera]:
    """Return the camera, or one with the lens that straightens a board, where it has none.

    Args:
        camera: its intrinsics, if known.
        layouts: for each way in which the board may be laid out, (n, 2) points in its plane
            [squares], and (n, 2) where they were found [px].
        size_px: width and height of the image.
    """
    enough = [placed for placed in layouts if len(placed[0]) >= _LEAST_POINTS]
    if not enough or (camera is not None and not _is_plain(camera)):
        return camera
    misfits = [_misfit_px(camera, *placed) for placed in enough]
    plain, placed = min(misfits), enough[int(np.argmin(misfits))]
    if plain <= _BENT_PX:
        return camera
    K = _usual(size_px) if camera is None else camera.K
    lenses = [_fisheye(K, size_px, factor) for factor in _FOCAL_LENGTHS]
    left = [_misfit_px(lens, *placed) for lens in lenses]
    best = int(np.argmin(left))
    return lenses[best] if left[best] <= _CLEARLY * plain else camera


def _is_plain(camera: Camera) -> bool:
    return camera.model != "equidistant" and not np.any(camera.D)


def _usual(size_px: Tuple[int, int]) -> np.ndarray:
    """Return K of a view 90 degrees wide."""
    (width, height), focal_px = size_px, size_px[0] / 2.0
    x, y = (width - 1) / 2.0, (height - 1) / 2.0
    return np.array([[focal_px, 0.0, x], [0.0, focal_px, y], [0.0, 0.0, 1.0]])


def _fisheye(K: np.ndarray, size_px: Tuple[int, int], factor: float) -> Camera:
    """Return the camera whose pixels are as far off the middle as the angle, times a focal length.

    The longer that is, the less it bends; how large all is the homography tells.
    """
    scaled = K.copy()
    scaled[:2, :2] *= factor
    return Camera(*size_px, scaled, np.zeros(4), "equidistant")


def _misfit_px(camera: Optional[Camera], board: np.ndarray, pixels: np.ndarray) -> float:
    try:
        view = BoardView(board, pixels, camera)
    except ValueError:
        return _FARTHEST_PX
    misfit = np.linalg.norm(pixels - view.without_correction(board), axis=1)
    return float(np.mean(np.minimum(misfit, _FARTHEST_PX)))
