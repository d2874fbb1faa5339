"""How well a sensor sees the board, beside whether it finds it: blur, exposure, distance, tilt.

The blur is the standard deviation of the Gaussian that turns a perfect edge into the edges between
black and white that the picture has, the pixel's own width included: 0.3 to 0.5 px in a picture
that is perfectly sharp. No pixel is interpolated for it, which would blur by itself.
"""

from __future__ import annotations

from typing import Dict, Mapping, NamedTuple, Optional, Tuple

import numpy as np
from scipy.special import erf

from atom_core import opencv as cv2
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.expected_noise import CORNER_SIGMA_PX
from atom_core.labeling.smear import smear_of
from atom_core.labeling.stillness import CornerSighting
from atom_core.model.config import PatternConfig
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import CHARUCO, Pattern

_SIGMAS_PX = np.geomspace(0.25, 8.0, 22)
_ALONG_EDGE, _ACROSS_EDGE = 0.3, 0.42  # of its length to each side, and of a square
_LONGEST_PX, _USUAL_PX = 3.0, 4.0  # of an edge, to each side; beside it, but for great blur
_WIDEST_PX, _NARROWEST_PX = 12.0, 1.0
_ROUNDS, _REACH_OF_BLUR, _LEAST_PIXELS = 3, 2.0, 8.0
_MOST_EDGES = 16  # of a direction
_LEAST_STEP = 5.0  # grey values; less is no edge
_MARGIN_PX = 3
_CLIPPED, _MOST_CLIPPED = 254, 0.25  # grey value; share of the board: half of its white
_DARKEST_WHITE = 64.0
_LEAST_SMEAR_PX = 5.0  # below it, pictures at rest are sometimes taken for smeared
_LEAST_SPEED = 100.0  # px/s, 3 px in a thirtieth of a second; mm/s, 10 mm in a turn of a LiDAR


class ForeseenView(NamedTuple):
    """What a sensor would see of a board whose place others know.

    Attributes:
        distance_m: to its middle.
        tilt_deg: between its normal and the line of sight; 0 faces the sensor, above 90 a camera
            sees its back; of others 90 at most.
        square_px: side of its most foreshortened squares; NaN for what is no camera.
        frontal_px: that of a square at this distance that faces the camera.
        in_image: number of its corners that lie in the image.
    """

    distance_m: float
    tilt_deg: float
    square_px: float = np.nan
    frontal_px: float = np.nan
    in_image: int = 0


def clear_squares(config: PatternConfig) -> float:
    """Return how far from a square's edge its white neighbour stays white, in squares."""
    if config.pattern_type != CHARUCO or config.inner_size is None:
        return _ACROSS_EDGE
    return min(0.5 * (1.0 - config.inner_size / config.size), _ACROSS_EDGE)


def corner_view(
    image: np.ndarray,
    pattern: Pattern,
    label: RgbLabel,
    clear: float,
    camera_T_pattern: Optional[np.ndarray],
) -> Dict[str, float]:
    """Return the figures of a camera's label.

    Args:
        image: (height, width[, 3]) uint8.
        pattern: the board.
        label: its corners, at least one square of them.
        clear: see `clear_squares`.
        camera_T_pattern: (4, 4) its pose; None: not known.

    Returns:
        ``blur_px`` (of the more blurred direction), ``smear_px`` (how far the board moved while
        the shutter was open; 0 where the blur is about the same all round), ``white_level`` and
        ``black_level`` (grey values), ``clipped_share`` of the board's pixels that are as white as
        can be, ``square_px``, and with a pose ``distance_m`` and ``tilt_deg``. What cannot be
        measured is left out.
    """
    figures: Dict[str, float] = {}
    grey, corner = _around(image, label.pixels)
    grid = np.full((pattern.rows * pattern.columns, 2), np.nan)
    grid[label.ids] = label.pixels - corner
    grid = grid.reshape(pattern.rows, pattern.columns, 2)
    edges = [_edges(grid), _edges(grid.transpose(1, 0, 2))]
    along: Optional[Tuple[float, float]] = None
    lengths = [np.linalg.norm(end - start, axis=1) for start, end in edges]
    if all(len(length) for length in lengths):
        figures["square_px"] = float(min(np.median(length) for length in lengths))
        across = [float(np.median(length)) for length in reversed(lengths)]
        blurs = [blur_px(grey, *of_axis, wide, clear) for of_axis, wide in zip(edges, across)]
        known = [blur for blur in blurs if blur is not None]
        if known:
            figures["blur_px"] = max(known)
        if len(known) == 2:
            along = (known[0], known[1])
    figures.update(_exposure(grey, label.pixels - corner))
    if along is not None and "white_level" in figures:
        step = figures["white_level"] - figures["black_level"]
        figures["smear_px"] = smear_of(grey, grid, along, step).length_px
    if camera_T_pattern is not None:
        seen = surface_view(*_middle(camera_T_pattern, pattern))
        figures.update(seen)
    return figures


def surface_view(centre: np.ndarray, normal: Optional[np.ndarray]) -> Dict[str, float]:
    """Return ``distance_m``, and with a normal ``tilt_deg``, of a board in the sensor's frame.

    Args:
        centre: (3,) [m].
        normal: (3,) of its plane, either way.
    """
    distance = float(np.linalg.norm(centre))
    figures = {"distance_m": distance}
    if normal is not None and distance > 0.0:
        cosine = abs(float(normal @ centre)) / distance / float(np.linalg.norm(normal))
        figures["tilt_deg"] = float(np.degrees(np.arccos(min(cosine, 1.0))))
    return figures


def speed_figure(sighting: object, sigmas_per_s: float) -> Dict[str, float]:
    """Return how fast the board moved before a sensor, in the unit that it measures in."""
    if isinstance(sighting, CornerSighting):
        return {"speed_px_s": sigmas_per_s * CORNER_SIGMA_PX}
    sigma_m = getattr(sighting, "sigma_m", None)
    return {} if sigma_m is None else {"speed_mm_s": 1000.0 * sigmas_per_s * float(sigma_m)}


def motion_words(figures: Mapping[str, float]) -> str:
    """Return how the board moved while data were taken; empty where that does no harm.

    Args:
        figures: ``smear_px``, ``speed_px_s`` and ``speed_mm_s``, those that are known.
    """
    if figures.get("smear_px", 0.0) >= _LEAST_SMEAR_PX:
        return f"the board moved {figures['smear_px']:.0f} px while the shutter was open"
    for unit in ("px", "mm"):
        speed = figures.get(f"speed_{unit}_s", 0.0)
        if _LEAST_SPEED <= speed < np.inf:
            return f"the board moved at {speed:.0f} {unit}/s"
    return ""


def exposure_word(figures: Mapping[str, float]) -> str:
    """Return "over", "under" or "good"; empty where the figures do not tell."""
    if "clipped_share" not in figures:
        return ""
    if figures["clipped_share"] > _MOST_CLIPPED:
        return "over"
    return "under" if figures["white_level"] < _DARKEST_WHITE else "good"


def described(figures: Mapping[str, float]) -> str:
    """Return the figures of a label in a few words; empty where none of them is known."""
    forms = {"blur_px": "blur {:.1f} px", "distance_m": "{:.1f} m", "tilt_deg": "{:.0f} deg"}
    said = [form.format(figures[key]) for key, form in forms.items() if key in figures]
    if figures.get("smear_px", 0.0) > 0.0:
        said.insert(1, f"moved {figures['smear_px']:.0f} px while the shutter was open")
    word = exposure_word(figures)
    return ", ".join([*said, f"{word}exposed"] if word in ("over", "under") else said)


def foreseen_view(
    camera: Optional[Camera], pattern: Pattern, sensor_T_pattern: np.ndarray
) -> ForeseenView:
    """Return what a sensor would see of a board at a pose (4, 4).

    Args:
        camera: its intrinsics; None for what has no image.
        pattern: the board.
        sensor_T_pattern: (4, 4).
    """
    centre, normal = _middle(sensor_T_pattern, pattern)
    seen = surface_view(centre, normal)
    distance, tilt = seen["distance_m"], seen.get("tilt_deg", 0.0)
    if camera is None:
        return ForeseenView(distance, tilt)
    if float(normal @ centre) < 0.0:
        tilt = 180.0 - tilt
    ids = np.flatnonzero(np.all(np.isfinite(pattern.corners_by_id), axis=1))
    corners = se3.apply(sensor_T_pattern, pattern.corners_of(ids))
    front = corners[:, 2] > 0.0
    frontal = float(camera.focal_px.mean()) * pattern.square_m / distance
    if not front.all():
        return ForeseenView(distance, tilt, np.nan, frontal, 0)
    pixels = camera.project(corners)
    limit = np.array([camera.width, camera.height]) - 0.5
    inside = np.all((pixels >= -0.5) & (pixels <= limit), axis=1)
    grid = np.full((pattern.rows * pattern.columns, 2), np.nan)
    grid[ids] = pixels
    grid = grid.reshape(pattern.rows, pattern.columns, 2)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=2) for axis in (0, 1)]
    square = float(min(np.nanmedian(side) for side in sides))
    return ForeseenView(distance, tilt, square, frontal, int(inside.sum()))


def blur_px(
    grey: np.ndarray, starts: np.ndarray, ends: np.ndarray, square_px: float, clear: float
) -> Optional[float]:
    """Return the standard deviation of edges [px]; None where they are too short or too weak.

    Args:
        grey: (height, width) uint8.
        starts: (n, 2) corners at which the edges begin [px].
        ends: (n, 2) those at which they end [px].
        square_px: side of a square across the edges.
        clear: part of a white square beside the edge that is white (`clear_squares`).
    """
    free_px = min(_ACROSS_EDGE * square_px, _WIDEST_PX)
    clear_px = min(clear * square_px, free_px)
    if clear_px < _NARROWEST_PX or not len(starts):
        return None
    chosen = np.unique(np.linspace(0, len(starts) - 1, _MOST_EDGES).astype(int))
    starts, ends = starts[chosen], ends[chosen]
    fit = _Fit(*_beside(grey, starts, ends, min(clear_px, _USUAL_PX)))
    if fit.sigma_px is None or fit.sigma_px < _USUAL_PX / 5.0:
        return fit.sigma_px
    distances, values, weights = _beside(grey, starts, ends, free_px)
    for _ in range(_ROUNDS):  # a marker's blur reaches into the white strip beside it
        strip_px = max(clear_px - _REACH_OF_BLUR * fit.sigma_px, _NARROWEST_PX)
        unspoilt = fit.brighter[:, None] * distances <= strip_px
        fit = _Fit(distances, values, weights * unspoilt)
        if fit.sigma_px is None:
            break
    return fit.sigma_px


class _Fit:
    """The blur of ideal edges that explains most of the values beside edges.

    Attributes:
        sigma_px: of the blur; None where the edges are too weak.
        brighter: (n,) on which side of each edge is white: 1 or -1.
    """

    def __init__(self, distances: np.ndarray, values: np.ndarray, weights: np.ndarray):
        """Fit all edges with one sigma; arrays are (n, m), see `_beside`."""
        total = np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
        rest = values - (weights * values).sum(axis=1, keepdims=True) / total
        explained, step = [], []
        for sigma in _SIGMAS_PX:
            ideal = 0.5 * erf(distances / (np.sqrt(2.0) * sigma))
            ideal = ideal - (weights * ideal).sum(axis=1, keepdims=True) / total
            both, square = (weights * ideal * rest).sum(axis=1), (weights * ideal**2).sum(axis=1)
            explained.append(both**2 / np.maximum(square, 1e-12))
            step.append(both / np.maximum(square, 1e-12))
        height = np.median(np.stack(step), axis=0)
        strong = (np.abs(height) >= _LEAST_STEP) & (total[:, 0] >= _LEAST_PIXELS)
        self.brighter = np.where(height > 0.0, 1.0, -1.0)
        self.sigma_px: Optional[float] = None
        if strong.any():
            self.sigma_px = _peak(np.stack(explained)[:, strong].sum(axis=1))


def _peak(explained: np.ndarray) -> float:
    """Return the sigma at the maximum, between the steps of the scale."""
    best = int(np.argmax(explained))
    logs = np.log(_SIGMAS_PX)
    if not 0 < best < len(logs) - 1:
        return float(_SIGMAS_PX[best])
    low, middle, high = explained[best - 1 : best + 2]
    curvature = low - 2.0 * middle + high
    shift = 0.0 if curvature >= 0.0 else 0.5 * (low - high) / curvature
    return float(np.exp(logs[best] + shift * (logs[1] - logs[0])))


def _beside(
    grey: np.ndarray, starts: np.ndarray, ends: np.ndarray, half: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return signed distance [px], value and weight (n, m) of the pixels beside edges' middles."""
    middles, along = 0.5 * (starts + ends), ends - starts
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    along = along / lengths
    ahead_px = np.minimum(_ALONG_EDGE * lengths, _LONGEST_PX)
    reach = int(np.ceil(np.hypot(half, ahead_px.max())))
    step = np.arange(-reach, reach + 1)
    columns, rows = (v.ravel() for v in np.meshgrid(step, step))
    whole = np.rint(middles).astype(int)
    x, y = whole[:, :1] + columns, whole[:, 1:] + rows
    height, width = grey.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    values = grey[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)].astype(float)
    dx, dy = x - middles[:, :1], y - middles[:, 1:]
    beside = dy * along[:, :1] - dx * along[:, 1:]
    ahead = dx * along[:, :1] + dy * along[:, 1:]
    near = (np.abs(beside) <= half) & (np.abs(ahead) <= ahead_px)
    return beside, values, (near & inside).astype(float)


def _edges(grid: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return corners (n, 2) that follow each other along the rows of a grid (rows, columns, 2)."""
    starts, ends = grid[:, :-1].reshape(-1, 2), grid[:, 1:].reshape(-1, 2)
    known = np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1)
    return starts[known], ends[known]


def _around(image: np.ndarray, pixels: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the grey part of an image that holds pixels (n, 2), and its top left corner (2,)."""
    height, width = image.shape[:2]
    low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - _MARGIN_PX, 0, [width - 1, height - 1])
    high = np.ceil(pixels.max(axis=0)).astype(int) + _MARGIN_PX + 1
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    if part.ndim == 3:
        part = cv2.cvtColor(part, cv2.COLOR_BGR2GRAY) if part.shape[2] == 3 else part[..., 0]
    return part, low.astype(float)


def over_exposed_share(grey: np.ndarray, pixels: np.ndarray) -> float:
    """Return the share of an image (height, width) that is as white as can be, about pixels (n, 2).

    0 where that is usual.
    """
    share = _exposure(grey, pixels).get("clipped_share", 0.0)
    return share if share > _MOST_CLIPPED else 0.0


def _exposure(grey: np.ndarray, pixels: np.ndarray) -> Dict[str, float]:
    mask = np.zeros(grey.shape, np.uint8)
    hull = cv2.convexHull(np.rint(pixels).astype(np.int32).reshape(-1, 1, 2))
    cv2.fillConvexPoly(mask, hull, 1)
    values = grey[mask.astype(bool)]
    if not len(values):
        return {}
    black, white = np.percentile(values, [5, 95])
    clipped = float(np.mean(values >= _CLIPPED))
    return {"white_level": float(white), "black_level": float(black), "clipped_share": clipped}


def _middle(sensor_T_pattern: np.ndarray, pattern: Pattern) -> Tuple[np.ndarray, np.ndarray]:
    """Return the middle of the board and its normal in the sensor's frame."""
    centre = se3.apply(sensor_T_pattern, pattern.border.centre_in_pattern[None])[0]
    return centre, sensor_T_pattern[:3, 2]
