"""Did sensors move alike while the data of all collections were taken, by the transforms?

A sensor on an arm that always sweeps the same way, or before a board that an arm sweeps, is put
elsewhere by what its stamps are late, and by a rolling shutter: no residual shows that.
"""

from __future__ import annotations

from typing import Dict, List, Mapping, Tuple

import numpy as np

from atom_calibration.errors import TransformError
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.model.caveats import Caveat
from atom_core.model.pattern import Pattern

LATE_S = 0.02  # what stamps of cameras and scanners may be late by, where nobody has measured it
_AROUND_S = 0.05  # before and after a stamp, between which a motion is taken
_MOST_M, _MOST_RAD = 0.001, float(np.radians(0.05))  # what may come of it without a word
_FEWEST = 2  # collections that move alike


class CommonMotion:
    """The motions of each sensor beside the boards that it saw, by collection."""

    def __init__(self, patterns: Mapping[str, Pattern]):
        """Know the patterns; nothing was collected yet."""
        self._patterns = patterns
        self._twists: Dict[str, Dict[str, np.ndarray]] = {}  # by collection and sensor

    def add(
        self, key: str, frames: Mapping[str, Frame], tree: TransformTree, at_rest: bool
    ) -> None:
        """Take note of a collection; what the transforms around it do not tell counts as rest.

        Args:
            key: of the collection.
            frames: of it, by sensor.
            tree: around its time.
            at_rest: the labels have shown that boards stood before the sensors; they may ride on
                one vehicle.
        """
        found = {}
        for name, frame in frames.items():
            seen = [name for name, labeled in frame.labels.items() if labeled.detected]
            parents = {self._patterns[p].parent_frame for p in seen if p in self._patterns}
            twists = [_twist(tree, frame.sensor.frame, p, frame.stamp_s) for p in sorted(parents)]
            if twists:
                found[name] = np.zeros(6) if at_rest else np.mean(twists, axis=0)
        self._twists[key] = found

    def delete(self, key: str) -> None:
        """Forget a collection."""
        self._twists.pop(key, None)

    @property
    def caveats(self) -> Tuple[Caveat, ...]:
        """The sensors that late stamps would put elsewhere."""
        by_sensor: Dict[str, List[np.ndarray]] = {}
        for of_one in self._twists.values():
            for name, twist in of_one.items():
                by_sensor.setdefault(name, []).append(twist)
        return tuple(
            _caveat(name, np.mean(twists, axis=0), len(twists))
            for name, twists in by_sensor.items()
            if len(twists) >= _FEWEST and _matters(np.mean(twists, axis=0))
        )


def _twist(tree: TransformTree, frame: str, parent: str, stamp_s: float) -> np.ndarray:
    """Return how fast what boards hang on moves in a sensor's frame: (6,) turns [rad/s], [m/s]."""
    try:
        before, after = (
            tree.lookup(frame, parent, stamp_s + side * _AROUND_S) for side in (-1.0, 1.0)
        )
    except TransformError:
        return np.zeros(6)
    move = after @ se3.inverse(before)
    turn = se3.rotation_vector_from_rotation(move[:3, :3])
    # The place at the sensor's origin: what its own pose would take up.
    return np.append(turn, move[:3, 3]) / (2.0 * _AROUND_S)


def _matters(twist: np.ndarray) -> bool:
    metres, radians = (LATE_S * size for size in se3.twist_sizes(twist))
    return metres > _MOST_M or radians > _MOST_RAD


def _caveat(name: str, twist: np.ndarray, count: int) -> Caveat:
    metres, radians = se3.twist_sizes(twist)
    return Caveat(
        (name,),
        f"it moved alike while the data of its {count} collections were taken, "
        f"{1e3 * metres:.0f} mm/s and {np.degrees(radians):.1f} deg/s in the mean, by the "
        f"transforms: where its stamps are {1e3 * LATE_S:.0f} ms late, or its shutter rolls, it "
        f"ends {1e3 * LATE_S * metres:.1f} mm and {np.degrees(LATE_S * radians):.2f} deg beside "
        f"its place, and no residual shows that",
        "stop for each picture, or move the opposite way as often",
    )
