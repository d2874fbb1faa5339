"""What collect_data tells the world: how each sensor does, and what every collection holds."""

from __future__ import annotations

import time
from typing import Any, Dict, List, Mapping, Optional, Sequence

import rospy
from visualization_msgs.msg import MarkerArray

from atom_calibration.labels.label_messages import point_count
from atom_calibration.msg import (
    CollectionState,
    CollectionStates,
    CollectorState,
    PatternState,
    SensorDetection,
    SensorGuidance,
    SensorLabels,
    SensorState,
    ViewedBoard,
)
from atom_calibration.runtime import running
from atom_calibration.show.markers import sensor_names
from atom_core.io.collections import CollectionStore, StoredCollection
from atom_core.labeling.guidance import ALL_ROUND_ASPECT, BoardView, Guidance, board_view
from atom_core.labeling.view_quality import described
from atom_core.model.colours import in_order, packed, sensor_colours
from atom_core.model.config import CalibrationConfig
from atom_core.model.modality import modality_named

_EVERY_S = 0.5  # of the wall's clock: one that is simulated may stand still


class StateBoard:
    """The latched topics ~state, ~collections and ~names."""

    def __init__(self, config: CalibrationConfig, store: CollectionStore):
        """Advertise, and publish what is known before any data came."""
        self._config, self._store = config, store
        self._labels: Dict[str, SensorLabels] = {}
        self._collections: Dict[str, CollectionState] = {}
        colours = sensor_colours(config.sensors)
        self._colours = {name: packed(colour) for name, colour in colours.items()}
        self._text, self._automatic, self._due_s = "", False, 0.0
        self._state = running.Publisher("~state", CollectorState, queue_size=2, latch=True)
        self._matrix = running.Publisher("~collections", CollectionStates, queue_size=2, latch=True)
        self._names = running.Publisher("~names", MarkerArray, queue_size=2, latch=True)
        self._names.publish(sensor_names(config, colours))
        self.collections_changed()

    def see(self, labels: SensorLabels) -> None:
        """Take note of labels; any thread may call."""
        self._labels[labels.sensor] = labels

    def tell(self, text: str) -> None:
        """Publish a sentence for the user."""
        self._text, self._due_s = text, 0.0
        self.publish_if_due()

    def switch(self, automatic: bool) -> None:
        """Publish whether collections are taken by themselves."""
        self._automatic, self._due_s = automatic, 0.0
        self.publish_if_due()

    def collections_changed(
        self,
        guidance: Optional[Mapping[str, Guidance]] = None,
        aspects: Optional[Mapping[str, float]] = None,
    ) -> None:
        """Publish what the collections on the disk hold.

        Args:
            guidance: what each sensor has seen, and what is missing.
            aspects: width by height of the images, by sensor; others see all round.
        """
        keys = self._store.keys
        self._collections = {
            key: self._collections.get(key) or collection_state(self._store.load(key))
            for key in keys
        }
        found = guidance or {}
        listed = [
            guidance_message(name, self._colours[name], found[name], (aspects or {}).get(name))
            for name in in_order(found)
        ]
        self._matrix.publish(CollectionStates(list(self._collections.values()), listed))
        self._due_s = 0.0
        self.publish_if_due()

    def publish_if_due(self) -> None:
        """Publish the state when something changed, and twice a second."""
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + _EVERY_S
        state = CollectorState(
            dataset_folder=str(self._store.folder),
            automatic=self._automatic,
            collections=len(self._collections),
            message=self._text,
        )
        state.header.stamp = rospy.Time.now()
        state.header.frame_id = self._config.world_link
        state.sensors = [self._sensor_state(name) for name in in_order(self._config.sensors)]
        self._state.publish(state)

    def _sensor_state(self, name: str) -> SensorState:
        entry, labels = self._config.sensors[name], self._labels.get(name)
        state = SensorState(
            name=name,
            modality=entry.modality or "",
            colour=self._colours[name],
            topic=entry.topic_name,
            frame_id=entry.link,
        )
        if labels is None:
            return state
        state.modality, state.stamp = labels.modality, labels.header.stamp
        state.manual_seed = labels.manual_seed
        state.patterns = [self._pattern_state(labels.modality, part) for part in labels.patterns]
        return state

    def _pattern_state(self, modality: str, part: Any) -> PatternState:
        figures = dict(zip(part.quality_names, part.quality_values))
        view = board_view(figures) if part.detected else None
        pattern, possible = self._config.calibration_patterns.get(part.pattern_name), 0
        if pattern is not None and not modality_named(modality).measures_range:
            possible = pattern.dimension[0] * pattern.dimension[1]
        return PatternState(
            part.pattern_name,
            part.detected,
            part.reason,
            point_count(part),
            possible,
            described(figures),
            [] if view is None else [viewed_board(view)],
        )


def guidance_message(
    sensor: str, colour: int, found: Guidance, aspect: Optional[float]
) -> SensorGuidance:
    """Return what a sensor has seen, and what is missing, as the panel shows it.

    Args:
        sensor: its name.
        colour: 0xRRGGBB.
        found: the guidance.
        aspect: width by height of its images; None: it sees all round.
    """
    return SensorGuidance(
        sensor=sensor,
        colour=colour,
        aspect=ALL_ROUND_ASPECT if aspect is None else aspect,
        boards=[viewed_board(view) for view in found.views],
        enough=found.enough,
        missing=list(found.missing),
        sentence=found.sentence,
    )


def viewed_board(view: BoardView) -> ViewedBoard:
    """Return where a sensor sees a board."""
    return ViewedBoard(*(float(end) for end in view.box), view.distance_m, view.tilt_deg)


def collection_state(stored: StoredCollection) -> CollectionState:
    """Return which sensors saw the board in a collection."""
    data: Mapping[str, Any] = stored.document["data"]
    labels: Mapping[str, Mapping[str, Any]] = stored.document["labels"]
    detections: List[SensorDetection] = [
        SensorDetection(sensor, pattern, len(label["idxs"]))
        for pattern, of_sensors in labels.items()
        for sensor, label in of_sensors.items()
        if label["detected"]
    ]
    return CollectionState(stored.key, _earliest(list(data.values())), detections)


def _earliest(data: Sequence[Mapping[str, Any]]) -> rospy.Time:
    stamps = [entry["header"]["stamp"] for entry in data]
    return min((rospy.Time(s["secs"], s["nsecs"]) for s in stamps), default=rospy.Time())
