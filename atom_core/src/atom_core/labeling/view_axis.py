"""Rays of pixels as x/z and y/z about an axis near them, off the middle of a fisheye's image.

About the optical axis a pixel 55 degrees off it weighs three times as much as one in the middle,
so that the outlines of small markers seem to lie off the board; one 82 degrees off weighs fifty
times as much, and beyond 90 degrees there is no x/z at all.
"""

from __future__ import annotations

from typing import NamedTuple, Optional

import numpy as np

from atom_core.geometry.camera import Camera

_OFF_AXIS_DEG = 30.0  # of the optical axis: within it no pixel weighs more than 4/3 of another
_FARTHEST_DEG = 89.0  # for a corner: what takes labels has x/z about the optical axis
_NEAREST = 1e-3  # of z, where a ray does not meet the plane z = 1


class ViewAxis(NamedTuple):
    """A camera that looks along another axis, with the same pixels.

    Attributes:
        camera: with its own axis.
        camera_R_view: (3, 3) rotation; None: the axis is the camera's.
    """

    camera: Camera
    camera_R_view: Optional[np.ndarray] = None

    def normalise(self, pixels: np.ndarray) -> np.ndarray:
        """Return x/z, y/z (n, 2) of pixels (n, 2)."""
        if self.camera_R_view is None:
            return self.camera.normalise(pixels)
        rays = self.camera.unit_rays(pixels) @ self.camera_R_view
        return rays[:, :2] / np.maximum(rays[:, 2:], _NEAREST)

    def project(self, flat: np.ndarray) -> np.ndarray:
        """Return pixels (n, 2) of x/z, y/z (n, 2)."""
        return self.camera.project(self._points(flat))

    def of_use(self, flat: np.ndarray) -> np.ndarray:
        """Return (n,) bool: x/z, y/z (n, 2) that are before the camera, and so of use as labels."""
        if self.camera_R_view is None:
            return np.ones(len(flat), dtype=bool)
        points = self._points(flat)
        least = np.cos(np.radians(_FARTHEST_DEG)) * np.linalg.norm(points, axis=1)
        return np.asarray(points[:, 2] >= least)

    def _points(self, flat: np.ndarray) -> np.ndarray:
        points = np.column_stack([flat, np.ones(len(flat))])
        return points if self.camera_R_view is None else points @ self.camera_R_view.T


def axis_about(camera: Camera, pixels: np.ndarray) -> ViewAxis:
    """Return the axis to use for a board of which these pixels (n, 2) were found."""
    if camera.model != "equidistant":
        return ViewAxis(camera)
    rays = camera.unit_rays(pixels)
    middle = rays.mean(axis=0)
    x = np.array([-middle[1], middle[0], 0.0])  # at right angles to both axes
    if np.all(rays[:, 2] > np.cos(np.radians(_OFF_AXIS_DEG))) or not x.any():
        return ViewAxis(camera)
    middle, x = middle / np.linalg.norm(middle), x / np.linalg.norm(x)
    return ViewAxis(camera, np.column_stack([x, np.cross(middle, x), middle]))
