"""The plane at a pixel of a depth image, and the connected region on it.

From the pixel a four-connected fill runs as far as neighbouring depths differ by little. Within it
a plane grows from the pixel; what lies on it and hangs together is the region.
"""

from __future__ import annotations

from typing import NamedTuple, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.geometry.robust_sigma import robust_sigma
from atom_core.labeling.depth_view import (
    QUANTUM_M,
    DepthView,
    Plane,
    Region,
    closed,
    spread,
    step_m,
)

SEED_REACH_PX = 5
LEAST_FIRST = 40  # points of a plane to begin with
_FIT_POINTS = 2000
_FIRST_RADIUS_PX, _RADIUS_GROWTH = 10.0, 1.3
_LAST_FITS = 15
_INLIER_SIGMAS = 3.5
_FEW_HOLES = 0.03  # of what a flood reached
_DARK_SQUARES = 1.3  # sides, across the largest hole
_NEIGHBOURHOOD_PX = 4  # about the start, in which the region must have a pixel


class PlaneRegion(NamedTuple):
    """A plane and the connected region on it, without holes."""

    plane: Plane
    region: Region


def start_pixel(depth_m: np.ndarray, seed: np.ndarray) -> Optional[np.ndarray]:
    """Return the pixel nearest the seed with a depth near the median of those around it.

    Args:
        depth_m: (height, width) [m].
        seed: (2,) pixel x, y.

    Returns:
        (2,) pixel x, y; None where there is no depth within ``SEED_REACH_PX``.
    """
    x, y = np.rint(seed).astype(int)
    top, left = max(y - SEED_REACH_PX, 0), max(x - SEED_REACH_PX, 0)
    part = depth_m[top : y + SEED_REACH_PX + 1, left : x + SEED_REACH_PX + 1]
    rows, columns = np.nonzero(np.isfinite(part))
    if len(rows) == 0:
        return None
    values = part[rows, columns]
    usual = np.abs(values - np.median(values)) <= step_m(float(np.median(values)))
    away = np.hypot(rows + top - y, columns + left - x) + np.where(usual, 0.0, 100.0)
    nearest = int(np.argmin(away))
    return np.array([columns[nearest] + left, rows[nearest] + top])


def plane_region(view: DepthView, seed: np.ndarray) -> Optional[PlaneRegion]:
    """Return the plane through a pixel (2,) and its region, None where there is none."""
    start = start_pixel(view.solid_m, seed)
    if start is None:
        return None
    z_m = float(view.solid_m[start[1], start[0]])
    reach_px = 1.2 * view.diagonal_m * float(view.camera.focal_px.max()) / z_m
    flood = _flood(view.solid_m, start, reach_px)
    first = _fitted(view, flood, flood, start, from_start=True)
    if first is None:  # it grew into a wall right behind
        near = _near(flood, start, float(view.half_size.min()) * view.focal_px / z_m)
        first = _fitted(view, near, flood, start, from_start=True)
    if first is None:
        return None
    # once more, with what hangs together and with nothing else
    return _fitted(view, first.region, flood, start, from_start=False)


def _near(region: Region, start: np.ndarray, reach_px: float) -> Region:
    """Return the part of a region within some pixels of its start (2,)."""
    circle = np.zeros_like(region.mask)
    centre = (int(start[0]) - region.left, int(start[1]) - region.top)
    cv2.circle(circle, centre, int(reach_px), 1, -1)
    return region._replace(mask=region.mask & circle)


def _fitted(
    view: DepthView, fitted_to: Region, flood: Region, start: np.ndarray, from_start: bool
) -> Optional[PlaneRegion]:
    """Fit a plane to a region; return it and what of the flood lies on it.

    Args:
        view: the image.
        fitted_to: the plane's points.
        flood: where the plane may reach.
        start: (2,) pixel that the result must contain.
        from_start: let the plane grow from there, instead of taking all points at once.
    """
    points = _points(view, fitted_to)
    if points is None:
        return None
    rows, columns = points
    away = np.hypot(columns - start[0], rows - start[1]) if from_start else np.zeros(len(rows))
    plane = grown_plane(view.rays[rows, columns], view.depth_m[rows, columns], away)
    region = None if plane is None else _on_plane(view, plane, flood, start)
    return None if plane is None or region is None else PlaneRegion(plane, region)


def _points(view: DepthView, region: Region) -> Optional[Tuple[np.ndarray, np.ndarray]]:
    """Return rows and columns of enough pixels of a region, None if it is too small."""
    rows, columns = np.nonzero((region.mask > 0) & np.isfinite(view.depth_m[region.window]))
    if len(rows) < view.options.least_pixels:
        return None
    chosen = spread(len(rows), _FIT_POINTS)
    return rows[chosen] + region.top, columns[chosen] + region.left


def _flood(depth_m: np.ndarray, start: np.ndarray, reach_px: float) -> Region:
    """Return what is reached from a pixel by steps to one of four neighbours of similar depth.

    Args:
        depth_m: (height, width) [m].
        start: (2,) pixel with a depth.
        reach_px: no farther than this along the columns and the rows.
    """
    reach = int(min(reach_px, max(depth_m.shape)))
    left, top = (int(v) for v in np.maximum(start - reach, 0))
    part = np.ascontiguousarray(depth_m[top : start[1] + reach + 1, left : start[0] + reach + 1])
    height, width = part.shape
    blocked = np.zeros((height + 2, width + 2), dtype=np.uint8)
    blocked[1:-1, 1:-1] = np.isnan(part)
    step = step_m(float(depth_m[start[1], start[0]]))
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    place = (int(start[0]) - left, int(start[1]) - top)
    _, _, _, (x, y, w, h) = cv2.floodFill(part, blocked, place, 0, step, step, flags)
    mask = (blocked[y + 1 : y + h + 1, x + 1 : x + w + 1] == 2).astype(np.uint8)
    return Region(mask, y + top, x + left)


def grown_plane(rays: np.ndarray, z: np.ndarray, away_px: np.ndarray) -> Optional[Plane]:
    """Return the plane that grows from a pixel over the points that fit it, None if too few do.

    Args:
        rays: (n, 2) normalised pixels.
        z: (n,) depths [m].
        away_px: (n,) distances from the pixel.
    """
    order = np.argsort(away_px)
    rays, z, away_px = rays[order], z[order].astype(float), away_px[order]
    design = np.column_stack([rays, np.ones(len(rays))]).astype(float)
    sigma = depth_sigma_m(z)
    weight = z**2 / sigma  # of 1 / z
    radius = max(_FIRST_RADIUS_PX, away_px[min(len(z) - 1, LEAST_FIRST)])
    use = away_px <= radius
    scale = 1.0
    while True:
        whole = radius >= away_px[-1]
        for _ in range(_LAST_FITS if whole else 2):
            if np.sum(use) < LEAST_FIRST // 4:
                return None
            solution = _least_squares(design[use], weight[use], z[use])
            error = (z - 1.0 / np.maximum(design @ solution, 1e-3)) / sigma
            scale = float(np.clip(robust_sigma(error[use]), 0.3, 2.0))
            before = use
            fits = np.abs(error) <= _INLIER_SIGMAS * scale + QUANTUM_M / sigma
            use = (away_px <= radius) & fits
            if np.array_equal(before, use):
                break
        if whole:
            return Plane(solution, scale)
        radius *= _RADIUS_GROWTH
        use = (away_px <= radius) & fits


def _least_squares(design: np.ndarray, weight: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the plane's inverse depth (3,) that fits 1/z at rows (n, 3) of (x, y, 1)."""
    rows = design * weight[:, None]
    normal = rows.T @ rows
    normal += 1e-9 * np.trace(normal) * np.eye(3)  # points on a line leave the plane open
    return np.linalg.solve(normal, rows.T @ (weight / z))


def _on_plane(view: DepthView, plane: Plane, flood: Region, start: np.ndarray) -> Optional[Region]:
    """Return the connected part about the start of what lies on a plane, holes filled."""
    expected = plane.z(view.rays[flood.window])
    with np.errstate(invalid="ignore"):
        near = np.abs(view.depth_m[flood.window] - expected) <= view.tolerance_m(plane, expected)
    on_plane = (near & (flood.mask > 0)).astype(np.uint8)
    on_plane = _with_dark_squares(view, on_plane, flood, float(view.solid_m[start[1], start[0]]))
    on_plane = cv2.morphologyEx(closed(on_plane), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    # Named, since what OpenCV 4.5.5 takes by itself ends the process (opencv issue 21366).
    count, names, stats, _ = cv2.connectedComponentsWithStatsWithAlgorithm(
        on_plane, 4, cv2.CV_32S, cv2.CCL_WU
    )
    if count < 2:
        return None
    x, y = start[0] - flood.left, start[1] - flood.top
    part = names[
        max(y - _NEIGHBOURHOOD_PX, 0) : y + _NEIGHBOURHOOD_PX + 1,
        max(x - _NEIGHBOURHOOD_PX, 0) : x + _NEIGHBOURHOOD_PX + 1,
    ]
    here = np.bincount(part.ravel(), minlength=count)
    here[0] = 0
    if not here.any():
        return None
    chosen = int(np.argmax(here))
    if stats[chosen, cv2.CC_STAT_AREA] < view.options.least_pixels:
        return None
    return Region(_filled((names == chosen).astype(np.uint8)), flood.top, flood.left)


def _with_dark_squares(
    view: DepthView, on_plane: np.ndarray, flood: Region, z_m: float
) -> np.ndarray:
    """Return a mask with holes that dark squares leave filled, where nothing else is seen."""
    holes = (flood.mask > 0) & np.isnan(view.depth_m[flood.window])
    if np.count_nonzero(holes) < _FEW_HOLES * np.count_nonzero(flood.mask):
        return on_plane
    side = int(np.clip(_DARK_SQUARES * view.square_m * view.focal_px / z_m, 3, 61)) | 1
    return on_plane | (_closed_over(view, on_plane, flood, side) & holes)


def _closed_over(view: DepthView, on_plane: np.ndarray, flood: Region, side_px: int) -> np.ndarray:
    """Return a mask of a flood's window with gaps of some width closed.

    Beyond the image a surface goes on, beyond the window it does not: there is nothing in reach.
    """
    (height, width), image, pad = on_plane.shape, view.depth_m.shape, side_px // 2
    vertical = (flood.top > 0, flood.top + height < image[0])
    horizontal = (flood.left > 0, flood.left + width < image[1])
    above, below, left, right = (pad * inside for inside in (*vertical, *horizontal))
    larger = cv2.copyMakeBorder(on_plane, above, below, left, right, cv2.BORDER_CONSTANT, value=0)
    larger = cv2.morphologyEx(larger, cv2.MORPH_CLOSE, np.ones((side_px, side_px), np.uint8))
    return larger[above : above + height, left : left + width]


def _filled(mask: np.ndarray) -> np.ndarray:
    """Return the mask without holes."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros_like(mask), outlines, -1, 1, cv2.FILLED)
