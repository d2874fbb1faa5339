"""Where a flat board's points appear in an image, from some that were found in it."""

from __future__ import annotations

from typing import Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.camera import Camera
from atom_core.labeling.view_axis import axis_about

_RANSAC_ITERATIONS, _RANSAC_CONFIDENCE = 500, 0.999
_NEIGHBOURS = 6
_HALF_SQUARE = 0.5
_FAR_OFF_PX, _FAR_OFF_SIGMAS = 0.6, 7.4  # from what the neighbours say
_NEXT = (1, 2, -1, -2)
_NEAREST = 1e-3  # of the depth of the board's origin: what lies behind the camera stays far out


class BoardView:
    """A map from the board's plane to pixels: a homography, the lens, and what both leave over.

    Without the camera's intrinsics, or with poor ones, the homography alone would be off where
    the lens bends the board; the mean misfit of the nearest known points is added for that.
    """

    def __init__(self, board: np.ndarray, pixels: np.ndarray, camera: Optional[Camera] = None):
        """Fit the map.

        Args:
            board: (n, 2) points in the board's plane, in squares; n >= 4, not all on a line.
            pixels: (n, 2) where they were found [px].
            camera: its intrinsics, if known.

        Raises:
            ValueError: the points do not determine a map.
        """
        self._axis = None if camera is None else axis_about(camera, pixels)
        self._scale = 1.0 if camera is None else float(camera.focal_px.mean())
        self._homography, self.inliers = self._fit(board, pixels)
        self._known = board[self.inliers]
        self._misfit = pixels[self.inliers] - self.without_correction(self._known)

    def project(self, board: np.ndarray) -> np.ndarray:
        """Return pixels (n, 2) of board points (n, 2) [squares]."""
        away = np.linalg.norm(board[:, None] - self._known[None], axis=2)
        count = min(_NEIGHBOURS, len(self._known))
        nearest = np.argpartition(away, count - 1, axis=1)[:, :count]
        weight = 1.0 / (np.take_along_axis(away, nearest, axis=1) + _HALF_SQUARE) ** 2
        correction = np.sum(weight[..., None] * self._misfit[nearest], axis=1)
        return self.without_correction(board) + correction / np.sum(weight, axis=1)[:, None]

    def without_correction(self, board: np.ndarray) -> np.ndarray:
        """Return pixels (n, 2) by homography and lens alone."""
        flat = self._flat(board)
        return flat if self._axis is None else self._axis.project(flat)

    def of_use(self, board: np.ndarray) -> np.ndarray:
        """Return (n,) bool: board points that are before the camera, not beside or behind it."""
        if self._axis is None:
            return np.ones(len(board), dtype=bool)
        return self._axis.of_use(self._flat(board))

    def _flat(self, board: np.ndarray) -> np.ndarray:
        """Return (n, 2) where board points are: pixels, or x/z, y/z where the camera is known."""
        x, y, w = self._homography @ np.column_stack([board, np.ones(len(board))]).T
        w = np.maximum(w, _NEAREST)
        return np.column_stack([x / w, y / w])

    def axes_px(self, board: np.ndarray) -> np.ndarray:
        """Return (n, 2, 2): columns are a square's side along x and y at board points [px]."""
        sides = []
        for axis in range(2):
            step = np.zeros(2)
            step[axis] = _HALF_SQUARE
            sides.append(
                self.without_correction(board + step) - self.without_correction(board - step)
            )
        return np.stack(sides, axis=2)

    def _fit(self, board: np.ndarray, pixels: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        flat = pixels if self._axis is None else self._axis.normalise(pixels)
        size = np.sqrt(np.prod(np.ptp(pixels, axis=0)) / max(np.prod(np.ptp(board, axis=0)), 1e-9))
        threshold = max(3.0, 0.25 * float(size)) / self._scale
        homography, mask = cv2.findHomography(
            board, flat, cv2.RANSAC, threshold, None, _RANSAC_ITERATIONS, _RANSAC_CONFIDENCE
        )
        if homography is None:
            raise ValueError("the points found do not determine where the board is")
        return homography, mask.ravel().astype(bool)


def off_their_neighbours(
    board: np.ndarray, pixels: np.ndarray, good: np.ndarray, camera: Optional[Camera]
) -> np.ndarray:
    """Return (n,) bool: corners whose misfit differs from that of the corners around them.

    What a lens bends, of which the camera's intrinsics say nothing, is no misfit of a corner.
    """
    off = np.zeros(len(board), dtype=bool)
    chosen = np.flatnonzero(good)
    if len(chosen) < 8:
        return off
    try:
        view = BoardView(board[chosen], pixels[chosen], camera)
    except ValueError:
        return off
    misfit = pixels[chosen] - view.without_correction(board[chosen])
    away = np.linalg.norm(board[chosen, None] - board[None, chosen], axis=2)
    near = (away > 0) & (away < 2.3)
    around = np.array(
        [np.median(misfit[n], axis=0) if n.any() else m for m, n in zip(misfit, near)]
    )
    size = np.linalg.norm(misfit - around, axis=1)
    sigma = np.median(size) / 1.18  # along an axis, from the median of a Rayleigh distribution
    in_line = np.linalg.norm(misfit - _in_line(board[chosen], misfit, around), axis=1)
    off[chosen] = np.minimum(size, in_line) > max(_FAR_OFF_PX, _FAR_OFF_SIGMAS * sigma)
    return off


def _in_line(board: np.ndarray, misfit: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return misfits (n, 2) [px] as the two next corners in each direction have them, in line."""
    cell = np.rint(board - board.min(axis=0)).astype(int) + 2
    grid = np.full((*(cell.max(axis=0) + 3), 2), np.nan)
    grid[tuple(cell.T)] = misfit
    said = [otherwise]
    for step in ((1, 0), (0, 1), (1, 1), (1, -1)):
        ahead, beyond, behind, farther = (grid[tuple((cell + i * np.array(step)).T)] for i in _NEXT)
        said += [2.0 * ahead - beyond, 2.0 * behind - farther, 0.5 * (ahead + behind)]
    return np.nanmedian(np.stack(said), axis=0)
