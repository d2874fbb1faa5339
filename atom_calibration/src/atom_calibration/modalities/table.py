"""What ROS knows of a modality: its messages, its labels in messages, how it is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Optional, Protocol

import numpy as np

from atom_core.labeling.stillness import Sighting
from atom_core.model.config import SensorConfig
from atom_core.model.labels import Label
from atom_core.model.modality import modality_named, modality_of_message
from atom_core.model.pattern import Pattern
from atom_core.model.registry import Registry
from atom_core.model.sensor import Sensor

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame
    from atom_calibration.modalities.seeds import SeedInput
    from atom_core.editing.label_corrections import LabelCorrections
    from atom_core.labeling.base import Labeled, Labeler


class Outlook(Protocol):
    """What a sensor can be expected to measure, as its first data tell."""

    def shortage(self, pattern: Pattern, distance_m: float) -> str:
        """Return why a board at a distance [m] gets too few points; empty when it gets enough."""


@dataclass(frozen=True)
class RosModality:
    """A modality on the ROS side. "Data" are those of a `Frame`.

    Attributes:
        name: of the modality in the core's registry.
        message: class of its messages where they are not compressed.
        decode: message to data; raises MessageError.
        encode: data to a message; the header is left to the caller.
        to_dataset: data to what the core's `DataFormat` writes.
        from_dataset: what the core's `DataFormat` reads to data.
        no_data: data of a sensor whose own cannot be read.
        size: how many points or pixels data have; labels mean them by their indices.
        read_label: the label in a PatternLabels.
        write_label: puts a label into a PatternLabels.
        sighting: what a label says about where the board is; None if it says nothing.
        draw: data with the labels drawn in (height, width, 3).
        display: the macro of templates/displays.j2 that shows its data.
        points: positions (n, 3) [m], in the sensor's frame, of indices into the data.
        board_pose: ``sensor_T_pattern`` (4, 4) by one label alone; None where a label of this
            modality does not tell it.
        seeds: how a person says where the board is; None where nobody has to.
        label_near: labels the board about a seed (3,) that was predicted, at most so far [m] from
            it; None: as about any other seed. Its sightings must be a `SurfaceSighting`, since
            what is found is judged by that.
        cloud: data of a dataset as points (n, 3) [m]; None where they are an image.
        background: data of a dataset as a picture (height, width, 3) to draw labels on.
        outlook: data to what the sensor can be expected to see, None if nobody can tell; raises
            ValueError.
        lost_in_file: given a frame and what writing its data returned, the sentence that says
            which labeled data the file does not hold; empty: none.
        click: corrects the label of a sensor by a click at a pixel (2,); returns a sentence.
        polygon: corrects it by a polygon (n, 2) [px]; the flag is `Polygons remove border`.
        polygon_first: polygons are what its image is corrected with at first, else clicks.
    """

    name: str
    message: type
    decode: Callable[[Any], Any]
    encode: Callable[[Any], Any]
    to_dataset: Callable[[Any], Any]
    from_dataset: Callable[[Any], Any]
    no_data: Callable[[Sensor], Any]
    size: Callable[[Any], int]
    read_label: Callable[[Any], Label]
    write_label: Callable[[Label, Any], None]
    sighting: Callable[[Frame, Label], Optional[Sighting]]
    draw: Callable[[Frame], np.ndarray]
    display: str
    points: Optional[Callable[[Frame, np.ndarray], np.ndarray]] = None
    board_pose: Optional[Callable[[Sensor, Pattern, Label], Optional[np.ndarray]]] = None
    seeds: Optional[SeedInput] = None
    label_near: Optional[Callable[[Labeler, Any, np.ndarray, float], Labeled]] = None
    cloud: Optional[Callable[[Any], np.ndarray]] = None
    background: Optional[Callable[[Any], np.ndarray]] = None
    outlook: Optional[Callable[[Any], Optional[Outlook]]] = None
    lost_in_file: Optional[Callable[[Frame, Any], str]] = None
    click: Optional[Callable[[LabelCorrections, str, np.ndarray], str]] = None
    polygon: Optional[Callable[[LabelCorrections, str, np.ndarray, bool], str]] = None
    polygon_first: bool = False


_TABLE: Registry[RosModality] = Registry("modality in ROS")
register, unregister = _TABLE.register, _TABLE.unregister


def ros_modality(name: str) -> RosModality:
    """Return the modality of a name.

    Raises:
        ValueError: the table has none; see `is_labeled`.
    """
    return _TABLE[name]


def is_labeled(name: Optional[str]) -> bool:
    """Tell whether there is a labeler for a modality, and ROS knows its messages."""
    return name in _TABLE and modality_named(name).labeler is not None


def modality_of(entry: SensorConfig, message_type: str) -> Optional[str]:
    """Return the modality of a sensor: by the configuration, else by the type of its messages."""
    inferred = modality_of_message(message_type)
    return entry.modality or (None if inferred is None else inferred.name)
