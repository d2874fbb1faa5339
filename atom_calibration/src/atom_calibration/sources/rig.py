"""The sensors of a configuration as a bag, or the master, knows them: topics, modality, frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Protocol, Sequence, Tuple

import numpy as np

from atom_calibration.errors import BagError, MessageError, TransformError
from atom_calibration.messages.cameras import (
    CAMERA_INFO,
    camera_from_info,
    camera_of_images,
    is_cut_or_binned,
)
from atom_calibration.messages.headers import frame_name
from atom_calibration.messages.images import image_size
from atom_calibration.modalities.table import is_labeled, modality_of
from atom_calibration.sources.driver_messages import undecoded
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.io.camera_entries import lens_caveats
from atom_core.model.caveats import Caveat
from atom_core.model.config import CalibrationConfig, SensorConfig
from atom_core.model.modality import modalities, modality_named
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

_SAME_M, _SAME_RAD = 0.0005, float(np.radians(0.02))  # frames of other names that are one
_SUFFIXES = ("", "/compressed", "/compressedDepth")


@dataclass(frozen=True)
class Rig:
    """What is collected.

    Attributes:
        sensors: by name, in the order of the configuration.
        topics: where the data of a sensor are, by topic; compressed ones by their full name.
        infos: where the intrinsics of a camera are, by topic.
        warnings: what the user should know.
        caveats: what puts a camera in doubt.
        data_frames: frame of the data by sensor, as their headers have it.
    """

    sensors: Dict[str, Sensor]
    topics: Dict[str, Sensor]
    infos: Dict[str, Sensor]
    warnings: Tuple[str, ...]
    caveats: Tuple[Caveat, ...] = ()
    data_frames: Mapping[str, str] = field(default_factory=dict)


class TopicSource(Protocol):
    """Where topics are: a bag, or a running system.

    Attributes:
        path: what messages call it.
    """

    path: Any

    @property
    def types(self) -> Mapping[str, str]:
        """Type of messages by topic."""

    def first(self, topic: str) -> Any:
        """Return the first message of a topic."""

    def absent(self, topic: str, types: Sequence[str], whose: str) -> BagError:
        """Return the error that a topic is not there."""


def candidate_topics(entry: SensorConfig) -> List[str]:
    """Return every topic that may have a sensor's data or intrinsics."""
    return [*(entry.topic_name + suffix for suffix in _SUFFIXES), _info_topic(entry)]


def rig_from_bag(config: CalibrationConfig, bag: TopicSource) -> Rig:
    """Find the sensors of a configuration in a bag, or among the topics that are published.

    Raises:
        BagError: a topic, or a camera's camera_info, is absent; two sensors have one topic.
        MessageError: a camera_info is of no use.
    """
    sensors: Dict[str, Sensor] = {}
    topics: Dict[str, Sensor] = {}
    infos: Dict[str, Sensor] = {}
    warnings: List[str] = []
    caveats: List[Caveat] = []
    data_frames: Dict[str, str] = {}
    info_frames: Dict[str, str] = {}
    for name, entry in config.sensors.items():
        topic, sensor = sensor_from_bag(name, entry, bag)
        if sensor is None:
            warnings.append(f"sensor '{name}' ({bag.types[topic]}) is left out: it is not labeled")
            continue
        if topic in topics:
            raise BagError(
                f"sensors '{topics[topic].name}' and '{name}' have one topic ({topic}); correct "
                f"topic_name of one of them in the configuration"
            )
        sensors[name] = topics[topic] = sensor
        if sensor.camera is not None:
            infos[_info_topic(entry)] = sensor
            info = bag.first(_info_topic(entry))
            info_frames[name] = frame_name(info.header.frame_id)
            caveats += lens_caveats(name, sensor.topic, sensor.camera, info.P)
        data_frames[name] = frame_id = frame_name(bag.first(topic).header.frame_id)
        if sensor.camera is not None and frame_id != entry.link:
            warnings.append(
                f"sensor '{name}': its data are in frame '{frame_id}' (header of {topic}), the "
                f"configuration says link '{entry.link}', which is used"
            )
    caveats += _exchanged_infos(info_frames, data_frames)
    if not sensors:
        raise BagError(f"{bag.path}: no sensor of the configuration can be labeled")
    return Rig(sensors, topics, infos, tuple(warnings), tuple(caveats), data_frames)


def _exchanged_infos(
    info_frames: Mapping[str, str], data_frames: Mapping[str, str]
) -> List[Caveat]:
    """Return which cameras have intrinsics whose headers name the frame of another one's images.

    Args:
        info_frames: frame of the intrinsics by camera, as their headers have it.
        data_frames: frame of the data by sensor, as their headers have it.
    """
    found = []
    for name, frame in info_frames.items():
        others = [n for n in info_frames if data_frames[n] == frame != data_frames[name]]
        if others:
            found.append(
                Caveat(
                    (name,),
                    f"its camera_info is in frame '{frame}', as the images of "
                    f"'{others[0]}' are, and its own are in '{data_frames[name]}'",
                    "record the camera_info of this camera, or correct topic_name",
                )
            )
    return found


def sensor_from_bag(
    name: str, entry: SensorConfig, bag: TopicSource
) -> Tuple[str, Optional[Sensor]]:
    """Return the topic of a sensor's data, and the sensor; None for a modality without labels.

    Raises:
        BagError: a topic, or a camera's camera_info, is absent.
        MessageError: a camera_info is of no use.
    """
    topic = _data_topic(name, entry, bag)
    modality = modality_of(entry, bag.types[topic])
    if modality is None or not is_labeled(modality):
        return topic, None
    has_lens = modality_named(modality).has_camera_info
    camera = _camera(name, entry, bag, topic) if has_lens else None
    width_rad = float(entry.beam_width or 0.0)
    if width_rad and modality_named(modality).beam_width is None:
        raise BagError(
            f"sensor '{name}': its data are {bag.types[topic]}, and beam_width is of 3D LiDARs; "
            f"remove the key"
        )
    return topic, Sensor(
        name, modality, entry.link, entry.edge, camera, entry.topic_name, width_rad
    )


def check_frames(rig: Rig, config: CalibrationConfig, tree: TransformTree) -> List[Caveat]:
    """Refuse a rig whose frames do not hang together as the configuration says.

    Returns:
        What of the frames of the data is in doubt.

    Raises:
        TransformError: naming the sensor, the frame or edge, and the remedy.
    """
    caveats: List[Caveat] = []
    for sensor in rig.sensors.values():
        try:
            path = tree.path(config.world_link, sensor.frame)
        except TransformError as error:
            raise TransformError(f"sensor '{sensor.name}', topic {sensor.topic}: {error}") from None
        if sensor.edge not in path:
            listed = ", ".join(str(edge) for edge in path)
            raise TransformError(
                f"sensor '{sensor.name}': its edge '{sensor.edge}' (parent_link, child_link) is "
                f"not between '{config.world_link}' and '{sensor.frame}' in the bag's transforms "
                f"({listed}); correct the configuration"
            )
        _check_boards_apart(sensor, path, config)
        data_frame = rig.data_frames.get(sensor.name, sensor.frame)
        if not _is_of_neighbour(rig, sensor, data_frame):
            caveats += _data_frame_caveats(sensor, data_frame, tree, config.world_link)
    for pattern in config.calibration_patterns.values():
        tree.path(config.world_link, pattern.parent_link)
    return caveats


def _is_of_neighbour(rig: Rig, sensor: Sensor, frame: str) -> bool:
    """Tell whether two cameras have one frame in their headers, as those of a stereo pair may.

    Raises:
        TransformError: the data of two sensors are in the frames of each other.
    """
    for other in rig.sensors.values():
        if other.name == sensor.name or other.frame != frame or frame == sensor.frame:
            continue
        if rig.data_frames.get(other.name) == sensor.frame:
            raise TransformError(
                f"sensors '{sensor.name}' and '{other.name}': the data of each are in the frame of "
                f"the other ({sensor.topic} in '{frame}', {other.topic} in '{sensor.frame}'); "
                f"exchange topic_name of the two, or correct the drivers' frames"
            )
        if sensor.camera is not None and rig.data_frames.get(other.name) == frame:
            return True
    return False


def _check_boards_apart(sensor: Sensor, path: Sequence[Edge], config: CalibrationConfig) -> None:
    """Refuse a board whose frame carries a sensor: it cannot stand there, too."""
    frames = {frame for edge in path for frame in edge}
    for name, pattern in config.calibration_patterns.items():
        if pattern.link in frames:
            raise TransformError(
                f"pattern '{name}': its link '{pattern.link}' is a frame of the robot, on which "
                f"sensor '{sensor.name}' hangs; give the board a frame of its own"
            )


def _data_frame_caveats(
    sensor: Sensor, frame: str, tree: TransformTree, world: str
) -> List[Caveat]:
    """Refuse data of another frame than the sensor's, where the transforms tell that it is another.

    Headers of images often name the camera's body instead of its optical frame; that is no reason
    for doubt. Headers may also have no frame at all.

    Raises:
        TransformError: naming the sensor, both frames, and the remedy.
    """
    is_camera = sensor.camera is not None
    if frame in (sensor.frame, "") or (is_camera and _is_optical(sensor.frame, frame)):
        return []
    frame_T_data = tree.lookup_fixed(sensor.frame, frame)
    own = "record the data as they come from the sensor, in its own frame"
    hangs_on_edge = _hangs_on(sensor.edge, frame, tree, world)
    what = f"its data are in frame '{frame}' (header of {sensor.topic})"
    if frame_T_data is None:
        untold = Caveat(
            (sensor.name,),
            f"{what}, and no fixed transform tells where that is in link '{sensor.frame}' of the "
            f"configuration",
            "publish it in /tf_static, also if the two are the same"
            + (f", or write `link: {frame}`" if hangs_on_edge else ""),
        )
        return [] if is_camera else [untold]
    away_m = float(np.linalg.norm(frame_T_data[:3, 3]))
    turned_rad = se3.rotation_angle(frame_T_data[:3, :3])
    if away_m <= _SAME_M and turned_rad <= _SAME_RAD:
        return []
    what += (
        f", which the transforms have {1e3 * away_m:.1f} mm and {np.degrees(turned_rad):.2f} deg "
        f"from link '{sensor.frame}' of the configuration"
    )
    remedy = f"write `link: {frame}`, or {own}" if hangs_on_edge else own
    if is_camera and not _is_optical(frame, sensor.frame):
        return [Caveat((sensor.name,), what, remedy)]
    raise TransformError(f"sensor '{sensor.name}': {what}; {remedy}")


def _hangs_on(edge: Edge, frame: str, tree: TransformTree, world: str) -> bool:
    """Tell whether a frame is carried by an edge."""
    try:
        return edge in tree.path_here(world, frame)
    except TransformError:
        return False


def _is_optical(one: str, other: str) -> bool:
    """Tell whether one frame is named as an optical one (REP 103), and the other is not."""
    return "optical" in one.lower() and "optical" not in other.lower()


def _data_topic(name: str, entry: SensorConfig, bag: TopicSource) -> str:
    """Return the topic with the data, the raw one before the compressed ones.

    Recordings often have both of a depth camera; its `/compressed` is mostly JPEG, without depths.
    """
    types = modality_named(entry.modality).message_types if entry.modality else ()
    known = types or sorted({t for modality in modalities() for t in modality.message_types})
    has_depths = entry.modality and modality_named(entry.modality).measures_range
    raw, colour, depth = _SUFFIXES
    for suffix in (raw, depth, colour) if has_depths else _SUFFIXES:
        topic = entry.topic_name + suffix
        if topic in bag.types:
            if bag.types[topic] not in known:
                of_modality = f"for modality {entry.modality} " if entry.modality else ""
                raise BagError(
                    f"{bag.path}: topic {topic} (sensor '{name}') carries {bag.types[topic]}, "
                    f"{of_modality}it has to be {' or '.join(known)}; correct "
                    f"topic_name or modality in the configuration"
                    f"{undecoded({topic: bag.types[topic]}, known)}"
                )
            return topic
    raise bag.absent(entry.topic_name, known, f"sensor '{name}'")


def _camera(name: str, entry: SensorConfig, bag: TopicSource, of_images: str) -> Camera:
    topic = _info_topic(entry)
    raw, _, transport = entry.topic_name.rpartition("/")
    if topic not in bag.types and f"/{transport}" in _SUFFIXES:
        raise BagError(
            f"{bag.path}: topic_name of sensor '{name}' is {entry.topic_name}; write {raw}, of "
            f"which compressed images are found, too, and camera_info beside them"
        )
    if topic not in bag.types:
        raise bag.absent(topic, [CAMERA_INFO], f"intrinsics of sensor '{name}'")
    try:
        info = bag.first(topic)
        if is_cut_or_binned(info):
            return camera_of_images(info, image_size(bag.first(of_images)))
        return camera_from_info(info)
    except MessageError as error:
        raise MessageError(f"{bag.path}: sensor '{name}', topic {topic}: {error}") from None


def _info_topic(entry: SensorConfig) -> str:
    return f"{entry.topic_name.rpartition('/')[0]}/camera_info"
