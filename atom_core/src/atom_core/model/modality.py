"""What a modality is, and the registry of those that there are.

All that differs from one kind of sensor to another stands in one value, a `Modality`, made in the
room of that kind (`atom_core.modalities`). Everything else asks this value and does not know
which modality it has before it. The rooms are imported when the first one is asked for.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
)

import numpy as np

from atom_core.model.labels import DetectionKey, Label, RangePoints
from atom_core.model.registry import Registry

if TYPE_CHECKING:  # types of the layers above, which a modality's functions take and return
    from atom_core.evaluation.label_quality import LabelQuality
    from atom_core.evaluation.pairs import PairKind
    from atom_core.geometry.rectangle import Rectangle
    from atom_core.labeling.base import Labeler
    from atom_core.labeling.beam_width import BeamWidth
    from atom_core.labeling.board_size import SeenBoard
    from atom_core.model.config import PatternConfig
    from atom_core.model.dataset import Dataset
    from atom_core.model.pattern import Pattern
    from atom_core.model.sensor import Sensor
    from atom_core.problem.measurements import Measurement
    from atom_core.problem.residuals import ResidualBlock
    from atom_core.synthetic.sensing import SyntheticSensor

_ROOMS = "atom_core.modalities"

EstimateBeamWidth = Callable[[Iterable[Tuple[Any, np.ndarray]], "Rectangle"], Optional["BeamWidth"]]
SeeBoards = Callable[[Iterable[Tuple[Any, np.ndarray]], "Rectangle", float], List["SeenBoard"]]


class SeedFormat(NamedTuple):
    """How a person says where the board is.

    Attributes:
        key: in ``seeds.yaml``.
        size: how many numbers.
        unit: of the numbers.
    """

    key: str
    size: int
    unit: str


@dataclass(frozen=True)
class DataFormat:
    """How the data of a sensor stand in a dataset.

    Attributes:
        message: the type of message, as in ``msg_type`` of the JSON ("PointCloud2").
        ending: of the data file; empty where the numbers stand in the JSON itself.
        read: given the path of the data file (None: there is none) and the entry in the JSON,
            returns the data as labelers and residuals take them. Raises DatasetError.
        write: given a path and the data, writes the data file; None where there is none.
        entry: given the sensor and the data, returns the fields of the JSON entry beside
            ``header`` and ``data_file``.
    """

    message: str
    ending: str
    read: Callable[[Optional[Path], Mapping[str, Any]], Any]
    write: Optional[Callable[[Path, Any], object]]
    entry: Callable[[Sensor, Any], Dict[str, Any]]


@dataclass(frozen=True)
class LabelFormat:
    """How a label stands in a dataset's JSON.

    Attributes:
        empty: the label of a board that was not detected.
        document: label to JSON.
        read: JSON to label; raises KeyError or ValueError.
    """

    empty: Label
    document: Callable[[Label], Dict[str, Any]]
    read: Callable[[Mapping[str, Any], Pattern], Label]


@dataclass(frozen=True)
class Modality:
    """Everything that one kind of sensor does in its own way.

    Attributes:
        name: in configuration and dataset ("lidar3d").
        noun: one such sensor, in messages ("lidar3d sensor").
        message_types: ROS types of its messages, the plain one first.
        is_default_of: those of them that mean this modality where the configuration names none.
        has_camera_info: its data are images with intrinsics, and its frame is an optical frame.
        measures_range: its labels are points in space, which need the data beside the labels.
        can_estimate_intrinsics: ``--optimize_intrinsics`` is for it.
        can_estimate_range_offset: ``--range_offset`` is for it.
        beam_width: given clouds of one sensor, each with a seed on its board, and the board's
            border, estimates how wide its beams are; None: that is not asked of it.
        seen_boards: given the same and the configured width of the beams [rad], how large each
            board looks; None: its limit points have to tell.
        spins_about_z: so that an error about its z axis has a reason of its own.
        data, labels: how they stand in a dataset.
        seed: how a person says where the board is; None where nobody has to.
        points: the labeled points of a detection; None where there are none in space.
        measured: given the data, which points or pixels (n,) were measured; None likewise.
        labeler: makes the labeler of a sensor for a pattern; None: labels come from elsewhere.
        measure: the measurement of a detection (None: it has nothing of use), and warnings.
        residual_blocks: the residuals of all measurements of one sensor, each with the index of
            its detection.
        rays: unit vectors (n, 3) in the sensor's frame along which it measures, its axis first.
        quality: how good one label is by itself.
        pairs: how it is compared with other sensors, itself being the source.
        synthetic: how it is simulated; None: it cannot be.
    """

    name: str
    noun: str
    message_types: Tuple[str, ...]
    data: DataFormat
    labels: LabelFormat
    measure: Callable[[Dataset, DetectionKey], Tuple[Optional[Measurement], List[str]]]
    residual_blocks: Callable[[Sensor, Sequence[Tuple[int, Any]]], List[ResidualBlock]]
    rays: Callable[[Sensor], np.ndarray]
    quality: Callable[[Dataset, DetectionKey], LabelQuality]
    is_default_of: Tuple[str, ...] = ()
    has_camera_info: bool = False
    measures_range: bool = False
    can_estimate_intrinsics: bool = False
    can_estimate_range_offset: bool = False
    beam_width: Optional[EstimateBeamWidth] = None
    seen_boards: Optional[SeeBoards] = None
    spins_about_z: bool = False
    seed: Optional[SeedFormat] = None
    points: Optional[Callable[[Dataset, DetectionKey], RangePoints]] = None
    measured: Optional[Callable[[Any], np.ndarray]] = None
    labeler: Optional[Callable[[Sensor, Pattern, PatternConfig], Labeler]] = None
    pairs: Sequence[PairKind] = field(default_factory=tuple)
    synthetic: Optional[SyntheticSensor] = None

    def has_messages(self, message_type: str) -> bool:
        """Tell whether messages of a type, with its package or without, can be of this modality."""
        return _bare(message_type) in {_bare(known) for known in self.message_types}


_REGISTERED: Registry[Modality] = Registry("modality")
register, unregister = _REGISTERED.register, _REGISTERED.unregister


def modalities() -> Tuple[Modality, ...]:
    """Return all modalities in the order in which they were registered."""
    importlib.import_module(_ROOMS)
    return tuple(_REGISTERED)


def modality_named(name: object) -> Modality:
    """Return the modality of a name: the one place that refuses an unknown one.

    Raises:
        ValueError: naming those that there are.
    """
    if name not in _REGISTERED:
        importlib.import_module(_ROOMS)
    return _REGISTERED[name]


def modality_of_message(message_type: str) -> Optional[Modality]:
    """Return the modality that a type of messages means where the configuration names none.

    Args:
        message_type: with its package ("sensor_msgs/Image") or without.
    """
    for modality in modalities():
        if _bare(message_type) in {_bare(known) for known in modality.is_default_of}:
            return modality
    return None


def _bare(message_type: str) -> str:
    """Return a type of messages without its package."""
    return message_type.split("/")[-1]
