"""One scan of a 2D LiDAR: ranges by beam, in the plane z = 0 of the sensor's frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_core.errors import DatasetError, NothingMeasuredError

_COUNT_SLACK = 1.5  # drivers disagree on whether angle_max is the last beam or one beyond it
_MOST_SLACK = 2.0  # velodyne_laserscan: angle_max is pi, and the beams are whole steps below a turn
_DECIMALS = (3, 4, 5)  # to which old datasets round the step; angle_max is then more exact
_SEAM_STEPS = 1.99  # from the last beam to the first of a closed scan, at most; at 2 one is absent


@dataclass(frozen=True, eq=False)
class LaserScan:
    """What a LaserScan message holds, checked when made.

    A beam without a usable return is NaN, infinite, zero, or outside the limits. Simulators report
    ``range_max`` itself where nothing is within reach, so it is no return.

    Attributes:
        ranges: (n,) [m], in the order of the beams.
        angle_min: azimuth of the first beam [rad], about z of the sensor's frame from its x axis.
        angle_increment: from one beam to the next [rad]; negative where the sensor turns clockwise.
        range_min, range_max: limits of a valid range [m].
        intensities: (n,) in the sensor's unit, or None.
        other: fields of the message that are kept for writing (angle_max, times, header).

    Raises:
        DatasetError: the parts do not fit together; `NothingMeasuredError`: no range is valid.
    """

    ranges: np.ndarray
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    intensities: Optional[np.ndarray] = None
    other: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        ranges = _row(self.ranges, "ranges")
        object.__setattr__(self, "ranges", ranges)
        for name in ("angle_min", "angle_increment", "range_min", "range_max"):
            object.__setattr__(self, name, _number(getattr(self, name), name))
        if self.intensities is not None:
            object.__setattr__(self, "intensities", _row(self.intensities, "intensities"))
        self._check_counts()
        if not 0.0 <= self.range_min < self.range_max:
            raise DatasetError(
                f"the laser scan's limits are range_min {self.range_min:g} m and range_max "
                f"{self.range_max:g} m; range_min must be 0 or more, and range_max above it"
            )
        if not np.any(self.valid):
            raise NothingMeasuredError(
                f"the laser scan has no valid range: none of its {len(ranges)} ranges lies between "
                f"range_min {self.range_min:g} m and range_max {self.range_max:g} m; is the sensor "
                f"covered, or are the limits in another unit?"
            )

    def _check_counts(self) -> None:
        count = len(self.ranges)
        if count < 2:
            raise DatasetError(f"the laser scan has {count} ranges; it needs at least two")
        if self.intensities is not None and len(self.intensities) != count:
            raise DatasetError(
                f"the laser scan has {count} ranges but {len(self.intensities)} intensities; leave "
                f"the intensities out, or give one for each range"
            )
        step = abs(self.angle_increment)
        if step == 0.0:
            raise DatasetError("the laser scan's angle_increment is 0; give the step in radians")
        if (count - 1) * step > 2.0 * np.pi + step:  # some repeat the first beam
            raise DatasetError(
                f"the laser scan's {count} ranges at steps of {np.degrees(step):.4g} deg make more "
                f"than one turn; correct angle_increment (radians), or the count of ranges"
            )

    @property
    def angles(self) -> np.ndarray:
        """(n,) azimuth of each beam [rad], not wrapped."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))

    @property
    def valid(self) -> np.ndarray:
        """(n,) bool: finite, not zero, within the limits."""
        with np.errstate(invalid="ignore"):
            inside = (self.ranges >= self.range_min) & (self.ranges < self.range_max)
        return inside & np.isfinite(self.ranges) & (self.ranges > 0.0)

    @property
    def beyond(self) -> np.ndarray:
        """(n,) bool: nothing within reach, said by an infinity or a range at or above the limit."""
        with np.errstate(invalid="ignore"):
            return self.ranges >= self.range_max

    @property
    def is_closed(self) -> bool:
        """Tell whether the beams go all the way round, so that the last is the first's neighbor."""
        step = abs(self.angle_increment)
        return 2.0 * np.pi - (len(self.ranges) - 1) * step < _SEAM_STEPS * step

    @property
    def points(self) -> np.ndarray:
        """(n, 3) [m] in the sensor's frame, z = 0; NaN where the range is not valid."""
        ranges, angles = np.where(self.valid, self.ranges, np.nan), self.angles
        return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), 0.0 * ranges])


def scan_from_fields(fields: Mapping[str, Any]) -> LaserScan:
    """Return the scan that a LaserScan message's fields describe, as a dataset keeps them.

    Args:
        fields: ``ranges``, ``angle_min``, ``angle_increment``, and if known ``range_min``,
            ``range_max``, ``angle_max``, ``intensities``. Others are kept as they are. A
            ``range_max`` of infinity, or of 0 where a driver does not fill it in, is no limit.

    Raises:
        DatasetError: a field is absent or no number, or counts and angles do not fit.
    """
    for name in ("ranges", "angle_min", "angle_increment"):
        if fields.get(name) is None:
            raise DatasetError(f"the laser scan has no field '{name}'; a LaserScan message has it")
    intensities = fields.get("intensities")
    known = ("ranges", "angle_min", "angle_increment", "range_min", "range_max", "intensities")
    return LaserScan(
        ranges=_row(fields["ranges"], "ranges"),
        angle_min=_number(fields["angle_min"], "angle_min"),
        angle_increment=_step(fields),
        range_min=_number(fields.get("range_min", 0.0), "range_min"),
        range_max=_farthest(fields.get("range_max")),
        intensities=None if intensities is None or len(intensities) == 0 else intensities,
        other={name: value for name, value in fields.items() if name not in known},
    )


def fields_of(scan: LaserScan) -> Dict[str, Any]:
    """Return the fields of a LaserScan message, plain numbers and lists, without a header."""
    count = len(scan.ranges)
    return {
        "angle_max": scan.angle_min + (count - 1) * scan.angle_increment,
        "time_increment": 0.0,
        "scan_time": 0.0,
        **scan.other,
        "angle_min": scan.angle_min,
        "angle_increment": scan.angle_increment,
        "range_min": scan.range_min,
        "range_max": scan.range_max,
        "ranges": scan.ranges.tolist(),
        "intensities": [] if scan.intensities is None else scan.intensities.tolist(),
    }


def _farthest(range_max: Any) -> float:
    """Return the upper limit of ranges [m]; where there is none, the largest that a message has."""
    if range_max is None or range_max in (0.0, np.inf):
        return float(np.finfo(np.float32).max)
    return _number(range_max, "range_max")


def _step(fields: Mapping[str, Any]) -> float:
    """Return the step between beams [rad], from angle_max where a dataset rounded the step.

    A message's step is a float32, and is taken as it stands; so is one that a dataset kept whole.
    """
    step, count = _number(fields["angle_increment"], "angle_increment"), len(fields["ranges"])
    if fields.get("angle_max") is None or step == 0.0 or count < 2:
        return step
    span = _number(fields["angle_max"], "angle_max") - _number(fields["angle_min"], "angle_min")
    expected, by_span = span / step + 1.0, span / (count - 1)
    if abs(expected - count) <= _COUNT_SLACK:
        return step
    if step != float(np.float32(step)) and any(round(by_span, d) == step for d in _DECIMALS):
        return by_span
    if abs(expected - count) <= _MOST_SLACK:
        return step
    raise DatasetError(
        f"the laser scan has {count} ranges, but its angles make {expected:.0f} (angle_min, "
        f"angle_max and angle_increment); correct the angles, or the count of ranges"
    )


def _row(values: Any, name: str) -> np.ndarray:
    """Return numbers (n,), read-only; None (JSON's null) is NaN."""
    try:
        row = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise DatasetError(f"the laser scan's {name} are no list of numbers") from None
    if row.ndim != 1:
        raise DatasetError(f"the laser scan's {name} have the shape {row.shape}; a row is needed")
    row.setflags(write=False)
    return row


def _number(value: Any, name: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise DatasetError(f"the laser scan's {name} is {value!r}; a finite number is needed")
    return number
