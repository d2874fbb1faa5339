"""Depth cameras: a depth image, a pixel on the board and the pattern in, the board's pixels out.

The plane at the seed, or at each smooth region of the image, is grown (`depth_plane`,
`depth_search`); what lies on it and hangs together is laid under a rectangle of the board's size.
Only if border, coverage and planarity fit, the region is the board (`depth_board`).
"""

from __future__ import annotations

from typing import NamedTuple, Optional, Union

import numpy as np

from atom_core.errors import LabelingError
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.depth_board import judge
from atom_core.labeling.depth_plane import SEED_REACH_PX, plane_region, start_pixel
from atom_core.labeling.depth_search import plane_regions
from atom_core.labeling.depth_view import DepthOptions, DepthView, filled, without_specks
from atom_core.labeling.polygon import polygon_mask
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import DEPTH, Sensor

ENCODINGS = {"16UC1": 0.001, "mono16": 0.001, "32FC1": 1.0}  # metres of a unit (REP 118)
_FACTORS = {
    0.001: "they look like millimetres where metres are expected",
    0.1: "they look like tenths of a millimetre where millimetres are expected",
    10.0: "they look like centimetres where millimetres are expected",
    1000.0: "they look like metres where millimetres are expected",
}
_NO_BOARD = "no plane region of the board's size and shape is seen"
_CUT = "it is cut by the image's edge or hidden, and its size is not seen"
_LITTLE = "only {:.0%} of a board there are in view: set a seed on it, or let a camera see it, too"
_LEAST_LEFT, _SPARSE = 0.5, 0.5  # of the pixels with a depth, like neighbours; of all pixels
_SPECKS = (
    "{:.0%} of the pixels with a depth are like no two of their neighbours, and {:.0%} have one: "
    "where the image has regular holes, let the driver fill them (depth_image_proc/register: "
    "fill_upsampling_holes)"
)
_PLAUSIBLE_M = (0.5, 12.0)  # median depth of a room
_DARK_SQUARES, _NEAR_M = 1.3, 1.5  # sides of a square, seen from there: holes that are filled
_LEAST_FITNESS = 0.75  # of what was searched: nobody said that the board is there
_LEAST_IN_VIEW = 0.75  # of the board, for the same reason: one side may be another board's, too


class PreparedDepth(NamedTuple):
    """A depth image (height, width) [m] that fits its camera, and what is looked at of it."""

    depth_m: np.ndarray
    view: DepthView


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

    def prepare(self, data: np.ndarray) -> PreparedDepth:
        """Return a depth image (height, width) [m] without specks, and with small holes filled.

        Raises:
            LabelingError: see `label`.
        """
        depth_m = self._checked(data)
        return PreparedDepth(depth_m, self._view(depth_m))

    def label(
        self,
        data: Union[np.ndarray, PreparedDepth],
        seed: Optional[np.ndarray] = None,
        polygon: Optional[np.ndarray] = None,
    ) -> Labeled:
        """Label the board.

        Args:
            data: (height, width) [m]; NaN, infinite or 0 where there is no depth (`to_metres`); or
                what `prepare` returns.
            seed: (2,) pixel x, y on the board; None: search the image for it.
            polygon: (n, 2) pixels; what lies outside is not looked at.

        Returns:
            Indices are ``column + row * width``: every ``step``-th pixel inside the board, and the
            outermost ones on its border, never at the image's edge. ``quality``: ``pixels``,
            ``plane_rms_m``, ``border_rms_m``, ``border_share``, ``coverage``, ``angle_deg``,
            ``distance_m``, ``in_view`` (share of the board in the image), ``opposite_sides`` (1:
            two are seen, which tell the board's size).
            ``next_seed`` is the centroid. Where the image's edge cuts the board so that no two
            opposite sides are seen, the label is ``unsure``.

        Raises:
            LabelingError: the array is no depth image of this camera, the seed or the polygon is
                outside it, or the depths are in another unit.
        """
        depth_m, view = data if isinstance(data, PreparedDepth) else self.prepare(data)
        if polygon is not None:
            depth_m = _within(depth_m, polygon)
            view = self._view(depth_m)
        found = _found_in(view) if seed is None else _from_seed(view, self._checked_seed(seed))
        if found.detected:
            return found
        self._check_unit(depth_m, seed)
        reason = _why_specks(depth_m, view)
        return nothing(DEPTH, reason, found.quality) if reason else found

    def _view(self, depth_m: np.ndarray) -> DepthView:
        half_size, square_m = self.pattern.border.half_size, self.pattern.square_m
        depth_m = without_specks(depth_m)
        reach_px = _DARK_SQUARES * square_m * float(self.camera.focal_px.mean()) / _NEAR_M
        solid_m = filled(depth_m, int(np.clip(reach_px, 5, 61)))
        return DepthView(
            depth_m, solid_m, square_m, self._rays, self.camera, half_size, self.options
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
        return _nan_where_invalid(data.astype(np.float32))

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
            view = self._view(scaled)
            found = _found_in(view) if seed is None else _from_seed(view, seed)
            if found.detected:
                raise LabelingError(
                    f"sensor '{self.sensor.name}': the board has its size only when depths are "
                    f"multiplied by {factor:g}; {meaning}; correct the encoding or the driver"
                )


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
    return _nan_where_invalid(image.astype(np.float32) * np.float32(ENCODINGS[encoding]))


def _nan_where_invalid(depth_m: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):  # numpy 1.17 warns of comparisons with NaN
        depth_m[~(depth_m > 0) | ~np.isfinite(depth_m)] = np.nan
    return depth_m


def _found_in(view: DepthView) -> Labeled:
    best, nearest = nothing(DEPTH, _NO_BOARD), ""
    for plane, region in plane_regions(view):
        found = judge(view, plane, region)
        if _fitness(found) >= max(_LEAST_FITNESS, _fitness(best)):
            best = found
        elif found.detected:
            nearest = nearest or _why_unsure(found) or _CUT
        elif found.unsure is not None:
            nearest = nearest or found.reason
        elif "measured_width_m" in found.quality:
            nearest = found.reason
    if best.detected or not nearest:
        return best
    return nothing(DEPTH, f"{_NO_BOARD}; of what comes nearest: {nearest}")


def _why_specks(depth_m: np.ndarray, view: DepthView) -> str:
    """Tell that an image is made of single pixels, as registering to a finer one makes it."""
    known, left = (np.count_nonzero(np.isfinite(z)) for z in (depth_m, view.depth_m))
    if left >= _LEAST_LEFT * known or known > _SPARSE * depth_m.size:
        return ""
    return _SPECKS.format(1.0 - left / known, known / depth_m.size)


def _from_seed(view: DepthView, seed: np.ndarray) -> Labeled:
    if start_pixel(view.solid_m, seed) is None:
        return nothing(DEPTH, f"no depth within {SEED_REACH_PX} px of the seed")
    found = plane_region(view, seed)
    if found is None:
        return nothing(DEPTH, "what is seen at the seed is no plane of the least size")
    return judge(view, *found)


def _why_unsure(found: Labeled) -> str:
    """Tell why a board that was searched for may be another one, '' if nothing says so."""
    if not found.quality["opposite_sides"]:
        return _CUT  # a corner at the image's edge may be that of any larger thing
    in_view = found.quality["in_view"]
    return _LITTLE.format(in_view) if in_view < _LEAST_IN_VIEW else ""


def _fitness(found: Labeled) -> float:
    if not found.detected or _why_unsure(found):
        return 0.0
    return found.quality["border_share"] * found.quality["coverage"]


def _within(depth_m: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    return np.where(polygon_mask(polygon, depth_m.shape) > 0, depth_m, np.float32(np.nan))
