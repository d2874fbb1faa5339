"""Stops that were collected, by which those of a recording that is played again are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Mapping, Tuple

from atom_calibration.collect.selection import HasSightings, Moment, same_place
from atom_core.labeling.stillness import Sighting


@dataclass(frozen=True)
class _Seen:
    """Where a sensor saw the boards, by pattern; without its data, which take memory."""

    sightings: Mapping[str, Sighting]


class CollectedStops:
    """When, and where, the boards stood in each collection.

    Only stops from before the time went back are known again: within one recording the same place
    at another time is another stop, and a simulation that is reset may put the board elsewhere.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self._stops: Dict[str, Tuple[Moment, Mapping[str, _Seen]]] = {}
        self._before: Dict[str, Tuple[Moment, Mapping[str, _Seen]]] = {}

    def add(self, key: str, moment: Moment, frames: Mapping[str, HasSightings]) -> None:
        """Take in what was collected under a key."""
        seen = {name: _Seen(dict(frame.sightings)) for name, frame in frames.items()}
        self._stops[key] = (moment, seen)

    def delete(self, key: str) -> None:
        """Forget a collection: its stop may be taken again."""
        self._stops.pop(key, None)
        self._before.pop(key, None)

    def begin_anew(self) -> None:
        """Time went back: what was collected until now may come once more."""
        self._before.update(self._stops)
        self._stops.clear()

    def has(self, moment: Moment, frames: Mapping[str, HasSightings]) -> bool:
        """Tell whether boards stood where they stand now at that time in the play before."""
        return any(
            done.start_s <= moment.end_s
            and moment.start_s <= done.end_s
            and same_place(frames, seen)
            for done, seen in self._before.values()
        )
