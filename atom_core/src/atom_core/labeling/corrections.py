"""Labels corrected by hand: a label and what a person chose in, the new label out.

Nothing here remembers anything; sessions with undo are made of these (`dataset_playback`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Container, Optional, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import LabelingError
from atom_core.geometry.expected_noise import depth_sigma_m
from atom_core.labeling.base import Labeled
from atom_core.labeling.depth import DepthLabeler, DepthOptions
from atom_core.labeling.polygon import inside_polygon, polygon_mask
from atom_core.model.labels import RangeLabel, RgbLabel

EMPTY = RangeLabel(np.zeros(0, dtype=int), np.zeros(0, dtype=int))
# Somebody has said that the board is there, so that what hides a part of it, or stands right behind
# it, is no reason to doubt it.
_BY_HAND = DepthOptions(least_border_share=0.3, least_coverage=0.3, least_before_share=0.0)
_LOST_PX = np.ones((5, 5), dtype=np.uint8)  # pixels without depth that make no hole
_CUT_REACH_PX = 3  # the fill's border lies that far from the polygon at most where it cuts


# --- points and pixels ------------------------------------------------------------------------


def valid_indices(indices: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return chosen indices, each once, in their order, without those of invalid data.

    Args:
        indices: (n,) chosen points or pixels.
        valid: (m,) whether each point or pixel of the data was measured.

    Raises:
        LabelingError: an index beyond the data.
    """
    indices = np.asarray(indices, dtype=int).reshape(-1)
    outside = (indices < 0) | (indices >= len(valid))
    if np.any(outside):
        raise LabelingError(
            f"index {indices[outside][0]} is beyond the data ({len(valid)} points); choose the "
            f"points in what is shown now"
        )
    _, first = np.unique(indices, return_index=True)
    once = indices[np.sort(first)]
    return once[valid[once]]


def with_points(label: Optional[RangeLabel], indices: np.ndarray, border: bool) -> RangeLabel:
    """Return a label with points (n,) added, those it has already excepted.

    Args:
        label: None where nothing was detected.
        indices: of the points.
        border: they lie on the board's border too.
    """
    label = label or EMPTY
    limit = _appended(label.limit_indices, indices) if border else label.limit_indices
    return RangeLabel(_appended(label.indices, indices), limit)


def without_points(label: RangeLabel, indices: np.ndarray) -> RangeLabel:
    """Return a label without points (n,), inside and on the border."""
    return RangeLabel(
        label.indices[~np.isin(label.indices, indices)],
        label.limit_indices[~np.isin(label.limit_indices, indices)],
    )


def without_border(label: RangeLabel, polygon: np.ndarray, shape: Tuple[int, ...]) -> RangeLabel:
    """Return a label of a depth image without the border pixels inside a polygon.

    They stay on the board if they are among its pixels.

    Args:
        label: of the image.
        polygon: (n, 2) corners x, y [px].
        shape: height and width of the image.

    Raises:
        LabelingError: it is no polygon, or outside the image.
    """
    inside = polygon_mask(polygon, shape).ravel()[label.limit_indices] > 0
    return replace(label, limit_indices=label.limit_indices[~inside])


def _appended(indices: np.ndarray, more: np.ndarray) -> np.ndarray:
    return np.concatenate([indices, more[~np.isin(more, indices)]]).astype(int)


# --- depth images -----------------------------------------------------------------------------


def refilled(labeler: DepthLabeler, depth_m: np.ndarray, polygon: np.ndarray) -> Labeled:
    """Label the board inside a polygon anew, by the labeler's fill.

    Where the labeler would not be sure that it is the board, the polygon decides; then the reason
    stands among the warnings. Border pixels where only the polygon ends the board are left out.

    Args:
        labeler: of the camera and the pattern.
        depth_m: (height, width) [m], NaN where there is no depth.
        polygon: (n, 2) corners x, y [px] around the board, or the part of it that is good.

    Raises:
        LabelingError: it is no polygon, or outside the image, or the data are no depth image.
    """
    mask = polygon_mask(polygon, depth_m.shape)
    measured = mask & np.isfinite(depth_m).astype(np.uint8)
    if not measured.any():
        raise LabelingError("there is no depth inside the polygon; draw it on the board")
    # The middle of the polygon; where something hides that, the middle of what was measured.
    seeds = [_deepest(mask), _deepest(cv2.morphologyEx(measured, cv2.MORPH_CLOSE, _LOST_PX))]
    strict = _first_found(labeler, depth_m, seeds, polygon)
    found = strict
    if not strict.detected:
        lenient = DepthLabeler(labeler.sensor, labeler.pattern, options=_BY_HAND)
        found = _first_found(lenient, depth_m, seeds, polygon)
        found = found.unsure or found  # the person knows what the image's edge cuts
        if found.detected:
            found = replace(found, warnings=(*found.warnings, strict.reason))
    if not isinstance(found.label, RangeLabel) or not found.detected:
        return found
    limit = found.label.limit_indices
    kept = limit[~_cut_by_polygon(depth_m, mask, limit)]
    return replace(found, label=replace(found.label, limit_indices=kept))


def _first_found(
    labeler: DepthLabeler, depth_m: np.ndarray, seeds: Sequence[np.ndarray], polygon: np.ndarray
) -> Labeled:
    """Return the label from the first seed that gives one; where none does, the first refusal."""
    tried = []
    for seed in seeds:
        tried.append(labeler.label(depth_m, seed, polygon))
        if tried[-1].detected:
            return tried[-1]
    return tried[0]


def _deepest(mask: np.ndarray) -> np.ndarray:
    """Return the pixel (x, y) farthest from the mask's outline."""
    padded = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    _, _, _, place = cv2.minMaxLoc(cv2.distanceTransform(padded, cv2.DIST_L2, 3))
    return np.array(place, dtype=float) - 1.0


def _cut_by_polygon(depth_m: np.ndarray, mask: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Return whether the surface at pixels (n,) goes on just outside the polygon (n,)."""
    height, width = depth_m.shape
    row, column = np.divmod(indices, width)
    here = depth_m[row, column]
    same_m = 0.02 + 3.0 * depth_sigma_m(np.minimum(here, 8.0))
    goes_on = np.zeros(len(indices), dtype=bool)
    reach = range(-_CUT_REACH_PX, _CUT_REACH_PX + 1)
    for down in reach:
        for right in reach:
            r, c = row + down, column + right
            there = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            r, c = np.clip(r, 0, height - 1), np.clip(c, 0, width - 1)
            with np.errstate(invalid="ignore"):
                goes_on |= there & (mask[r, c] == 0) & (np.abs(depth_m[r, c] - here) < same_m)
    return goes_on


# --- corners ----------------------------------------------------------------------------------


def nearest_corner(label: RgbLabel, pixel: np.ndarray, within_px: float) -> Optional[int]:
    """Return the id of the corner nearest a pixel (2,); None if none is within the distance."""
    if not label.detected:
        return None
    away_px = np.linalg.norm(label.pixels - np.asarray(pixel, dtype=float), axis=1)
    nearest = int(np.argmin(away_px))
    return int(label.ids[nearest]) if away_px[nearest] <= within_px else None


def corners_in(label: RgbLabel, polygon: np.ndarray) -> np.ndarray:
    """Return the ids (n,) of the corners inside a polygon (m, 2) [px].

    Raises:
        LabelingError: it is no polygon.
    """
    return label.ids[inside_polygon(polygon, label.pixels)]


def without_corners(label: RgbLabel, ids: Container[int]) -> RgbLabel:
    """Return a label without the corners of these ids."""
    kept = np.array([int(i) not in ids for i in label.ids], dtype=bool)
    return RgbLabel(label.ids[kept], label.pixels[kept])


def with_corner_at(label: RgbLabel, corner: int, pixel: np.ndarray) -> RgbLabel:
    """Return a label with a corner at another pixel (2,).

    Raises:
        LabelingError: the label has no corner of that id.
    """
    if corner not in label.ids:
        raise LabelingError(f"there is no corner {corner} in the label")
    pixels = label.pixels.copy()
    pixels[label.ids == corner] = pixel
    return RgbLabel(label.ids, pixels)
