"""Depth cameras: a depth image, a pixel on the board and the pattern in, the board's pixels out.

From the seed a four-connected fill runs as far as neighbouring depths differ by little. Within it
a plane grows from the seed; what lies on it and hangs together is laid under a rectangle of the
board's size. Only if border, coverage and planarity fit, the region is the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, NamedTuple, Optional, Tuple

import cv2
import numpy as np

from atom_core.errors import LabelingError
from atom_core.geometry.depth_noise import depth_sigma_m
from atom_core.geometry.plane import plane_basis
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.board_fit import BoardFit, fit_board
from atom_core.labeling.polygon import polygon_mask
from atom_core.model.config import PatternConfig
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import DEPTH, Sensor

ENCODINGS = {"16UC1": 0.001, "mono16": 0.001, "32FC1": 1.0}  # metres of a unit (REP 118)
_FACTORS = {
    0.001: "they look like millimetres where metres are expected",
    0.1: "they look like tenths of a millimetre where millimetres are expected",
    10.0: "they look like centimetres where millimetres are expected",
    1000.0: "they look like metres where millimetres are expected",
}
_PLAUSIBLE_M = (0.5, 12.0)  # median depth of a room
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_SQUARE = np.ones((3, 3), dtype=np.uint8)
_WIDER = np.ones((5, 5), dtype=np.uint8)


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


class _Plane(NamedTuple):
    """1/z = inverse_depth . (x, y, 1) of a normalised pixel; ``scale``: noise over the model's."""

    inverse_depth: np.ndarray
    scale: float

    def z(self, rays: np.ndarray) -> np.ndarray:
        """Return the depth (...) [m] at normalised pixels (..., 2)."""
        a, b, c = self.inverse_depth
        return 1.0 / np.maximum(a * rays[..., 0] + b * rays[..., 1] + c, 1e-3)


class _Region(NamedTuple):
    """A part of the image: its mask (uint8), and where its first pixel is (row, column)."""

    mask: np.ndarray
    top: int
    left: int


class DepthLabeler:
    """Finds a board in the depth images of one camera."""

    def __init__(
        self,
        sensor: Sensor,
        pattern: Pattern,
        config: Optional[PatternConfig] = None,
        options: DepthOptions = DepthOptions(),  # noqa: B008 (frozen)
    ):
        """Prepare the rays of all pixels.

        Args:
            sensor: the camera, with intrinsics.
            pattern: the board; its border is what is found.
            config: not used; every labeler takes it.
            options: limits.
        """
        assert sensor.camera is not None
        self.sensor, self.pattern, self.options = sensor, pattern, options
        self.camera = sensor.camera
        row, column = np.mgrid[0 : self.camera.height, 0 : self.camera.width]
        rays = self.camera.normalise(np.column_stack([column.ravel(), row.ravel()]))
        self._rays = rays.reshape(self.camera.height, self.camera.width, 2).astype(np.float32)

    def label(
        self,
        data: np.ndarray,
        seed: Optional[np.ndarray] = None,
        polygon: Optional[np.ndarray] = None,
    ) -> Labeled:
        """Label the board.

        Args:
            data: (height, width) [m]; NaN, infinite or 0 where there is no depth (`to_metres`).
            seed: (2,) pixel x, y on the board; None: search the image for it (`find_board`).
            polygon: (n, 2) pixels; what lies outside is not looked at.

        Returns:
            Indices are ``column + row * width``: every ``step``-th pixel inside the board, and the
            outermost ones on its border, never at the image's edge. ``quality``: ``pixels``,
            ``plane_rms_m``, ``border_rms_m``, ``border_share``, ``coverage``, ``angle_deg``,
            ``distance_m``. ``next_seed`` is the centroid.

        Raises:
            LabelingError: the array is no depth image of this camera, the seed or the polygon is
                outside it, or the depths are in another unit.
        """
        depth_m = self._checked(data)
        if polygon is not None:
            depth_m = _within(depth_m, polygon)
        if seed is None:
            found = self.find_board(depth_m)
        else:
            found = self._from_seed(depth_m, self._checked_seed(seed))
        if not found.detected:
            self._check_unit(depth_m, seed)
        return found

    def find_board(self, depth_m: np.ndarray) -> Labeled:
        """Search the image for a region of the board's size; the one that fits best.

        Args:
            depth_m: (height, width) [m], NaN where there is no depth.
        """
        smooth = np.ascontiguousarray(_smooth(depth_m)[::_COARSE, ::_COARSE])
        best = nothing(DEPTH, "no plane region of the board's size and shape is seen")
        for _ in range(_MOST_REGIONS):
            region = self._next_region(depth_m, smooth)
            if region is None:
                break
            seed, radius_px = region
            larger = self._larger_surface(depth_m, seed)
            if larger is not None:
                smooth[larger] = 0
                continue
            plane_region = self._plane_region(depth_m, seed)
            if plane_region is None:
                _clear_about(smooth, seed, radius_px)
                continue
            found = self._judged(depth_m, *plane_region)
            if _fitness(found) >= max(_LEAST_FITNESS, _fitness(best)):
                best = found
            _clear(smooth, plane_region[1], seed)
        return best

    def _next_region(
        self, depth_m: np.ndarray, smooth: np.ndarray
    ) -> Optional[Tuple[np.ndarray, float]]:
        """Return the pixel deepest inside what is not yet looked at, and how deep it is [px].

        None if nothing is left that is large enough.
        """
        least_m = _LEAST_DEEP * float(self.pattern.border.half_size.min())
        while True:
            away = cv2.distanceTransform(smooth, cv2.DIST_L2, 3)
            _, deepest, _, place = cv2.minMaxLoc(away)
            if _COARSE * deepest < _LEAST_DEEP_PX:
                return None
            seed = _COARSE * np.array(place)
            pixel_m = float(depth_m[seed[1], seed[0]]) / float(self.camera.focal_px.mean())
            if not _COARSE * deepest * pixel_m < least_m:
                return seed, _COARSE * deepest
            cv2.circle(smooth, place, int(deepest) + 1, 0, -1)

    def _larger_surface(self, depth_m: np.ndarray, seed: np.ndarray) -> Optional[np.ndarray]:
        """Return the pixels, coarse, of the plane at a seed if it is larger than a board.

        Floors and walls would cost most of a search. They are known by a circle about the seed that
        no board reaches.
        """
        x, y = (int(v) for v in seed)
        z_m, focal = float(depth_m[y, x]), float(self.camera.focal_px.mean())
        if not np.isfinite(z_m):
            return None
        diagonal_m = 2.0 * float(np.hypot(*self.pattern.border.half_size))
        reach = int(np.clip(_PATCH * diagonal_m * focal / z_m, 3, 60))
        step = max(reach // 6, 1)
        rows, columns = np.mgrid[y - reach : y + reach + 1 : step, x - reach : x + reach + 1 : step]
        patch = self._with_depth(depth_m, rows.ravel(), columns.ravel())
        if len(patch[0]) < _LEAST_FIRST:
            return None
        away = np.hypot(patch[0] - y, patch[1] - x)
        plane = _grown_plane(self._rays[patch], depth_m[patch], away)
        if plane is None:
            return None
        ring = self._with_depth(depth_m, *self._circle(plane, seed, _BEYOND * diagonal_m))
        if len(ring[0]) < _LEAST_RING:
            return None
        seen = depth_m[ring]
        off = np.abs(seen - plane.z(self._rays[ring]))
        near = off <= _FAR_TOLERANCE * self._tolerance_m(plane, seen)
        if np.mean(near) < _LARGER_SHARE:
            return None
        seen, everywhere = depth_m[::_COARSE, ::_COARSE], plane.z(self._rays[::_COARSE, ::_COARSE])
        with np.errstate(invalid="ignore"):
            return np.abs(seen - everywhere) <= self._tolerance_m(plane, seen)

    def _circle(
        self, plane: _Plane, seed: np.ndarray, radius_m: float
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return rows and columns of pixels on a circle in a plane about the seed's point."""
        axes = _PlaneAxes(plane)
        middle = axes.to_plane(self._rays[int(seed[1]), int(seed[0])][None])
        angle = np.arange(0.0, 2.0 * np.pi, np.pi / 24)
        points = axes.to_camera(middle + radius_m * np.column_stack([np.cos(angle), np.sin(angle)]))
        pixels = np.rint(self.camera.project(points[points[:, 2] > 0.1])).astype(int)
        return pixels[:, 1], pixels[:, 0]

    def _with_depth(
        self, depth_m: np.ndarray, rows: np.ndarray, columns: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return those of the pixels that the image holds and that have a depth."""
        height, width = depth_m.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        rows, columns = rows[inside], columns[inside]
        known = np.isfinite(depth_m[rows, columns])
        return rows[known], columns[known]

    def _from_seed(self, depth_m: np.ndarray, seed: np.ndarray) -> Labeled:
        if self._start(depth_m, seed) is None:
            return nothing(DEPTH, f"no depth within {_SEED_REACH_PX} px of the seed")
        plane_region = self._plane_region(depth_m, seed)
        if plane_region is None:
            return nothing(DEPTH, "what is seen at the seed is no plane of the least size")
        return self._judged(depth_m, *plane_region)

    def _start(self, depth_m: np.ndarray, seed: np.ndarray) -> Optional[np.ndarray]:
        """Return the pixel nearest the seed with a depth near the median of those around it."""
        x, y = np.rint(seed).astype(int)
        top, left = max(y - _SEED_REACH_PX, 0), max(x - _SEED_REACH_PX, 0)
        part = depth_m[top : y + _SEED_REACH_PX + 1, left : x + _SEED_REACH_PX + 1]
        rows, columns = np.nonzero(np.isfinite(part))
        if len(rows) == 0:
            return None
        values = part[rows, columns]
        usual = np.abs(values - np.median(values)) <= _step_m(float(np.median(values)))
        away = np.hypot(rows + top - y, columns + left - x) + np.where(usual, 0.0, 100.0)
        nearest = int(np.argmin(away))
        return np.array([columns[nearest] + left, rows[nearest] + top])

    def _plane_region(
        self, depth_m: np.ndarray, seed: np.ndarray
    ) -> Optional[Tuple[_Plane, _Region]]:
        """Return the plane through the seed and the connected region on it, without holes."""
        start = self._start(depth_m, seed)
        if start is None:
            return None
        z_m = float(depth_m[start[1], start[0]])
        widest = 2.0 * float(np.hypot(*self.pattern.border.half_size))
        flood = _flood(depth_m, start, 1.2 * widest * float(self.camera.focal_px.max()) / z_m)
        points = self._points(depth_m, flood)
        if points is None:
            return None
        rows, columns = points
        away = np.hypot(columns - start[0], rows - start[1])
        plane = _grown_plane(self._rays[rows, columns], depth_m[rows, columns], away)
        region = None if plane is None else self._on_plane(depth_m, plane, flood, start)
        points = None if region is None else self._points(depth_m, region)
        if points is None:
            return None
        rows, columns = points  # once more, with what hangs together and with nothing else
        away = np.zeros(len(rows))
        plane = _grown_plane(self._rays[rows, columns], depth_m[rows, columns], away)
        region = None if plane is None else self._on_plane(depth_m, plane, flood, start)
        return None if plane is None or region is None else (plane, region)

    def _points(
        self, depth_m: np.ndarray, region: _Region
    ) -> Optional[Tuple[np.ndarray, np.ndarray]]:
        """Return rows and columns of enough pixels of a region, None if it is too small."""
        rows, columns = np.nonzero((region.mask > 0) & np.isfinite(depth_m[_window(region)]))
        if len(rows) < self.options.least_pixels:
            return None
        chosen = _spread(len(rows), _FIT_POINTS)
        return rows[chosen] + region.top, columns[chosen] + region.left

    def _on_plane(
        self, depth_m: np.ndarray, plane: _Plane, flood: _Region, start: np.ndarray
    ) -> Optional[_Region]:
        window = _window(flood)
        z = depth_m[window]
        expected = plane.z(self._rays[window])
        with np.errstate(invalid="ignore"):
            near = np.abs(z - expected) <= self._tolerance_m(plane, expected)
        on_plane = (near & (flood.mask > 0)).astype(np.uint8)
        on_plane = cv2.morphologyEx(_closed(on_plane), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
        count, names, stats, _ = cv2.connectedComponentsWithStats(on_plane, connectivity=4)
        if count < 2:
            return None
        part = names[
            max(start[1] - flood.top - 4, 0) : start[1] - flood.top + 5,
            max(start[0] - flood.left - 4, 0) : start[0] - flood.left + 5,
        ]
        here = np.bincount(part.ravel(), minlength=count)
        here[0] = 0
        if not here.any():
            return None
        chosen = int(np.argmax(here))
        if stats[chosen, cv2.CC_STAT_AREA] < self.options.least_pixels:
            return None
        return _Region(_filled((names == chosen).astype(np.uint8)), flood.top, flood.left)

    def _tolerance_m(self, plane: _Plane, z_m: np.ndarray) -> np.ndarray:
        return self.options.plane_sigmas * plane.scale * depth_sigma_m(z_m) + _QUANTUM_M

    def _judged(self, depth_m: np.ndarray, plane: _Plane, region: _Region) -> Labeled:
        """Return the label if the region is the board, else the reason why it is none."""
        axes, half = _PlaneAxes(plane), self.pattern.border.half_size
        middle = self._rays[_window(region)][region.mask > 0].mean(axis=0)
        quality: Dict[str, float] = {"angle_deg": axes.angle_deg(middle)}
        quality["distance_m"] = float(plane.z(middle))
        if quality["angle_deg"] > self.options.largest_angle_deg:
            return nothing(DEPTH, _too("slanted", quality["angle_deg"], "deg"), quality)
        pixel_m = quality["distance_m"] / float(self.camera.focal_px.mean())
        slant = float(np.cos(np.radians(quality["angle_deg"])))
        region = _without_posts(region, 2.0 * float(half.min()) * slant / pixel_m)
        quality["pixels"] = float(np.count_nonzero(region.mask))
        inner = self._in_plane(axes, region, *_thinned(region.mask))
        quality["extent_m"] = _extent(inner)
        if quality["extent_m"] > 2.0 * _LARGEST_EXTENT * float(np.hypot(*half)):
            return nothing(DEPTH, _too("large", quality["extent_m"], "m across"), quality)
        rows, columns = np.nonzero(_outermost(region.mask))
        far = self._off_the_edge(rows + region.top, columns + region.left)
        if np.sum(far) < _LEAST_BORDER_PX:
            reason = "the region fills the image; none of its border is seen: a wall, or too near"
            return nothing(DEPTH, reason, quality)
        border = self._in_plane(axes, region, rows[far], columns[far])
        tolerance = max(_BORDER_M, 1.5 * pixel_m / slant)
        fit = fit_board(border[_spread(len(border), _BORDER_POINTS)], inner, half, tolerance)
        return self._fitting(depth_m, plane, region, fit, axes, tolerance, quality)

    def _in_plane(
        self, axes: _PlaneAxes, region: _Region, rows: np.ndarray, columns: np.ndarray
    ) -> np.ndarray:
        """Return pixels of a region's window in the plane (n, 2) [m]."""
        return axes.to_plane(self._rays[rows + region.top, columns + region.left])

    def _fitting(
        self,
        depth_m: np.ndarray,
        plane: _Plane,
        region: _Region,
        fit: BoardFit,
        axes: _PlaneAxes,
        tolerance: float,
        quality: Dict[str, float],
    ) -> Labeled:
        """Compare the region with the board that was laid on it."""
        on = np.abs(fit.distance) <= 2.0 * tolerance
        quality["border_share"] = float(np.mean(on))
        quality["border_rms_m"] = (
            float(np.sqrt(np.mean(fit.distance[on] ** 2))) if on.any() else 1.0
        )
        solid = region.mask & self._drawn(fit, axes, region, 0.0)
        solid = cv2.morphologyEx(solid, cv2.MORPH_OPEN, _CROSS)
        quality["coverage"] = self._coverage(fit, axes, region, solid)
        quality["before_share"] = self._before(depth_m, plane, _Region(solid, *region[1:]))
        around = self._drawn(fit, axes, region, 2.0 * tolerance)
        beyond = 1.0 - np.count_nonzero(region.mask & around) / quality["pixels"]
        reason = self._reason(quality, fit, beyond)
        if reason:
            return nothing(DEPTH, reason, quality)
        return self._labeled(depth_m, plane, _Region(solid, *region[1:]), fit, axes, quality)

    def _drawn(
        self, fit: BoardFit, axes: _PlaneAxes, region: _Region, larger_m: float
    ) -> np.ndarray:
        """Return the region's window, 1 where a pixel's centre is on the board or next to it."""
        pixels = self.camera.project(axes.to_camera(fit.outline(larger_m)))
        corners = np.clip(pixels - [region.left, region.top], -1e4, 1e4)
        fine = np.rint(corners * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)
        picture = np.zeros_like(region.mask)
        return cv2.fillPoly(picture, [fine], 1, lineType=cv2.LINE_8, shift=_SHIFT)

    def _reason(self, quality: Dict[str, float], fit: BoardFit, beyond: float) -> str:
        """Tell why the region is not the board, '' if it is."""
        if quality["border_share"] < self.options.least_border_share:
            share = quality["border_share"]
            return f"only {share:.0%} of the region's border lies on a border of the board's size"
        if beyond > _LARGEST_BEYOND:
            return f"{beyond:.0%} of the region lies outside a board's size"
        if quality["coverage"] < self.options.least_coverage:
            return f"the region covers only {quality['coverage']:.0%} of the board's part in view"
        if quality["before_share"] < self.options.least_before_share:
            share = quality["before_share"]
            return f"the region stands before its surroundings on {share:.0%} of its border only"
        if not fit.corner:
            return "no corner of the board is seen; a longer edge of something else looks the same"
        return ""

    def _before(self, depth_m: np.ndarray, plane: _Plane, region: _Region) -> float:
        """Return the share of the pixels around a region that lie behind its plane.

        A board stands before what is around it. A piece of floor between the legs of a tripod
        does not: they stand before it, or it goes on.
        """
        wide = 4
        top, left = max(region.top - wide, 0), max(region.left - wide, 0)
        height, width = region.mask.shape
        bottom, right = region.top + height + wide, region.left + width + wide
        z, rays = depth_m[top:bottom, left:right], self._rays[top:bottom, left:right]
        mask = np.zeros(z.shape, dtype=np.uint8)
        inner = mask[region.top - top :, region.left - left :]
        inner[:height, :width] = region.mask
        ring = cv2.dilate(mask, np.ones((7, 7), np.uint8)) - cv2.dilate(mask, _WIDER)
        here = (ring > 0) & np.isfinite(z)
        expected = plane.z(rays[here])
        behind = z[here] - expected > self._tolerance_m(plane, expected)
        return float(np.mean(behind)) if behind.size else 1.0

    def _coverage(
        self, fit: BoardFit, axes: _PlaneAxes, region: _Region, solid: np.ndarray
    ) -> float:
        """Return the share of the board's part in the image that the region covers."""
        steps = np.linspace(-0.94, 0.94, 24)
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * fit.half_size
        points = axes.to_camera(fit.centre + grid @ fit.plane_R_board.T)
        pixels = np.rint(self.camera.project(points)).astype(int)
        size = [self.camera.width, self.camera.height]
        seen = np.all((pixels >= 0) & (pixels < size), axis=1) & (points[:, 2] > 0)
        if not seen.any():
            return 0.0
        column, row = (pixels[seen] - [region.left, region.top]).T
        height, width = solid.shape
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        covered = solid[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] > 0
        return float(np.mean(inside & covered))

    def _labeled(
        self,
        depth_m: np.ndarray,
        plane: _Plane,
        region: _Region,
        fit: BoardFit,
        axes: _PlaneAxes,
        quality: Dict[str, float],
    ) -> Labeled:
        solid = region.mask
        window = _window(region)
        z, expected = depth_m[window], plane.z(self._rays[window])
        with np.errstate(invalid="ignore"):
            good = np.abs(z - expected) <= self._tolerance_m(plane, expected)
        grid = np.zeros_like(solid, dtype=bool)
        step = self.options.step
        grid[(-region.top) % step :: step, (-region.left) % step :: step] = True
        inner = _eroded(solid) > 0
        rows, columns = np.nonzero(inner & good & grid)
        edge_rows, edge_columns = np.nonzero((_outermost(solid) > 0) & good)
        far = self._off_the_edge(edge_rows + region.top, edge_columns + region.left)
        border = self._in_plane(axes, region, edge_rows, edge_columns)
        pixel_m = quality["distance_m"] / float(self.camera.focal_px.mean())
        far &= fit.signed_distance(border) >= -4.0 * pixel_m - _BORDER_M
        error = (z - expected)[inner & good]
        quality["plane_rms_m"] = float(np.sqrt(np.mean(error**2))) if error.size else np.inf
        quality["pixels"] = float(np.count_nonzero(solid))
        all_rows, all_columns = np.nonzero(solid)
        centroid = np.array([all_columns.mean() + region.left, all_rows.mean() + region.top])
        label = RangeLabel(
            self._index(rows + region.top, columns + region.left),
            self._index(edge_rows[far] + region.top, edge_columns[far] + region.left),
        )
        if not label.detected:
            return nothing(DEPTH, "no depth inside the board", quality)
        return Labeled(label, quality=quality, next_seed=centroid)

    def _index(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return columns + rows * self.camera.width

    def _off_the_edge(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        margin = self.options.image_margin_px
        return (
            (rows >= margin)
            & (rows < self.camera.height - margin)
            & (columns >= margin)
            & (columns < self.camera.width - margin)
        )

    def _checked(self, data: np.ndarray) -> np.ndarray:
        data = np.asarray(data)
        name, camera = f"sensor '{self.sensor.name}'", self.camera
        if data.ndim != 2 or data.dtype.kind != "f":
            raise LabelingError(
                f"{name}: a depth image is (height, width) of real numbers in metres, not "
                f"{data.shape} of {data.dtype.name}; convert it with to_metres"
            )
        if data.shape != (camera.height, camera.width):
            raise LabelingError(
                f"{name}: the depth image is {data.shape[1]} x {data.shape[0]} pixels, its "
                f"camera_info says {camera.width} x {camera.height}; they do not belong together"
            )
        depth_m = data.astype(np.float32)
        depth_m[~(depth_m > 0) | ~np.isfinite(depth_m)] = np.nan
        return depth_m

    def _checked_seed(self, seed: np.ndarray) -> np.ndarray:
        seed = np.asarray(seed, dtype=float).ravel()
        size = np.array([self.camera.width, self.camera.height])
        if seed.shape != (2,) or not np.all((seed >= -0.5) & (seed <= size - 0.5)):
            raise LabelingError(
                f"sensor '{self.sensor.name}': seed {seed.tolist()} is no pixel (x, y) of an image "
                f"of {size[0]} x {size[1]}"
            )
        return seed

    def _check_unit(self, depth_m: np.ndarray, seed: Optional[np.ndarray]) -> None:
        """Raise an error when no board is found, but one is with depths of another unit."""
        valid = depth_m[::8, ::8][np.isfinite(depth_m[::8, ::8])]
        if len(valid) == 0 or _PLAUSIBLE_M[0] <= np.median(valid) <= _PLAUSIBLE_M[1]:
            return
        for factor, meaning in _FACTORS.items():
            scaled = depth_m * np.float32(factor)
            found = self.find_board(scaled) if seed is None else self._from_seed(scaled, seed)
            if found.detected:
                raise LabelingError(
                    f"sensor '{self.sensor.name}': the board has its size only when depths are "
                    f"multiplied by {factor:g}; {meaning}; correct the encoding or the driver"
                )


_SHIFT = 4  # binary digits of a pixel for drawing
_POST_SHARE, _LEAST_CORE = 0.15, 0.7
_MOST_REGIONS = 30
_LEAST_FITNESS = 0.85  # of what was searched: nobody said that the board is there
_COARSE = 2  # pixels, of the map of what is searched
_LEAST_DEEP_PX, _LEAST_DEEP = (
    5.0,
    0.15,
)  # from a region's middle to its border; share of the board's
_SEED_REACH_PX = 5
_PATCH, _BEYOND = 0.3, 1.02  # of the diagonal: what a first plane is fitted to; farther is no board
_LEAST_RING, _LARGER_SHARE, _FAR_TOLERANCE = 6, 0.4, 2.0
_FIT_POINTS, _BORDER_POINTS = 2000, 400
_LEAST_BORDER_PX = 12
_BORDER_M = 0.012
_LARGEST_EXTENT, _LARGEST_BEYOND = 1.1, 0.05
_QUANTUM_M = 0.001
_FIRST_RADIUS_PX, _RADIUS_GROWTH = 10.0, 1.3


def to_metres(image: np.ndarray, encoding: str) -> np.ndarray:
    """Return a depth image (height, width) float32 [m], NaN where there is no depth.

    Args:
        image: (height, width), uint16 in millimetres or float32 in metres.
        encoding: ``16UC1``, ``mono16`` or ``32FC1`` (REP 118).

    Raises:
        LabelingError: another encoding, or one that does not fit the array.
    """
    image = np.asarray(image)
    wanted = {"32FC1": np.float32}.get(encoding, np.uint16)
    if encoding not in ENCODINGS:
        raise LabelingError(
            f"encoding '{encoding}' is none of depth images; publish {', '.join(ENCODINGS)}"
        )
    if image.ndim != 2 or image.size == 0 or image.dtype != wanted:
        raise LabelingError(
            f"a depth image of encoding {encoding} is (height, width) of {np.dtype(wanted).name}, "
            f"not {image.shape} of {image.dtype.name}"
        )
    depth_m = image.astype(np.float32) * np.float32(ENCODINGS[encoding])
    depth_m[~(depth_m > 0) | ~np.isfinite(depth_m)] = np.nan
    return depth_m


class _PlaneAxes:
    """Coordinates [m] in the plane."""

    def __init__(self, plane: _Plane):
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


def _step_m(z_m: float) -> float:
    """Return by how much neighbours on one board may differ: noise, slant, rounding."""
    z = min(z_m, 8.0)
    return 0.02 + 3.0 * float(depth_sigma_m(np.array(z)))


def _flood(depth_m: np.ndarray, start: np.ndarray, reach_px: float) -> _Region:
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
    step = _step_m(float(depth_m[start[1], start[0]]))
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    place = (int(start[0]) - left, int(start[1]) - top)
    _, _, _, (x, y, w, h) = cv2.floodFill(part, blocked, place, 0, step, step, flags)
    mask = (blocked[y + 1 : y + h + 1, x + 1 : x + w + 1] == 2).astype(np.uint8)
    return _Region(mask, y + top, x + left)


def _grown_plane(rays: np.ndarray, z: np.ndarray, away_px: np.ndarray) -> Optional[_Plane]:
    """Return the plane that grows from the seed over the points (n, 2), (n,) [m] that fit it."""
    order = np.argsort(away_px)
    rays, z, away_px = rays[order], z[order].astype(float), away_px[order]
    design = np.column_stack([rays, np.ones(len(rays))]).astype(float)
    sigma = depth_sigma_m(z)
    weight = z**2 / sigma  # of 1 / z
    radius = max(_FIRST_RADIUS_PX, away_px[min(len(z) - 1, _LEAST_FIRST)])
    use = away_px <= radius
    scale = 1.0
    while True:
        whole = radius >= away_px[-1]
        for _ in range(_LAST_FITS if whole else 2):
            if np.sum(use) < _LEAST_FIRST // 4:
                return None
            w = weight[use]
            rows = design[use] * w[:, None]
            normal = rows.T @ rows
            normal += 1e-9 * np.trace(normal) * np.eye(3)  # points on a line leave the plane open
            solution = np.linalg.solve(normal, rows.T @ (w / z[use]))
            error = (z - 1.0 / np.maximum(design @ solution, 1e-3)) / sigma
            scale = float(np.clip(1.4826 * np.median(np.abs(error[use])), 0.3, 2.0))
            before = use
            use = (away_px <= radius) & (np.abs(error) <= 3.5 * scale + _QUANTUM_M / sigma)
            if np.array_equal(before, use):
                break
        if whole:
            return _Plane(solution, scale)
        radius *= _RADIUS_GROWTH
        use = (away_px <= radius) & (np.abs(error) <= 3.5 * scale + _QUANTUM_M / sigma)


_LAST_FITS = 15
_LEAST_FIRST = 40


def _window(region: _Region) -> Tuple[slice, slice]:
    height, width = region.mask.shape
    return slice(region.top, region.top + height), slice(region.left, region.left + width)


def _closed(mask: np.ndarray) -> np.ndarray:
    """Return the mask with lost pixels inside filled; its outline stays."""
    padded = cv2.copyMakeBorder(mask, 2, 2, 2, 2, cv2.BORDER_REPLICATE)
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, _CROSS)[2:-2, 2:-2]


def _filled(mask: np.ndarray) -> np.ndarray:
    """Return the mask without holes."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros_like(mask), outlines, -1, 1, cv2.FILLED)


def _without_posts(region: _Region, width_px: float) -> _Region:
    """Return the region without what is much narrower than the board: the post that carries it.

    Args:
        region: on the plane, without holes.
        width_px: the board's shorter side, foreshortened [px].
    """
    side = int(np.clip(_POST_SHARE * width_px, 3, 41)) | 1
    kernel = np.ones((side, side), np.uint8)
    wide = cv2.dilate(cv2.morphologyEx(region.mask, cv2.MORPH_OPEN, kernel), kernel)
    core = region.mask & wide
    if np.count_nonzero(core) < _LEAST_CORE * np.count_nonzero(region.mask):
        return region  # all of it is narrow: a corner of the board at the image's edge
    return _Region(core, region.top, region.left)


def _eroded(mask: np.ndarray) -> np.ndarray:
    return cv2.erode(mask, _SQUARE, borderType=cv2.BORDER_CONSTANT, borderValue=0)


def _outermost(mask: np.ndarray) -> np.ndarray:
    """Return the mask's pixels beside one outside it; the window's edge counts as outside."""
    return mask & ~cv2.erode(mask, _CROSS, borderType=cv2.BORDER_CONSTANT, borderValue=0)


def _spread(count: int, wanted: int) -> np.ndarray:
    """Return about as many of ``count`` indices as wanted, at no regular distance."""
    if count <= wanted:
        return np.arange(count)
    number = np.arange(wanted)
    # golden ratio: a regular step would pick lines of pixels
    return ((number + (number * 0.6180339887) % 1.0) * count / wanted).astype(int)


def _thinned(mask: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of some hundred pixels of a mask."""
    rows, columns = np.nonzero(mask)
    step = max(len(rows) // 600, 1)
    return rows[::step], columns[::step]


def _extent(points: np.ndarray) -> float:
    """Return the largest extent of points (n, 2) in any direction, to 1 % [m]."""
    angles = np.radians(np.arange(0.0, 180.0, 15.0))
    return float(np.max(np.ptp(points @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)))


def _smooth(depth_m: np.ndarray) -> np.ndarray:
    """Return uint8 (height, width): 1 where a depth is like that of its neighbours."""
    z = np.nan_to_num(depth_m, nan=0.0)
    step = 0.02 + 6.0 * depth_sigma_m(np.minimum(z, 8.0))
    highest, lowest = cv2.dilate(z, _CROSS), cv2.erode(np.where(z > 0, z, 1e6), _CROSS)
    smooth = (z > 0) & (highest - z <= step) & (z - lowest <= step)
    return _closed(smooth.astype(np.uint8))


def _clear(smooth: np.ndarray, region: _Region, seed: np.ndarray) -> None:
    """Take a region that was looked at out of the search."""
    grown = cv2.dilate(region.mask, np.ones((5, 5), np.uint8))
    part = grown[-region.top % _COARSE :: _COARSE, -region.left % _COARSE :: _COARSE]
    top, left = -(-region.top // _COARSE), -(-region.left // _COARSE)
    smooth[top : top + part.shape[0], left : left + part.shape[1]][part > 0] = 0
    _clear_about(smooth, seed, 6.0)


def _clear_about(smooth: np.ndarray, seed: np.ndarray, radius_px: float) -> None:
    x, y = (int(v) // _COARSE for v in seed)
    cv2.circle(smooth, (x, y), int(np.ceil(radius_px / _COARSE)), 0, -1)


def _fitness(found: Labeled) -> float:
    if not found.detected:
        return 0.0
    return found.quality["border_share"] * found.quality["coverage"]


def _within(depth_m: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    return np.where(polygon_mask(polygon, depth_m.shape) > 0, depth_m, np.float32(np.nan))


def _too(what: str, value: float, unit: str) -> str:
    return f"the region is too {what} for the board ({value:.3g} {unit})"
