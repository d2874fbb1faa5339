"""Where in its view a sensor has seen the board, at which distances and tilts, and what is missing.

It is advice while data are collected, no condition: whether a calibration is determined is said by
`check` and by the calibration itself. Every threshold stands here.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

LEAST_BOARDS = 8  # of a sensor
FARTHEST_BY_NEAREST = 1.5  # distances shall differ by this factor
LEAST_TILT_DEG = 25.0  # of the most tilted board
LEAST_SPREAD_DEG = 15.0  # of the normals, about every axis
LEAST_FAN_DEG = 30.0  # of the directions, where a sensor sees all round
NEAR_SHARE = 0.1  # of the image's area: a board that fills more is near
_BOX = ("view_left", "view_top", "view_right", "view_bottom")
_NORMAL = ("normal_x", "normal_y", "normal_z")
_SIDES = (("left", 0, 0), ("right", 0, 1), ("top", 1, 0), ("bottom", 1, 1))  # word, axis, end
_TILTED, _ANOTHER_WAY = "tilted", "tilted another way"
_ADVICE = {
    "near": "near",
    "far": "far away",
    "nearer or farther": "nearer or farther than so far",
    "left": "in the left third of its view",
    "right": "in the right third of its view",
    "top": "in the upper third of its view",
    "bottom": "in the lower third of its view",
    "more to the sides": "more to its sides",
    _TILTED: f"tilted by {LEAST_TILT_DEG:.0f} deg and more, left, right, up and down",
    _ANOTHER_WAY: "tilted {}",
}
_FEW = 3  # boards that one is asked for at least
_ACROSS, _UPRIGHT, _FACING = "to the left and right", "up and down", "less, facing it"
_LOWEST_RAD, _HIGHEST_RAD = -np.pi / 4, np.pi / 4  # of the map of what sees all round
ALL_ROUND_ASPECT = 2.0 * np.pi / (_HIGHEST_RAD - _LOWEST_RAD)


class BoardView(NamedTuple):
    """A board as a sensor saw it.

    Attributes:
        box: (4,) left, top, right and bottom of what is labeled, as shares of the view.
        distance_m: to the board; NaN: not known.
        tilt_deg: between its normal and the line of sight; NaN: not known.
        normal: (3,) of its plane in the sensor's frame, either way; NaN: not known.
    """

    box: np.ndarray
    distance_m: float
    tilt_deg: float
    normal: np.ndarray


class Guidance(NamedTuple):
    """What a sensor has seen, and what it has not.

    Attributes:
        views: of each board, in the order of the collections.
        missing: in a word or two each; empty when it is enough.
        turns: which way boards are to be tilted that they have not been so far; empty: any.
    """

    views: Tuple[BoardView, ...]
    missing: Tuple[str, ...]
    turns: str = ""

    @property
    def enough(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing

    @property
    def sentence(self) -> str:
        """What to tell the user."""
        return "enough" if self.enough else f"still missing: {', '.join(self.missing)}"

    @property
    def advice(self) -> str:
        """What to collect, as a part of a sentence; empty when it is enough."""
        if self.enough:
            return ""
        count = max(LEAST_BOARDS - len(self.views), _FEW)
        wanted = [_ADVICE[word].format(self.turns) for word in self.missing if word in _ADVICE]
        where = f" for it: {', '.join(wanted)}" if wanted else " for it"
        return f"collect {count} boards{where}".rstrip()


def image_box(pixels: np.ndarray, width: int, height: int) -> Dict[str, float]:
    """Return where labeled pixels (n, 2) lie in an image, as figures of a label."""
    size = np.array([width, height], dtype=float)
    return _box_figures((pixels + 0.5) / size)


def all_round_box(points: np.ndarray) -> Dict[str, float]:
    """Return where points (n, 3) lie about a sensor that sees all round, as figures of a label.

    The middle of the map is the sensor's x axis, its left end is straight behind, counted over the
    left; its height is 90 degrees. A board that stands behind reaches over both ends: then the box
    is as wide as the map.
    """
    x, y, z = points[np.all(np.isfinite(points), axis=1)].T
    azimuth, elevation = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
    down = (_HIGHEST_RAD - elevation) / (_HIGHEST_RAD - _LOWEST_RAD)
    return _box_figures(np.column_stack([0.5 - azimuth / (2.0 * np.pi), down]))


def normal_figures(normal: np.ndarray) -> Dict[str, float]:
    """Return a board's normal (3,) in the sensor's frame as figures of a label."""
    return {name: float(value) for name, value in zip(_NORMAL, normal)}


def board_view(figures: Mapping[str, float]) -> Optional[BoardView]:
    """Return the view that the figures of a label tell; None where they do not say where it is."""
    if not all(name in figures for name in _BOX):
        return None
    return BoardView(
        np.array([figures[name] for name in _BOX]),
        figures.get("distance_m", np.nan),
        figures.get("tilt_deg", np.nan),
        np.array([figures.get(name, np.nan) for name in _NORMAL]),
    )


def guidance(views: Sequence[BoardView], has_image: bool) -> Guidance:
    """Return what a sensor has seen so far, and what would help.

    Args:
        views: of all collections.
        has_image: its view is an image; otherwise it sees all round.
    """
    missing: List[str] = []
    if len(views) < LEAST_BOARDS:
        more = LEAST_BOARDS - len(views)
        missing.append(f"{more} more board{'s' if more > 1 else ''}")
    if not views:
        return Guidance((), tuple(missing))
    boxes = np.array([view.box for view in views])
    missing += _missing_distance(views, boxes, has_image)
    missing += _missing_sides(boxes) if has_image else _missing_directions(boxes)
    missing += _missing_tilt(views)
    turns = _lacking_turns(views, has_image) if _ANOTHER_WAY in missing else ""
    return Guidance(tuple(views), tuple(missing), turns)


def _box_figures(shares: np.ndarray) -> Dict[str, float]:
    """Return the box around shares (n, 2) of the view; nothing without any."""
    if not len(shares):
        return {}
    shares = np.clip(shares, 0.0, 1.0)
    ends = [*shares.min(axis=0), *shares.max(axis=0)]
    return {name: float(value) for name, value in zip(_BOX, ends)}


def _missing_distance(views: Sequence[BoardView], boxes: np.ndarray, has_image: bool) -> List[str]:
    distances = np.array([view.distance_m for view in views])
    distances = distances[np.isfinite(distances)]
    if len(distances) and distances.max() >= FARTHEST_BY_NEAREST * distances.min():
        return []
    if not has_image:
        return ["nearer or farther"]
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    return ["far" if areas.max() >= NEAR_SHARE else "near"]


def _missing_sides(boxes: np.ndarray) -> List[str]:
    """Return the thirds of an image that no board has reached."""
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    return [
        word
        for word, axis, end in _SIDES
        if (high[axis] < 2.0 / 3.0 if end else low[axis] > 1.0 / 3.0)
    ]


def _missing_directions(boxes: np.ndarray) -> List[str]:
    """Say so where all boards are in one direction; behind the sensor is beside behind it."""
    middles = np.sort(np.mean(boxes[:, [0, 2]], axis=1))
    gaps = np.diff(np.append(middles, middles[0] + 1.0))
    return [] if 360.0 * (1.0 - gaps.max()) >= LEAST_FAN_DEG else ["more to the sides"]


def _missing_tilt(views: Sequence[BoardView]) -> List[str]:
    """Say so where boards are not tilted, or all alike; of a line nobody knows."""
    normals = np.array([view.normal for view in views])
    normals = normals[np.all(np.isfinite(normals), axis=1)]
    if not len(normals):
        return []
    tilts = np.array([view.tilt_deg for view in views])
    if not np.any(tilts >= LEAST_TILT_DEG):
        return [_TILTED]
    spread = np.linalg.svd(normals / np.sqrt(len(normals)), compute_uv=False)
    flat = len(normals) < 3 or spread[-1] < np.sin(np.deg2rad(LEAST_SPREAD_DEG))
    return [_ANOTHER_WAY] if flat else []


def _lacking_turns(views: Sequence[BoardView], has_image: bool) -> str:
    """Return which way boards would have to be tilted so that their normals leave one plane.

    A camera has x to the right, y down and z ahead; what sees all round has z upright.
    """
    normals = np.array([view.normal for view in views])
    normals = normals[np.all(np.isfinite(normals), axis=1)]
    across = np.abs(np.linalg.svd(normals)[2][-1])
    if not has_image:
        return _UPRIGHT if across[2] > np.hypot(across[0], across[1]) else _ACROSS
    return (_ACROSS, _UPRIGHT, _FACING)[int(np.argmax(across))]
