"""Where a board may be in a depth image when nobody says so: smooth regions, the deepest first."""

from __future__ import annotations

from typing import Iterator, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.labeling.depth_plane import (
    LEAST_FIRST,
    PlaneRegion,
    grown_plane,
    plane_region,
)
from atom_core.labeling.depth_view import (
    CROSS,
    DepthView,
    Plane,
    PlaneAxes,
    Region,
    closed,
    spread,
)

_MOST_REGIONS = 30
_COARSE = 2  # pixels, of the map of what is searched
_LEAST_DEEP_PX = 5.0  # from a region's middle to its border
_LEAST_DEEP = 0.15  # the same as a share of the board's shorter half side
_PATCH, _BEYOND = 0.3, 1.02  # of the diagonal: what a first plane is fitted to; farther is no board
_LEAST_RING, _LARGER_SHARE, _FAR_TOLERANCE = 6, 0.4, 2.0
_BEHIND = 0.6  # tolerances of a pixel: 2 sigmas
_FITS, _FIT_POINTS = 2, 2000  # of a larger surface
_ON_PLANE, _AROUND = 0.5, (5, 5)  # tolerances, on the average of so many pixels


def plane_regions(view: DepthView) -> Iterator[PlaneRegion]:
    """Yield planes with their regions that may be the board, each part of the image once."""
    smooth = np.ascontiguousarray(_smooth(view.solid_m)[::_COARSE, ::_COARSE])
    for _ in range(_MOST_REGIONS):
        place = _next_place(view, smooth)
        if place is None:
            return
        seed, radius_px = place
        larger = _larger_surface(view, seed)
        if larger is not None:
            smooth[larger] = 0
            continue
        found = plane_region(view, seed)
        if found is None:
            _clear_about(smooth, seed, radius_px)
            continue
        yield found
        _clear(smooth, found.region, seed)


def _smooth(depth_m: np.ndarray) -> np.ndarray:
    """Return uint8 (height, width): 1 where a depth is like that of its neighbours."""
    z = np.nan_to_num(depth_m, nan=0.0)
    step = 0.02 + 6.0 * depth_sigma_m(np.minimum(z, 8.0))
    highest, lowest = cv2.dilate(z, CROSS), cv2.erode(np.where(z > 0, z, 1e6), CROSS)
    smooth = (z > 0) & (highest - z <= step) & (z - lowest <= step)
    return closed(smooth.astype(np.uint8))


def _next_place(view: DepthView, smooth: np.ndarray) -> Optional[Tuple[np.ndarray, float]]:
    """Return the pixel deepest inside what is not yet looked at, and how deep it is [px].

    None if nothing is left that is large enough.
    """
    least_m = _LEAST_DEEP * float(view.half_size.min())
    while True:
        away = cv2.distanceTransform(smooth, cv2.DIST_L2, 3)
        _, deepest, _, place = cv2.minMaxLoc(away)
        if _COARSE * deepest < _LEAST_DEEP_PX:
            return None
        seed = _COARSE * np.array(place)
        pixel_m = float(view.solid_m[seed[1], seed[0]]) / view.focal_px
        if not _COARSE * deepest * pixel_m < least_m:
            return seed, _COARSE * deepest
        cv2.circle(smooth, place, int(deepest) + 1, 0, -1)


def _larger_surface(view: DepthView, seed: np.ndarray) -> Optional[np.ndarray]:
    """Return the pixels, coarse, of the plane at a seed if it is larger than a board.

    Floors and walls would cost most of a search. They are known by a circle about the seed that
    no board reaches.
    """
    plane = _patch_plane(view, seed)
    if plane is None:
        return None
    ring = _with_depth(view.depth_m, *_circle(view, plane, seed, _BEYOND * view.diagonal_m))
    if len(ring[0]) < _LEAST_RING:
        return None
    seen = view.depth_m[ring]
    off = (seen - plane.z(view.rays[ring])) / view.tolerance_m(plane, seen)
    if np.mean(np.abs(off) <= _FAR_TOLERANCE) < _LARGER_SHARE or np.median(off) > _BEHIND:
        return None  # a wall right behind a board is all behind its plane
    return _on_plane(view, plane)


def _on_plane(view: DepthView, plane: Plane) -> np.ndarray:
    """Return the pixels, coarse, that lie on a plane on the average of those around them.

    The plane is fitted again to all that it meets: a board right before a wall is off the wall's
    plane by little more than the noise of a pixel.
    """
    seen, rays = view.depth_m[::_COARSE, ::_COARSE], view.rays[::_COARSE, ::_COARSE]
    for _ in range(_FITS):
        with np.errstate(invalid="ignore"):
            near = np.abs(seen - plane.z(rays)) <= view.tolerance_m(plane, seen)
        rows, columns = np.nonzero(near)
        chosen = spread(len(rows), _FIT_POINTS)
        at = rows[chosen], columns[chosen]
        again = grown_plane(rays[at], seen[at], np.zeros(len(chosen)))
        if again is None:
            break
        plane = again
    off = (seen - plane.z(rays)) / view.tolerance_m(plane, seen)
    known = np.isfinite(off)
    off = cv2.blur(np.where(known, np.clip(off, -2.0, 2.0), 0.0).astype(np.float32), _AROUND)
    share = cv2.blur(known.astype(np.float32), _AROUND)
    return known & (np.abs(off) <= _ON_PLANE * share)


def _patch_plane(view: DepthView, seed: np.ndarray) -> Optional[Plane]:
    """Return the plane of a few pixels about a seed, None where there is none."""
    x, y = (int(v) for v in seed)
    z_m = float(view.solid_m[y, x])
    if not np.isfinite(z_m):
        return None
    reach = int(np.clip(_PATCH * view.diagonal_m * view.focal_px / z_m, 3, 60))
    step = max(reach // 6, 1)
    rows, columns = np.mgrid[y - reach : y + reach + 1 : step, x - reach : x + reach + 1 : step]
    patch = _with_depth(view.depth_m, rows.ravel(), columns.ravel())
    if len(patch[0]) < LEAST_FIRST:
        return None
    away = np.hypot(patch[0] - y, patch[1] - x)
    return grown_plane(view.rays[patch], view.depth_m[patch], away)


def _circle(
    view: DepthView, plane: Plane, seed: np.ndarray, radius_m: float
) -> Tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of pixels on a circle in a plane about the seed's point."""
    axes = PlaneAxes(plane)
    middle = axes.to_plane(view.rays[int(seed[1]), int(seed[0])][None])
    angle = np.arange(0.0, 2.0 * np.pi, np.pi / 24)
    points = axes.to_camera(middle + radius_m * np.column_stack([np.cos(angle), np.sin(angle)]))
    pixels = np.rint(view.camera.project(points[points[:, 2] > 0.1])).astype(int)
    return pixels[:, 1], pixels[:, 0]


def _with_depth(
    depth_m: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return those of the pixels that the image holds and that have a depth."""
    height, width = depth_m.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = rows[inside], columns[inside]
    known = np.isfinite(depth_m[rows, columns])
    return rows[known], columns[known]


def _clear(smooth: np.ndarray, region: Region, seed: np.ndarray) -> None:
    """Take a region that was looked at out of the search."""
    grown = cv2.dilate(region.mask, np.ones((5, 5), np.uint8))
    part = grown[-region.top % _COARSE :: _COARSE, -region.left % _COARSE :: _COARSE]
    top, left = -(-region.top // _COARSE), -(-region.left // _COARSE)
    smooth[top : top + part.shape[0], left : left + part.shape[1]][part > 0] = 0
    _clear_about(smooth, seed, 6.0)


def _clear_about(smooth: np.ndarray, seed: np.ndarray, radius_px: float) -> None:
    x, y = (int(v) // _COARSE for v in seed)
    cv2.circle(smooth, (x, y), int(np.ceil(radius_px / _COARSE)), 0, -1)
