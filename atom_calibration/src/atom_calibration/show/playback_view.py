"""A collection of a dataset as RViz shows it: its data, its labels, its transforms, its figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image

from atom_calibration.labels.label_messages import header_message
from atom_calibration.messages.cameras import camera_info_message
from atom_calibration.modalities.frames import Frame
from atom_calibration.modalities.table import ros_modality
from atom_calibration.msg import CollectionState, CollectionStates, LabelState, SensorDetection
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.show.annotation import picture_message
from atom_calibration.show.grades import label_grade
from atom_core import opencv as cv2
from atom_core.editing.label_corrections import ChosenCorner, LabelCorrections
from atom_core.errors import AtomError
from atom_core.evaluation.label_quality import METRES, label_quality
from atom_core.labeling.base import Labeled, nothing
from atom_core.model.colours import packed, sensor_colours
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, Label, RangeLabel, RgbLabel
from atom_core.model.modality import modality_named
from atom_core.model.sensor import Sensor
from atom_core.report.tables import text_table

IMAGES, POINTS = "labeled2d", "labeled3d"  # below the topic of the data, as in ATOM
_CHOSEN_BGR = (0, 230, 255)


@dataclass
class Shown:
    """What is shown of a sensor in a collection.

    Attributes:
        frame: its data and labels; empty data where they cannot be read.
        problem: why not, or why a label is not shown; empty: none.
    """

    frame: Frame
    problem: str = ""


def data_topic(sensor: Sensor) -> str:
    """Return where the data of a sensor are published, decompressed."""
    topic = sensor.topic or topic_of(sensor.name, "data")
    for ending in ("/compressed", "/compressedDepth"):
        if topic.endswith(ending):
            return topic[: -len(ending)]
    return topic


def shown(corrections: LabelCorrections, name: str) -> Shown:
    """Return what a sensor has in the collection that is shown."""
    dataset, key = corrections.dataset, corrections.collection
    sensor, header = dataset.sensors[name], _header(dataset, key, name)
    stamp_s = header["stamp"]["secs"] + 1e-9 * header["stamp"]["nsecs"]
    ros, problem = ros_modality(sensor.modality), ""
    try:
        data = ros.from_dataset(dataset.data.read(key, name))
    except AtomError as error:
        data, problem = ros.no_data(sensor), str(error)
    frame = Frame(sensor, stamp_s, header, data)
    labels = corrections.labels(name)
    for pattern in dataset.patterns:
        labeled = Labeled(labels[pattern]) if pattern in labels else None
        if labeled is not None and not _fits(labels[pattern], frame):
            labeled = nothing(sensor.modality, "the label does not belong to the data")
            problem = problem or labeled.reason
        if labeled is None:
            reason = "the data cannot be read" if problem else "no label"
            labeled = nothing(sensor.modality, f"{pattern}: {reason}")
        frame.labels[pattern] = labeled
    return Shown(frame, problem)


def _header(dataset: Dataset, key: str, sensor: str) -> Mapping[str, Any]:
    document = (dataset.document.get("collections") or {}).get(key, {})
    entry = (document.get("data") or {}).get(sensor) or {}
    stamp = (entry.get("header") or {}).get("stamp") or {}
    return {
        "seq": 0,
        "stamp": {"secs": int(stamp.get("secs", 0)), "nsecs": int(stamp.get("nsecs", 0))},
        "frame_id": dataset.sensors[sensor].frame,
    }


def _fits(label: Label, frame: Frame) -> bool:
    """Tell whether the indices of a label are within the data."""
    if not isinstance(label, RangeLabel):
        return True
    both = np.concatenate([label.indices, label.limit_indices])
    return len(both) == 0 or (both.min() >= 0 and both.max() < frame.size)


# --- messages ---------------------------------------------------------------------------------


def data_message(frame: Frame) -> Any:
    """Return the data of a frame as the sensor would publish them."""
    message = frame.ros.encode(frame.data)
    message.header = header_message(frame)
    return message


def camera_info(frame: Frame) -> CameraInfo:
    """Return the intrinsics that belong to a frame's image."""
    assert frame.sensor.camera is not None
    message = camera_info_message(frame.sensor.camera)
    message.header = header_message(frame)
    return message


def labeled_image(
    frame: Frame, chosen: Any = None, draw_more: Optional[Callable[[np.ndarray], None]] = None
) -> Image:
    """Return an image with its labels drawn in.

    Args:
        frame: of a camera.
        chosen: the `ChosenCorner` to point out, if it is one of this image.
        draw_more: draws into the picture (height, width, 3) at last.
    """
    with np.errstate(invalid="ignore"):
        picture = frame.ros.draw(frame)
    if isinstance(chosen, ChosenCorner) and chosen.sensor == frame.sensor.name:
        label = frame.labels[chosen.pattern].label
        assert isinstance(label, RgbLabel)
        for x, y in label.pixels[label.ids == chosen.corner]:
            centre = (int(round(16 * x)), int(round(16 * y)))
            cv2.circle(picture, centre, 9 * 16, _CHOSEN_BGR, 2, cv2.LINE_AA, 4)
    if draw_more is not None:
        draw_more(picture)
    return picture_message(frame, picture)


# --- figures ----------------------------------------------------------------------------------


def label_states(corrections: LabelCorrections, problems: Mapping[str, str]) -> List[LabelState]:
    """Return every label of the collection that is shown with its figures.

    Args:
        corrections: the dataset.
        problems: why data of a sensor cannot be shown, by its name.
    """
    changed = set(corrections.changed())
    return [
        _label_state(
            corrections,
            DetectionKey(corrections.collection, sensor, pattern),
            changed,
            problems.get(sensor, ""),
        )
        for sensor in corrections.dataset.sensors
        for pattern in corrections.dataset.patterns
    ]


def _label_state(
    corrections: LabelCorrections, key: DetectionKey, changed: Any, problem: str
) -> LabelState:
    sensor, label = corrections.dataset.sensors[key.sensor], corrections.dataset.label(key)
    state = LabelState(
        sensor=sensor.name,
        colour=packed(sensor_colours(corrections.dataset.config.sensors)[sensor.name]),
        modality=sensor.modality,
        topic=data_topic(sensor),
        frame_id=sensor.frame,
        pattern_name=key.pattern,
        detected=label is not None,
        corrected=key in changed,
        rms=np.nan,
        worst=np.nan,
        worst_item=-1,
        problem=problem,
    )
    if label is None:
        return state
    state.points, state.border_points = label.size, label.limit_size
    try:
        quality = label_quality(corrections.dataset, key)
    except AtomError as error:
        state.problem = problem or str(error)
        return state
    state.unit, state.rms, state.worst = quality.unit, quality.rms, quality.worst
    state.worst_item = quality.worst_item
    state.grade = label_grade(quality.unit, quality.rms, quality.worst)
    return state


def quality_table(title: str, states: List[LabelState]) -> str:
    """Return the labels and their figures as a text; metres are told in millimetres."""
    rows = []
    for state in states:
        scale, unit = (1000.0, "mm") if state.unit == METRES else (1.0, state.unit)
        worst = f"{scale * state.worst:.2f} ({state.worst_item})" if state.worst_item >= 0 else ""
        rms = f"{scale * state.rms:.2f}" if np.isfinite(state.rms) else ""
        note = state.problem or ("corrected" if state.corrected else "")
        border = state.border_points if modality_named(state.modality).measures_range else ""
        rows.append(
            [
                state.sensor,
                state.pattern_name,
                state.points,
                border,
                rms,
                worst,
                unit,
                note,
            ]
        )
    headers = ["sensor", "pattern", "points", "border", "rms", "worst (which)", "unit", ""]
    return text_table(headers, rows, title)


def collection_states(dataset: Dataset) -> CollectionStates:
    """Return which sensors have labels in each collection."""
    detections: Dict[str, List[SensorDetection]] = {key: [] for key in dataset.collections}
    for key, label in dataset.detections():
        detections[key.collection].append(SensorDetection(key.sensor, key.pattern, label.size))
    listed = [
        CollectionState(key, _stamp(dataset, key), found) for key, found in detections.items()
    ]
    return CollectionStates(collections=listed)


def _stamp(dataset: Dataset, key: str) -> rospy.Time:
    """Return the time of a collection's earliest data."""
    stamps: List[Tuple[int, int]] = []
    for sensor in dataset.sensors:
        stamp = _header(dataset, key, sensor)["stamp"]
        stamps.append((stamp["secs"], stamp["nsecs"]))
    return rospy.Time(*min(stamps, default=(0, 0)))
