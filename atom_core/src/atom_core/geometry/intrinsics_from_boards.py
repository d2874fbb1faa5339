"""A camera's intrinsics from pictures of flat boards, by OpenCV (Zhang's method)."""

from __future__ import annotations

from typing import Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera

_FEWEST_VIEWS, _FEWEST_CORNERS = 3, 6


def camera_of_boards(
    points: Sequence[np.ndarray], pixels: Sequence[np.ndarray], width: int, height: int
) -> Tuple[Camera, float]:
    """Return the camera (plumb_bob, five coefficients) and the root mean square error [px].

    Args:
        points: for each picture, (n, 3) on a board with z = 0 [m].
        pixels: for each picture, (n, 2) where they were found [px].
        width: of the pictures [px].
        height: of the pictures [px].

    Raises:
        ValueError: fewer than three pictures show enough of a board, or OpenCV finds no camera.
    """
    usable = [(p, q) for p, q in zip(points, pixels) if len(p) >= _FEWEST_CORNERS]
    if len(usable) < _FEWEST_VIEWS:
        raise ValueError(
            f"{len(usable)} pictures show enough of a board, {_FEWEST_VIEWS} are needed"
        )
    try:
        rms_px, K, D, _, _ = cv2.calibrateCamera(
            [p.astype(np.float32).reshape(-1, 1, 3) for p, _ in usable],
            [q.astype(np.float32).reshape(-1, 1, 2) for _, q in usable],
            (width, height),
            None,
            None,
        )
    except cv2.error as error:
        raise ValueError(f"OpenCV finds no camera ({error.err})") from None
    return Camera(width, height, K, np.ravel(D)[:5], "plumb_bob"), float(rms_px)
