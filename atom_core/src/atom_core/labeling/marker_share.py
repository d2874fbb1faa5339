"""How large a ChArUco's markers are in their squares, as a picture has them.

A marker that is larger than configured reaches into the windows in which corners are refined, and
its outline shifts where they are expected, by a whole square at worst. A marker's middle stays in
the middle of its square, whatever its size: so middles place the board, and outlines tell the size.
"""

from __future__ import annotations

from typing import NamedTuple, Optional

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera
from atom_core.labeling.view_axis import axis_about

_LEAST_MARKERS = 5  # four determine a homography
_LEAST_FITTING = 0.75  # of the markers
_OFF_SQUARES = 0.15  # of a middle, from where the board has it
_OUTLINE_PX = 1.0  # outlines join the middles of a marker's outermost pixels
_NOISE, _NOISE_PX = 0.010, 0.5  # of a measured share; of a marker's side
_CLEARLY, _CLEARLY_PX = 0.030, 1.5  # likewise; light and blur widen or narrow markers


class MarkerShare(NamedTuple):
    """The side of a marker over the side of its square, as measured.

    Attributes:
        share: measured.
        square_px: a square's side in the image [px].
    """

    share: float
    square_px: float

    def differs(self, configured: float) -> bool:
        """Tell whether noise does not explain another share; blur, which narrows markers, may."""
        return abs(self.share - configured) > _NOISE + _NOISE_PX / self.square_px

    def contradicts(self, configured: float) -> bool:
        """Tell whether neither light nor blur explain another share."""
        return abs(self.share - configured) > _CLEARLY + _CLEARLY_PX / self.square_px


def measure_share(
    squares: np.ndarray, outlines: np.ndarray, camera: Optional[Camera]
) -> Optional[MarkerShare]:
    """Measure how large markers are; None where they do not stand as on the board.

    Args:
        squares: (n, 2) lower corner of each marker's square on the board [squares].
        outlines: (n, 4, 2) of the markers [px].
        camera: its intrinsics, if known.
    """
    if len(squares) < _LEAST_MARKERS:
        return None
    flat = outlines.astype(float)
    if camera is not None:
        pixels = flat.reshape(-1, 2)
        flat = axis_about(camera, pixels).normalise(pixels).reshape(-1, 4, 2)
    homography, mask = cv2.findHomography(_middles(flat), squares + 0.5, cv2.RANSAC, _OFF_SQUARES)
    if homography is None or np.mean(mask) < _LEAST_FITTING:
        return None
    fitting = mask.ravel().astype(bool)
    on_board = cv2.perspectiveTransform(flat[fitting].reshape(-1, 1, 2), homography)
    sides = _sides(on_board.reshape(-1, 4, 2))
    sides_px = _sides(outlines[fitting])
    share = float(np.median(sides * (1.0 + _OUTLINE_PX / sides_px)))
    return MarkerShare(share, float(np.median(sides_px / sides)))


def _middles(outlines: np.ndarray) -> np.ndarray:
    """Return (n, 2) where the diagonals of outlines (n, 4, 2) meet."""
    corners = np.concatenate([outlines, np.ones((len(outlines), 4, 1))], axis=2)
    diagonals = [np.cross(corners[:, i], corners[:, i + 2]) for i in range(2)]
    middles = np.cross(*diagonals)
    return middles[:, :2] / middles[:, 2:]


def _sides(outlines: np.ndarray) -> np.ndarray:
    return np.linalg.norm(outlines - np.roll(outlines, 1, axis=1), axis=2)
