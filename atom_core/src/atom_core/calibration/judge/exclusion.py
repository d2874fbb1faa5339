"""Whether too much of a sensor was left out, or all of one sort: then the rest proves nothing.

Single bad labels are left out, and the answer is the better for it. Where they are more than a
tenth of what a sensor saw, or where they are all tilted, far away or on one side, chance and
carelessness do not explain them: what is assumed does not hold, and those that are left may agree
only because whatever contradicted them is gone.
"""

from __future__ import annotations

import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.special import ndtr

from atom_core.calibration.judge.misfit import BOARD, INTRINSICS, POINTS
from atom_core.calibration.refine.rejection import GARBAGE, Rejected
from atom_core.model.dataset import Dataset
from atom_core.problem.measurements import Measurement

_SHARE, _FEWEST = 0.1, 2  # more of a sensor's detections left out, and at least so many
_FEWEST_OF_A_SORT = 3
_CHANCE = 1e-3  # of a sensor's rejections being of one sort, all features together
_WORTH_SAYING = 0.02  # where too many were left out anyway
_EXACT = 12  # up to so many left out their ranks are counted, beyond a normal distribution serves
TILT, SIDE, HEIGHT, DISTANCE, WHEN = "tilt", "side", "height", "distance", "when"
_SORTS = {  # what the larger and the smaller values are
    TILT: ("tilted more", "seen more squarely", "deg"),
    SIDE: ("farther left", "farther right", "deg"),
    HEIGHT: ("higher", "lower", "deg"),
    DISTANCE: ("farther away", "nearer", "m"),
    WHEN: ("collected later", "collected earlier", ""),
}
_MOVED = "whether it was moved meanwhile (-csf calibrates the collections of one side alone)"
_LABELS = "whether its labels and data belong to these collections and boards"


class Sort(NamedTuple):
    """What the detections that were left out share.

    Attributes:
        feature: tilt, side, height, distance, or when it was collected.
        rejected, kept: its median of those left out and of the others [deg, m, or place in the
            order of collections].
        chance: that as many detections taken at random are as far apart from the others.
    """

    feature: str
    rejected: float
    kept: float
    chance: float

    @property
    def words(self) -> str:
        """What they are, and the figures."""
        more, less, unit = _SORTS[self.feature]
        what = more if self.rejected > self.kept else less
        if self.feature == WHEN:
            return what
        return f"{what} ({self.rejected:.3g} {unit} in the middle, the others {self.kept:.3g})"


class Exclusion(NamedTuple):
    """One sensor, too much of which was left out.

    Attributes:
        sensor: which one.
        rejected: how many of its detections were left out.
        detections: how many it had.
        shared: what they have in common, if anything.
        collections: those that contradict the others most first.
        likely: where to look, the likeliest first.
    """

    sensor: str
    rejected: int
    detections: int
    shared: Optional[Sort]
    collections: Tuple[str, ...]
    likely: Tuple[str, ...]

    @property
    def why(self) -> str:
        """One clause for the user: how many, which, what they share, and what is likely."""
        worst = ", ".join(self.collections[:3])
        alike = "" if self.shared is None else f"; most of them {self.shared.words}"
        return (
            f"{self.rejected} of {self.detections} detections of {self.sensor} contradict the "
            f"others and were left out (worst in {worst}{alike}): single bad labels do not explain "
            f"it; look at {', then at '.join(self.likely)}"
        )


def exclusions(
    dataset: Dataset, measurements: Sequence[Measurement], rejected: Sequence[Rejected]
) -> List[Exclusion]:
    """Return the sensors of which too much was left out, or all of one sort; the worst first.

    Args:
        dataset: whose sensors and boards.
        measurements: of all detections, those left out among them.
        rejected: what was left out.
    """
    found = []
    for sensor in dict.fromkeys(r.key.sensor for r in rejected):
        out = [r for r in rejected if r.key.sensor == sensor]
        mine = [m for m in measurements if m.key.sensor == sensor]
        many = len(out) >= _FEWEST and len(out) > _SHARE * len(mine)
        limit = _WORTH_SAYING if many else _CHANCE
        shared = _shared(dataset, mine, out) if len(out) >= _FEWEST_OF_A_SORT else None
        if shared is not None and shared.chance >= limit:
            shared = None
        if many or shared is not None:
            order = sorted(out, key=lambda r: -r.excess)
            names = tuple(dict.fromkeys(r.key.collection for r in order))
            likely = _likely(dataset, sensor, shared, out)
            found.append(Exclusion(sensor, len(out), len(mine), shared, names, likely))
    return sorted(found, key=lambda e: -e.rejected / e.detections)


def _likely(
    dataset: Dataset, sensor: str, shared: Optional[Sort], out: Sequence[Rejected]
) -> Tuple[str, ...]:
    """Return where to look, the likeliest first."""
    is_range = dataset.sensors[sensor].kind.measures_range
    own = POINTS if is_range else INTRINSICS
    if 2 * sum(r.reason == GARBAGE for r in out) > len(out):
        return ("the labels themselves, which fit no board", BOARD, own)
    if shared is None:
        return (_LABELS, own, BOARD)
    if shared.feature == WHEN:
        return (_MOVED, _LABELS, own)
    if shared.feature == TILT:
        return (BOARD, own, _LABELS)
    if shared.feature == DISTANCE:
        reach = "the offset and the unit of its distances" if is_range else "its focal length"
        return (reach, BOARD, _LABELS)
    return (own, BOARD, _LABELS)


# ------------------------------------------------------------------------------- what they share


def _shared(
    dataset: Dataset, mine: Sequence[Measurement], out: Sequence[Rejected]
) -> Optional[Sort]:
    """Return by what the rejections of a sensor are set apart most, its chance corrected."""
    keys = {r.key for r in out}
    order = {name: i for i, name in enumerate(dataset.collections)}
    seen: List[Dict[str, float]] = []
    chosen: List[bool] = []
    for m in mine:
        features = _features(dataset, m)
        if features is not None:
            seen.append({**features, WHEN: float(order[m.key.collection])})
            chosen.append(m.key in keys)
    is_out = np.array(chosen, dtype=bool)
    if np.sum(is_out) < _FEWEST_OF_A_SORT or np.sum(~is_out) < _FEWEST_OF_A_SORT:
        return None
    sorts = []
    for name in _SORTS:
        values = np.array([features[name] for features in seen])
        values = _about_the_middle(values) if name == SIDE else values
        chance = min(len(_SORTS) * chance_of_ranks(values, is_out), 1.0)
        middles = float(np.median(values[is_out])), float(np.median(values[~is_out]))
        sorts.append(Sort(name, *middles, chance))
    return min(sorts, key=lambda sort: sort.chance)


def _features(dataset: Dataset, m: Measurement) -> Optional[Dict[str, float]]:
    """Return how a detection by itself has its board in the sensor [deg, deg, deg, m]."""
    candidates = m.likely_candidates()
    if not candidates:
        return None
    pose, border = candidates[0], dataset.patterns[m.key.pattern].border
    centre = pose[:3, :2] @ border.centre + pose[:3, 3]
    distance = float(np.linalg.norm(centre))
    squarely = abs(float(pose[:3, 2] @ centre)) / max(distance, 1e-9)
    forwards, left, up = centre
    if dataset.sensors[m.key.sensor].kind.has_camera_info:  # an optical frame
        forwards, left, up = centre[2], -centre[0], -centre[1]
    return {
        TILT: math.degrees(math.acos(min(squarely, 1.0))),
        SIDE: math.degrees(math.atan2(left, forwards)),
        HEIGHT: math.degrees(math.atan2(up, math.hypot(forwards, left))),
        DISTANCE: distance,
    }


def _about_the_middle(degrees: np.ndarray) -> np.ndarray:
    """Return bearings (n,) [deg] relative to their mean direction: a LiDAR looks all around."""
    directions = np.exp(1j * np.radians(degrees))
    middle = directions.sum()
    return np.asarray(np.degrees(np.angle(directions * np.conj(middle))))


def chance_of_ranks(values: np.ndarray, chosen: np.ndarray) -> float:
    """Return how likely as many values taken at random have ranks as far from the middle.

    The two-sided rank-sum test (Wilcoxon 1945, Mann and Whitney 1947), exact for few, ties
    included.

    Args:
        values: (n,).
        chosen: (n,) bool.
    """
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    doubled = (2 * np.cumsum(count) - count + 1)[place]  # twice the mean rank of equal values
    n, k = len(values), int(np.sum(chosen))
    middle = k * (n + 1)
    off = abs(int(np.sum(doubled[chosen])) - middle)
    if min(k, n - k) > _EXACT:
        variance = k * (n - k) / (n - 1.0) * float(np.var(doubled))
        return float(2.0 * ndtr(-off / math.sqrt(max(variance, 1e-300))))
    if k > n - k:  # the others' ranks say the same
        k, middle = n - k, (n - k) * (n + 1)
    ways = np.zeros((k + 1, k * 2 * n + 1))
    ways[0, 0] = 1.0
    for rank in doubled:
        ways[1:, rank:] += ways[:-1, : ways.shape[1] - rank].copy()
    sums = np.arange(ways.shape[1])
    return float(np.sum(ways[k, np.abs(sums - middle) >= off]) / np.sum(ways[k]))
