"""Rays along which sensors measure, spread over what they see."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from atom_core.geometry.camera import Camera

_GRID = (17, 11)  # of a camera, across and down its image
_AZIMUTHS_DEG = np.arange(-180.0, 180.0, 7.5)


def camera_rays(camera: Camera) -> np.ndarray:
    """Return unit rays (n, 3) through the image, the optical axis first, then by their angle."""
    columns = np.linspace(0, camera.width - 1, _GRID[0])
    rows = np.linspace(0, camera.height - 1, _GRID[1])
    pixels = np.array([(u, v) for u in columns for v in rows])
    rays = np.column_stack([camera.normalise(pixels), np.ones(len(pixels))])
    return _by_angle(rays, np.array([0.0, 0.0, 1.0]))


def spinning_rays(elevations_deg: Sequence[float]) -> np.ndarray:
    """Return unit rays (n, 3) all around z, the x axis first, then by their angle to it."""
    azimuth, elevation = np.deg2rad([(a, e) for a in _AZIMUTHS_DEG for e in elevations_deg]).T
    level = np.cos(elevation)
    rays = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    return _by_angle(rays, np.array([1.0, 0.0, 0.0]))


def _by_angle(rays: np.ndarray, axis: np.ndarray) -> np.ndarray:
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    order = np.argsort(-(rays @ axis), kind="stable")
    return np.vstack([axis, rays[order]])
