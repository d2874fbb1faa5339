"""Do the clocks of the sensors agree? Stamps against the times at which a bag received them."""

from __future__ import annotations

from itertools import islice
from typing import Collection, Dict, List, Mapping, NamedTuple, Optional

from atom_calibration.errors import CollectionError
from atom_calibration.messages.headers import stamp_s
from atom_calibration.sources.bag_reader import BagReader
from atom_core.model.sensor import Sensor

_OTHER_CLOCK_S = 10.0
_NOTEWORTHY_S = 0.15  # exposure, a turn of a LiDAR and the way to the recorder take less
_FIRST = 3  # messages that tell whether there are stamps
_AHEAD_S = 0.02  # a stamp after its receipt cannot be right; clocks of two computers may differ


class Judged(NamedTuple):
    """How clocks are judged.

    Attributes:
        option: what takes the times of receipt of some sensors, with {} for their names.
        late_s: data may come later than those of others by so much [s].
        ahead_s: stamps may lie after the receipt by so much [s].
    """

    option: str = "--use_receive_time {}"
    late_s: float = _NOTEWORTHY_S
    ahead_s: float = _AHEAD_S


OFFLINE = Judged()


def receipt_lags_s(bag: BagReader, topics: Mapping[str, Sensor]) -> Dict[str, float]:
    """Return by sensor how long after their stamps its first messages were received [s].

    Args:
        bag: the recording.
        topics: sensors by the topic of their data.
    """
    lags = {s.name: bag.receipt_lag_s([topic], stamp_s) for topic, s in topics.items()}
    return {name: lag for name, lag in lags.items() if lag is not None}


def check_stamped(
    bag: BagReader, topics: Mapping[str, Sensor], received: Collection[str] = ()
) -> None:
    """Refuse data whose driver sets no stamps.

    Args:
        bag: the recording.
        topics: sensors by the topic of their data.
        received: sensors whose stamps are not used.

    Raises:
        CollectionError: naming the sensors.
    """
    unset = []
    for topic, sensor in topics.items():
        first = islice(bag.messages([topic]), _FIRST)
        stamps_s = [stamp_s(found.message) for found in first]
        if len(stamps_s) > 1 and not any(stamps_s) and sensor.name not in received:
            unset.append(sensor.name)
    if unset:
        raise CollectionError(
            f"{bag.path}: the stamps of {', '.join(unset)} are all zero (header.stamp is not set "
            f"by the driver); --use_receive_time {' '.join([*received, *unset])} takes the times "
            f"of receipt instead"
        )


def check_received(received: Collection[str], sensors: Collection[str]) -> None:
    """Refuse names, of sensors whose times of receipt are to be taken, that are no sensor's.

    Raises:
        CollectionError: naming the sensors that there are.
    """
    for name in received:
        if name not in sensors:
            raise CollectionError(
                f"--use_receive_time: there is no sensor '{name}'; there are {', '.join(sensors)}"
            )


def check_clocks(
    lags_s: Mapping[str, float],
    tf_lag_s: Optional[float],
    received: Collection[str] = (),
    judged: Judged = OFFLINE,
) -> List[str]:
    """Return what a user should know of the sensors' clocks, a sentence for each.

    What all sensors have in common is no fault: a bag may be a copy of an older one. The sensor
    whose stamps are nearest to the times of receipt is what the others are compared with.

    Args:
        lags_s: receipt after stamp by sensor [s]; 0 for sensors whose stamps are not used.
        tf_lag_s: that of the moving transforms; None: nothing moves.
        received: sensors whose stamps are not used.
        judged: what is noteworthy, and how the remedy is called.

    Raises:
        CollectionError: a sensor, or the transforms, have another clock.
    """
    usual_s = min(lags_s.values(), key=abs)
    warnings = []
    for name, lag_s in lags_s.items():
        more_s = lag_s - usual_s
        remedy = judged.option.format(_to_receive(lags_s, {name, *received}))
        if abs(more_s) > _OTHER_CLOCK_S:
            side = "before" if more_s > 0 else "after"
            raise CollectionError(
                f"sensor '{name}': its stamps are {abs(more_s):.1f} s {side} those of the other "
                f"sensors, against the times of receipt: it has another clock; {remedy} takes the "
                f"times of receipt instead"
            )
        if more_s > judged.late_s:
            warnings.append(
                f"sensor '{name}': its data were received {more_s:.2f} s later after their stamps "
                f"than those of the other sensors: they came late, or its clock is behind; if its "
                f"clock is, {remedy}"
            )
        elif more_s < -judged.late_s or max(lag_s, more_s) < -judged.ahead_s:
            warnings.append(
                f"sensor '{name}': against the times of receipt its stamps lie {-more_s:.2f} s "
                f"after those of the other sensors: its clock is ahead; {remedy} takes the times "
                f"of receipt instead"
            )
    if tf_lag_s is not None and abs(tf_lag_s - usual_s) > _OTHER_CLOCK_S:
        raise CollectionError(_other_clock(lags_s, tf_lag_s, usual_s))
    return warnings


def _to_receive(lags_s: Mapping[str, float], named: Collection[str]) -> str:
    """Return the sensors to take the times of receipt of: the named, and what these do not fit."""
    return " ".join(n for n, lag_s in lags_s.items() if n in named or abs(lag_s) > _OTHER_CLOCK_S)


def _other_clock(lags_s: Mapping[str, float], tf_lag_s: float, usual_s: float) -> str:
    """Return what to say of transforms and sensors that have not one clock."""
    apart_s = tf_lag_s - usual_s
    remedy = "record it with the clock of the sensors"
    if abs(tf_lag_s) <= _OTHER_CLOCK_S:
        names = " ".join(lags_s)
        remedy = f"--use_receive_time {names} takes the times of receipt, as /tf has them"
    return (
        f"/tf: its stamps are {abs(apart_s):.1f} s {'before' if apart_s > 0 else 'after'} those of "
        f"the sensors, against the times of receipt: it has another clock; {remedy}"
    )


def start_lag_s(lags_s: Mapping[str, float], tf_lag_s: Optional[float]) -> float:
    """Return how long after the stamps of its data a bag was recorded [s]; a delay counts as 0."""
    lag_s = min(lags_s.values(), key=abs, default=0.0) if tf_lag_s is None else tf_lag_s
    return lag_s if abs(lag_s) > _OTHER_CLOCK_S else 0.0
