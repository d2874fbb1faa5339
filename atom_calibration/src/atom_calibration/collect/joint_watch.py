"""Do /tf and /joint_states say the same of a robot's joints? Those that differ are in doubt."""

from __future__ import annotations

import math
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_calibration.sources.contradictions import DoubtfulEdge
from atom_calibration.sources.joint_readings import Readings
from atom_core.model.joints import PRISMATIC, JointState

_SAME_M, _SAME_RAD = 0.001, 0.002  # readings of a joint at rest flicker by less
_COLLECTIONS = 2  # in which a joint is elsewhere; one may have been hit by a delay


class Told(NamedTuple):
    """Where a joint was read to be, and by how much its readings about then differ [rad or m]."""

    position: float
    spread: float


class JointWatch:
    """Compares the joints of collections, which /tf tells, with what was read of them."""

    def __init__(self, readings: Callable[[float], Mapping[str, Readings]]):
        """Begin; ``readings`` returns those of each joint around a time [s]."""
        self._readings = readings
        self._elsewhere: Dict[str, List[Tuple[JointState, Told]]] = {}

    def see(self, time_s: float, joints: Mapping[str, JointState]) -> None:
        """Note the joints of a collection of a time [s]."""
        readings = self._readings(time_s) if joints else {}
        for name, joint in joints.items():
            told = position_at(readings.get(name, ()), time_s)
            same = _SAME_M if joint.type == PRISMATIC else _SAME_RAD
            if told is not None and _apart(joint, told) > same + told.spread:
                self._elsewhere.setdefault(name, []).append((joint, told))

    @property
    def doubtful(self) -> List[DoubtfulEdge]:
        """The edges of joints that are elsewhere to /tf than they were read."""
        return [
            _doubt(name, *seen[0])
            for name, seen in self._elsewhere.items()
            if len(seen) >= _COLLECTIONS
        ]


def position_at(readings: Readings, time_s: float) -> Optional[Told]:
    """Return where a joint was at a time [s]; None: that is not told.

    Args:
        readings: stamps [s] and positions [rad or m] about that time.
        time_s: which.
    """
    if not readings:
        return None
    stamps_s, positions = np.array(sorted(readings)).T
    return Told(float(np.interp(time_s, stamps_s, positions)), float(np.ptp(positions)))


def _apart(joint: JointState, told: Told) -> float:
    apart = joint.position - told.position
    if joint.type != PRISMATIC:  # a transform does not tell how many turns there were
        apart = math.remainder(apart, 2.0 * math.pi)
    return abs(apart)


def _doubt(name: str, joint: JointState, told: Told) -> DoubtfulEdge:
    apart, unit = _apart(joint, told), "m" if joint.type == PRISMATIC else "rad"
    size = f"{1e3 * apart:.1f} mm" if unit == "m" else f"{math.degrees(apart):.2f} deg"
    return DoubtfulEdge(
        joint.edge,
        False,
        f"joint '{name}' is at {joint.position:.4f} {unit} by /tf and the description, and at "
        f"{told.position:.4f} {unit} by /joint_states, {size} apart, and /tf counts",
        "if /joint_states is right, collect_from_bag --description takes it; else correct what "
        "publishes it, or give the description that the robot was run with",
    )
