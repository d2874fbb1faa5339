"""The modality of a sensor: by the configuration, else by the type of its topic."""

from __future__ import annotations

from typing import Callable, List, Optional

from atom_calibration.modalities.table import modality_of
from atom_calibration.sources.live_topics import NotYetError, published_types, wait_for
from atom_calibration.sources.rig import candidate_topics
from atom_core.model.config import SensorConfig


def modality_of_sensor(
    name: str, entry: SensorConfig, stopped: Callable[[], bool], warn: Callable[[str], None]
) -> Optional[str]:
    """Return the modality, if need be once the topic is there; None: it was stopped before.

    Args:
        name: of the sensor.
        entry: its part of the configuration.
        stopped: tells whether to give up.
        warn: is told every few seconds what is waited for.
    """

    def by_topic() -> Optional[str]:
        topics = candidate_topics(entry)
        types = published_types(topics)
        known = [modality_of(entry, types.get(topic, "")) for topic in topics]
        found: List[str] = [modality for modality in known if modality is not None]
        if not found:
            raise NotYetError(
                f"sensor '{name}' has no modality in the configuration, and topic "
                f"{entry.topic_name} is not published"
            )
        return found[0]

    return entry.modality or wait_for(by_topic, stopped, warn)
