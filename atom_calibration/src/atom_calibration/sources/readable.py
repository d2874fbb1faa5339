"""Can the data of a sensor be read at all? Single messages of a recording may be damaged."""

from __future__ import annotations

from itertools import islice
from typing import Optional

from atom_calibration.errors import MessageError
from atom_calibration.modalities.frames import decode
from atom_calibration.sources.bag_reader import BagReader
from atom_core.model.sensor import Sensor

_TRIED = 200  # messages of a sensor of which one must be readable


def why_unreadable(bag: BagReader, topic: str, sensor: Sensor) -> Optional[MessageError]:
    """Return why the first message of a topic cannot be read, if none of those after it can."""
    first: Optional[MessageError] = None
    for found in islice(bag.messages([topic]), _TRIED):
        try:
            decode(sensor, found.message)
            return None
        except MessageError as error:
            first = first or error
    return first
