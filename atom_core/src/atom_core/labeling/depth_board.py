"""Whether a plane region of a depth image is the board: border, coverage and surroundings fit."""

from __future__ import annotations

from typing import Dict, NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.board_fit import BoardFit, fit_board
from atom_core.labeling.depth_view import (
    CROSS,
    DepthOptions,
    DepthView,
    Plane,
    PlaneAxes,
    Region,
    spread,
)
from atom_core.model.labels import RangeLabel
from atom_core.model.sensor import DEPTH

_SQUARE = np.ones((3, 3), dtype=np.uint8)
_WIDER, _WIDEST = np.ones((5, 5), dtype=np.uint8), np.ones((7, 7), dtype=np.uint8)
_RING_PX = 4  # more than what the ring around a region reaches beyond it
_SHIFT = 4  # binary digits of a pixel for drawing
_POST_SHARE, _LEAST_CORE = 0.4, 0.5  # of the board's shorter side, and of its area
_INTO_CORNERS = 0.6  # of the radius of what fits into a board
_BORDER_POINTS, _LEAST_BORDER_PX = 400, 12
_BORDER_M = 0.012
_SAME_SIZE = 0.03  # of a side
_CUT_SIZE = 0.035  # the same, where the image's edge cuts the other sides
_SIZE_NOT_SEEN = "no two opposite sides of the plane there are seen, so that its size is not known"
_CUT = "the image's edge cuts it: bring all of it into view, or let a camera see it, too"
_HOLD_AWAY = (
    "; a board that touches a wall is not told from it: hold it farther away, or draw a polygon "
    "about it"
)
_LEAST_OF_GRID = 0.5  # of the pixels that another grid would have
_LEAST_SEEN = 0.05  # of a board: in view, and not hidden
_LARGEST_EXTENT, _LARGEST_BEYOND = 1.1, 0.05


class _Surface(NamedTuple):
    """A region in its plane."""

    view: DepthView
    plane: Plane
    axes: PlaneAxes
    region: Region

    def in_plane(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return pixels of the region's window in the plane (n, 2) [m]."""
        rays = self.view.rays[rows + self.region.top, columns + self.region.left]
        return self.axes.to_plane(rays)

    def off_the_edge(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Tell which pixels of the window (n,) are not at the image's edge."""
        margin, camera = self.view.options.image_margin_px, self.view.camera
        rows, columns = rows + self.region.top, columns + self.region.left
        return (
            (rows >= margin)
            & (rows < camera.height - margin)
            & (columns >= margin)
            & (columns < camera.width - margin)
        )

    def border(self) -> np.ndarray:
        """Return the region's outermost pixels, without those at the image's edge, (n, 2) [m]."""
        rows, columns = np.nonzero(_outermost(self.region.mask))
        far = self.off_the_edge(rows, columns)
        return self.in_plane(rows[far], columns[far])

    def is_whole(self) -> bool:
        """Tell whether the region does not reach the image's edge."""
        rows, columns = np.nonzero(_outermost(self.region.mask))
        return bool(np.all(self.off_the_edge(rows, columns)))

    def drawn(self, fit: BoardFit, larger_m: float) -> np.ndarray:
        """Return the region's window, 1 where a pixel's centre is on the board or next to it."""
        pixels = self.view.camera.project(self.axes.to_camera(fit.outline(larger_m)))
        corners = np.clip(pixels - [self.region.left, self.region.top], -1e4, 1e4)
        fine = np.rint(corners * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)
        picture = np.zeros_like(self.region.mask)
        return cv2.fillPoly(picture, [fine], 1, lineType=cv2.LINE_8, shift=_SHIFT)

    def on_board(self, fit: BoardFit) -> _Surface:
        """Return the part of the region that lies on the board."""
        solid = cv2.morphologyEx(self.region.mask & self.drawn(fit, 0.0), cv2.MORPH_OPEN, CROSS)
        return self._replace(region=self.region._replace(mask=solid))


def judge(view: DepthView, plane: Plane, region: Region) -> Labeled:
    """Return the label if the region is the board, else the reason why it is none."""
    axes, options = PlaneAxes(plane), view.options
    middle = view.rays[region.window][region.mask > 0].mean(axis=0)
    quality = {"angle_deg": axes.angle_deg(middle), "distance_m": float(plane.z(middle))}
    if quality["angle_deg"] > options.largest_angle_deg:
        return nothing(DEPTH, _too("slanted", quality["angle_deg"], "deg"), quality)
    pixel_m = quality["distance_m"] / view.focal_px
    slant = float(np.cos(np.radians(quality["angle_deg"])))
    board_px = 2.0 * view.half_size / pixel_m
    narrow_px, all_px = float(board_px.min()) * slant, float(board_px.prod()) * slant
    region = _without_posts(view, region, narrow_px, all_px)
    surface = _Surface(view, plane, axes, region)
    quality["pixels"] = float(np.count_nonzero(region.mask))
    inner = surface.in_plane(*_thinned(region.mask))
    quality["extent_m"] = _extent(inner)
    if quality["extent_m"] > _LARGEST_EXTENT * view.diagonal_m:
        reason = _too("large", quality["extent_m"], "m across") + _HOLD_AWAY
        return nothing(DEPTH, reason, quality)
    border = surface.border()
    if len(border) < _LEAST_BORDER_PX:
        reason = "the region fills the image; none of its border is seen: a wall, or too near"
        return nothing(DEPTH, reason, quality)
    tolerance_m = max(_BORDER_M, 1.5 * pixel_m / slant)
    chosen = border[spread(len(border), _BORDER_POINTS)]
    fit = fit_board(chosen, inner, view.half_size, tolerance_m)
    board = surface.on_board(fit)
    quality.update(_comparison(board, fit, tolerance_m))
    reason = _reason(view, quality, fit, _share_beyond(surface, fit, tolerance_m))
    if reason and not _fits(quality, options) and surface.is_whole():
        reason = _size_reason(border, view, quality) or reason
    if reason:
        return nothing(DEPTH, reason, quality)
    labeled = _label(board, fit, quality)
    if surface.is_whole() or not labeled.detected:
        return labeled
    measured, size = fit.measured + pixel_m / slant, 2.0 * fit.half_size
    reason = _cut_size_reason(measured, size, view)
    if reason:
        return nothing(DEPTH, reason, quality)
    if not (fit.opposite and np.isfinite(measured).any()):
        return nothing(DEPTH, f"{_SIZE_NOT_SEEN}; {_CUT}", quality, labeled)
    return labeled


def _cut_size_reason(measured: np.ndarray, size: np.ndarray, view: DepthView) -> str:
    """Tell of a side of a plane that the image's edge cuts, '' if it is as long as the board's.

    Args:
        measured: (2,) distances of opposite sides [m]; NaN where they are not seen.
        size: (2,) what they are to be [m].
        view: what is looked for.
    """
    wide, high = 2.0 * view.half_size
    for side_m, expected_m in zip(measured, size):
        if abs(side_m - expected_m) > _CUT_SIZE * expected_m:
            return (
                f"a side of the plane there measures {side_m:.2f} m; the configuration says "
                f"{wide:.2f} x {high:.2f}, of which that side is to be {expected_m:.2f}; {_CUT}"
            )
    return ""


def _comparison(board: _Surface, fit: BoardFit, tolerance_m: float) -> Dict[str, float]:
    """Return how well a region fits the board that was laid on it."""
    on = np.abs(fit.distance) <= 2.0 * tolerance_m
    rms = float(np.sqrt(np.mean(fit.distance[on] ** 2))) if on.any() else 1.0
    in_view, coverage = _in_view_and_covered(board, fit)
    return {
        "border_share": float(np.mean(on)),
        "border_rms_m": rms,
        "coverage": coverage,
        "in_view": in_view,
        "before_share": _share_before(board),
        "opposite_sides": float(fit.opposite),
    }


def _share_beyond(surface: _Surface, fit: BoardFit, tolerance_m: float) -> float:
    """Return the share of a region that lies outside the board."""
    mask = surface.region.mask
    around = surface.drawn(fit, 2.0 * tolerance_m)
    return 1.0 - np.count_nonzero(mask & around) / float(np.count_nonzero(mask))


def _fits(quality: Dict[str, float], options: DepthOptions) -> bool:
    return quality["border_share"] >= options.least_border_share


def _size_reason(border: np.ndarray, view: DepthView, quality: Dict[str, float]) -> str:
    """Tell measured and configured size of a rectangle of another size, '' if it has the board's.

    Args:
        border: (n, 2) outermost pixels in the plane [m].
        view: what is looked for.
        quality: gets what was measured.
    """
    longer, shorter = sorted(cv2.minAreaRect(border.astype(np.float32))[1], reverse=True)
    wide, high = 2.0 * view.half_size
    measured = np.array([longer, shorter] if wide >= high else [shorter, longer])
    if np.all(np.abs(measured - [wide, high]) < _SAME_SIZE * np.array([wide, high])):
        return ""
    quality["measured_width_m"], quality["measured_height_m"] = (float(v) for v in measured)
    return (
        f"the plane there measures {measured[0]:.2f} x {measured[1]:.2f} m; "
        f"the configuration says {wide:.2f} x {high:.2f}"
    )


def _reason(view: DepthView, quality: Dict[str, float], fit: BoardFit, beyond: float) -> str:
    """Tell why a region is not the board, '' if it is."""
    options = view.options
    if not _fits(quality, options):
        share = quality["border_share"]
        return f"only {share:.0%} of the region's border lies on a border of the board's size"
    if beyond > _LARGEST_BEYOND:
        return f"{beyond:.0%} of the region lies outside a board's size"
    if quality["coverage"] < options.least_coverage:
        return f"the region covers only {quality['coverage']:.0%} of the board's part in view"
    if quality["before_share"] < options.least_before_share:
        share = quality["before_share"]
        return f"the region stands before its surroundings on {share:.0%} of its border only"
    if not fit.corner:
        return "no corner of the board is seen; a longer edge of something else looks the same"
    return ""


def _share_before(board: _Surface) -> float:
    """Return the share of the pixels around a board that lie behind its plane, or have no depth.

    A board stands before what is around it. A piece of floor between the legs of a tripod
    does not: they stand before it, or it goes on. Where nothing behind is in reach, a few pixels
    of the board itself may be all that has a depth around it; they must not speak for the others.
    """
    view, region = board.view, board.region
    top, left = max(region.top - _RING_PX, 0), max(region.left - _RING_PX, 0)
    height, width = region.mask.shape
    bottom, right = region.top + height + _RING_PX, region.left + width + _RING_PX
    z, rays = view.depth_m[top:bottom, left:right], view.rays[top:bottom, left:right]
    mask = np.zeros(z.shape, dtype=np.uint8)
    inner = mask[region.top - top :, region.left - left :]
    inner[:height, :width] = region.mask
    ring = cv2.dilate(mask, _WIDEST) - cv2.dilate(mask, _WIDER)
    here = (ring > 0) & np.isfinite(z)
    expected = board.plane.z(rays[here])
    behind = z[here] - expected > view.tolerance_m(board.plane, expected)
    return 1.0 - float(np.count_nonzero(~behind)) / max(np.count_nonzero(ring), 1)


def _in_view_and_covered(board: _Surface, fit: BoardFit) -> Tuple[float, float]:
    """Return the share of the board in the image, and how much of this the region covers."""
    camera, region = board.view.camera, board.region
    steps = np.linspace(-0.94, 0.94, 24)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * fit.half_size
    points = board.axes.to_camera(fit.centre + grid @ fit.plane_R_board.T)
    pixels = np.rint(camera.project(points)).astype(int)
    size = [camera.width, camera.height]
    seen = np.all((pixels >= 0) & (pixels < size), axis=1) & (points[:, 2] > 0)
    in_view = float(np.mean(seen))
    if not seen.any():
        return in_view, 0.0
    seen &= ~_hidden(board, points, pixels, seen)
    if np.mean(seen) < _LEAST_SEEN:
        return in_view, 0.0
    column, row = (pixels[seen] - [region.left, region.top]).T
    height, width = region.mask.shape
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    covered = region.mask[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)] > 0
    return in_view, float(np.mean(inside & covered))


def _hidden(
    board: _Surface, points: np.ndarray, pixels: np.ndarray, in_view: np.ndarray
) -> np.ndarray:
    """Tell before which points (n, 3) on the board something nearer stands."""
    column, row = np.where(in_view[:, None], pixels, 0).T
    z = board.view.depth_m[row, column]
    with np.errstate(invalid="ignore"):
        return in_view & (points[:, 2] - z > board.view.tolerance_m(board.plane, points[:, 2]))


def _label(board: _Surface, fit: BoardFit, quality: Dict[str, float]) -> Labeled:
    """Return the label: pixels inside, on a grid, and the outermost ones on the board's border."""
    view, region = board.view, board.region
    z, expected = view.depth_m[region.window], board.plane.z(view.rays[region.window])
    with np.errstate(invalid="ignore"):
        good = np.abs(z - expected) <= view.tolerance_m(board.plane, expected)
    inner = cv2.erode(region.mask, _SQUARE, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    inside = _on_grid(inner & good, region, view.options.step)
    edge_rows, edge_columns = np.nonzero((_outermost(region.mask) > 0) & good)
    far = board.off_the_edge(edge_rows, edge_columns)
    pixel_m = quality["distance_m"] / view.focal_px
    border = board.in_plane(edge_rows, edge_columns)
    far &= fit.signed_distance(border) >= -4.0 * pixel_m - _BORDER_M
    error = (z - expected)[inner & good]
    quality["plane_rms_m"] = float(np.sqrt(np.mean(error**2))) if error.size else np.inf
    quality["pixels"] = float(np.count_nonzero(region.mask))
    label = RangeLabel(
        _index(view, region, *np.nonzero(inside)),
        _index(view, region, edge_rows[far], edge_columns[far]),
    )
    if not label.detected:
        return nothing(DEPTH, "no depth inside the board", quality)
    rows, columns = np.nonzero(region.mask)
    centroid = np.array([columns.mean() + region.left, rows.mean() + region.top])
    return Labeled(label, quality=quality, next_seed=centroid)


def _on_grid(good: np.ndarray, region: Region, step: int) -> np.ndarray:
    """Return every ``step``-th of a region's good pixels, in both directions.

    The grid begins at the image's first pixel, but where that falls on regular holes.
    """
    counts = np.zeros((step, step), dtype=int)
    for row, column in np.ndindex(step, step):
        part = good[(row - region.top) % step :: step, (column - region.left) % step :: step]
        counts[row, column] = np.count_nonzero(part)
    first = 0
    if counts[0, 0] < _LEAST_OF_GRID * counts.max():
        first = int(np.argmax(counts))
    row, column = divmod(first, step)
    grid = np.zeros_like(good)
    grid[(row - region.top) % step :: step, (column - region.left) % step :: step] = True
    return good & grid


def _index(view: DepthView, region: Region, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the indices in the image of pixels of a region's window."""
    return columns + region.left + (rows + region.top) * view.camera.width


def _without_posts(view: DepthView, region: Region, width_px: float, board_px: float) -> Region:
    """Return the region without what is much narrower than the board: the posts that carry it.

    Args:
        view: the image.
        region: on the plane, without holes.
        width_px: the board's shorter side, foreshortened [px].
        board_px: number of pixels on the whole board, foreshortened.
    """
    radius_px = _POST_SHARE * width_px / 2.0
    if 2.0 * radius_px > max(region.mask.shape):
        return region
    core = region.mask & _wide(view, region, radius_px)
    if np.count_nonzero(core) < _LEAST_CORE * min(np.count_nonzero(region.mask), board_px):
        return region  # all of it is narrow: a corner of the board at the image's edge
    return region._replace(mask=core)


def _wide(view: DepthView, region: Region, radius_px: float) -> np.ndarray:
    """Return 1 where a circle of some radius fits into a region, and a little around.

    A little, since no circle reaches into a corner. Beyond the image the region goes on.
    """
    pad = int(radius_px) + 2
    (height, width), camera = region.mask.shape, view.camera
    vertical = (region.top == 0, region.top + height == camera.height)
    horizontal = (region.left == 0, region.left + width == camera.width)
    inner = [pad if at_edge else 0 for at_edge in (*vertical, *horizontal)]
    grown = cv2.copyMakeBorder(region.mask, *inner, cv2.BORDER_REPLICATE)
    outer = [pad - size for size in inner]
    grown = cv2.copyMakeBorder(grown, *outer, cv2.BORDER_CONSTANT, value=0)
    middles = cv2.distanceTransform(grown, cv2.DIST_L2, 5) >= radius_px
    away = cv2.distanceTransform((~middles).astype(np.uint8), cv2.DIST_L2, 5)
    wide = (away <= (1.0 + _INTO_CORNERS) * radius_px) & bool(middles.any())
    return wide[pad : pad + height, pad : pad + width].astype(np.uint8)


def _outermost(mask: np.ndarray) -> np.ndarray:
    """Return the mask's pixels beside one outside it; the window's edge counts as outside."""
    return mask & ~cv2.erode(mask, CROSS, borderType=cv2.BORDER_CONSTANT, borderValue=0)


def _thinned(mask: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of some hundred pixels of a mask."""
    rows, columns = np.nonzero(mask)
    step = max(len(rows) // 600, 1)
    return rows[::step], columns[::step]


def _extent(points: np.ndarray) -> float:
    """Return the largest extent of points (n, 2) in any direction, to 1 % [m]."""
    angles = np.radians(np.arange(0.0, 180.0, 15.0))
    directions = np.stack([np.cos(angles), np.sin(angles)])
    extents = np.ptp(points @ directions, axis=0)
    return float(np.max(extents))


def _too(what: str, value: float, unit: str) -> str:
    return f"the region is too {what} for the board ({value:.3g} {unit})"
