"""How large a board looks to a range sensor: sides from its border points, pose and size free."""

from __future__ import annotations

from types import MappingProxyType
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle, signed_distance_to_rectangles
from atom_core.geometry.robust_sigma import OF_A_MEDIAN, robust_sigma
from atom_core.problem.measurements import Measurement
from atom_core.problem.range_measurement import RangeMeasurement

_LEAST_ON_SIDE = 3
# Of a border point, for the loss; the last is larger than what beams leave open, the first than
# what a board of another size has.
_TOLERANCES_M = (0.08, 0.057, 0.04, 0.028, *(8 * (0.02,)))
_LEAST_DETECTIONS = 3  # of a sensor, to say anything


_LARGER, _SMALLER = 0.02, 0.06  # share that beams, and holes beside the border, may explain


class MeasuredSide(NamedTuple):
    """A side of a board as a sensor sees it.

    Attributes:
        sensor, pattern: names.
        across: 0 the width (along x), 1 the height.
        configured_m, measured_m: its length; measured is the median over detections.
        sigma_m: of the median.
        detections: in which both ends are seen.
    """

    sensor: str
    pattern: str
    across: int
    configured_m: float
    measured_m: float
    sigma_m: float
    detections: int

    @property
    def is_off(self) -> bool:
        """Tell whether it is more than what the sensor's resolution may explain."""
        longer_m = self.measured_m - self.configured_m
        share = longer_m / self.configured_m
        return abs(longer_m) > 3.0 * self.sigma_m and not -_SMALLER < share < _LARGER


def measured_sides(
    measurements: Sequence[Measurement],
    beam_width_rad: Mapping[str, float] = MappingProxyType({}),
) -> List[MeasuredSide]:
    """Return the sides of boards that at least three detections of a sensor show whole.

    What beams of a known width, by sensor, enlarge a board by is taken off.
    """
    found: Dict[Tuple[str, str, int], List[float]] = {}
    borders: Dict[str, Rectangle] = {}
    for measurement in measurements:
        if isinstance(measurement, RangeMeasurement):
            key = measurement.key
            borders[key.pattern] = measurement.border
            width_rad = beam_width_rad.get(key.sensor, 0.0)
            for across, length_m in enumerate(board_sides_m(measurement)):
                if length_m is not None:
                    away_m = np.linalg.norm(np.mean(measurement.limit, axis=0))
                    true_m = length_m - width_rad * float(away_m)
                    found.setdefault((key.sensor, key.pattern, across), []).append(true_m)
    return [
        _side(*key, borders[key[1]], np.array(lengths))
        for key, lengths in found.items()
        if len(lengths) >= _LEAST_DETECTIONS
    ]


def _side(
    sensor: str, pattern: str, across: int, border: Rectangle, lengths_m: np.ndarray
) -> MeasuredSide:
    median = float(np.median(lengths_m))
    sigma = OF_A_MEDIAN * robust_sigma(lengths_m - median) / np.sqrt(len(lengths_m))
    configured = 2.0 * float(border.half_size[across])
    return MeasuredSide(sensor, pattern, across, configured, median, float(sigma), len(lengths_m))


def board_sides_m(measurement: RangeMeasurement) -> Tuple[Optional[float], Optional[float]]:
    """Return width and height of a board [m] as its limit points show them; None where they do not.

    Centre, angle and half sides by robust Gauss-Newton. A side is shown where its two ends have
    three limit points each. Limit points lie half a beam step or a pixel inside the border, so that
    a board looks that much smaller on each side.
    """
    candidates = measurement.candidates()
    if not candidates or not len(measurement.limit):
        return None, None
    pattern_T_sensor = se3.inverse(candidates[0])
    limit = se3.apply(pattern_T_sensor, measurement.limit)[:, :2]
    centre, half, angle = measurement.border.centre, measurement.border.half_size.copy(), 0.0
    pivot = centre.copy()
    ends = np.zeros(4, dtype=int)
    for tolerance_m in _TOLERANCES_M:
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = (limit - pivot) @ np.array([[cosine, -sine], [sine, cosine]]) + pivot
        off, gradient = signed_distance_to_rectangles(turned, centre, half)
        weight = 1.0 / (1.0 + (off / tolerance_m) ** 2) ** 2
        across_x = np.abs(gradient[:, 0]) > np.abs(gradient[:, 1])
        sides = [across_x & (gradient[:, 0] < 0), across_x & (gradient[:, 0] > 0)]
        sides += [~across_x & (gradient[:, 1] < 0), ~across_x & (gradient[:, 1] > 0)]
        ends = np.array([int(np.sum(side & (weight > 0.25))) for side in sides])
        moved = turned - pivot
        turning = gradient[:, 0] * moved[:, 1] - gradient[:, 1] * moved[:, 0]
        known = [min(ends[:2]) >= _LEAST_ON_SIDE, min(ends[2:]) >= _LEAST_ON_SIDE]
        grown = -1.0 * np.column_stack([across_x * known[0], ~across_x * known[1]])
        rows = np.column_stack([-gradient, turning, grown])
        weighted = rows.T * weight
        step = -np.linalg.solve(weighted @ rows + 1e-6 * np.eye(5), weighted @ off)
        centre, angle, half = centre + step[:2], angle + float(step[2]), half + step[3:]
        half = np.maximum(half, 0.01)
    width = 2.0 * float(half[0]) if min(ends[:2]) >= _LEAST_ON_SIDE else None
    height = 2.0 * float(half[1]) if min(ends[2:]) >= _LEAST_ON_SIDE else None
    return width, height
