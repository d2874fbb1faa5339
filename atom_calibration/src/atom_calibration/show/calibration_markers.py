"""What RViz shows of a calibration: boards, sensors, where those began, labeled points."""

from __future__ import annotations

import colorsys
from typing import Dict, Iterable, List, Optional, Sequence, Tuple

import numpy as np
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from atom_calibration.messages.clouds import cloud_message
from atom_calibration.messages.poses import point_message, pose_message
from atom_calibration.show import markers
from atom_calibration.show.annotation import POINT
from atom_calibration.show.estimate import Estimate
from atom_core.geometry import se3
from atom_core.model.colours import Colour, packed
from atom_core.model.sensor import Sensor

_FRUSTUM_M, _LIDAR_M = (0.02, 0.3), 0.12
_AXES_M, _TEXT_M = 0.15, 0.09
_GHOST_COLOUR, _GHOST_ALPHA = (1.0, 1.0, 1.0), 0.5
_SAME_PLACE = 1e-6  # m and entries of rotations: one picture is enough
_MOST_POINTS = 3000  # of a detection that are drawn


def collection_colours(keys: Sequence[str]) -> Dict[str, Colour]:
    """Return a colour for each collection, around the circle of hues."""
    colours: Dict[str, Colour] = {}
    for index, key in enumerate(keys):
        value = 0.95 if index % 2 == 0 else 0.75  # neighbours differ in brightness, too
        colours[key] = colorsys.hsv_to_rgb(0.9 * index / max(len(keys), 1), 0.7, value)
    return colours


def boards(estimate: Estimate, shown: Sequence[str], colours: Dict[str, Colour]) -> List[Marker]:
    """Return the boards of some collections, in the world.

    Args:
        estimate: what is shown.
        shown: keys of the collections.
        colours: by collection.
    """
    world, listed = estimate.dataset.world, []
    for (name, key), world_T_pattern in estimate.board_poses.items():
        if key not in shown:
            continue
        pattern, colour = estimate.dataset.patterns[name], colours[key]
        listed += markers.board(pattern, colour, world_T_pattern, world, f"c{key}")
        middle = se3.apply(world_T_pattern, pattern.border.centre_in_pattern[None])[0]
        title = markers.text(world, key, _TEXT_M, colour)
        above = middle + [0.0, 0.0, _TEXT_M + np.linalg.norm(pattern.border.half_size)]
        title.pose.position = point_message(above)
        title.ns = f"c{key}"
        listed.append(title)
    return markers.numbered(listed)


def sensors(
    estimate: Estimate, first: Estimate, shown: Sequence[str], colours: Dict[str, Colour]
) -> List[Marker]:
    """Return every sensor where it stands, and a line to where it began.

    Args:
        estimate: what is shown.
        first: the estimate at the start.
        shown: keys of the collections; a sensor that moves is drawn in each of them.
        colours: by sensor.
    """
    world, listed = estimate.dataset.world, []
    for sensor in estimate.dataset.sensors.values():
        for key, pose in _places(estimate, sensor.name, shown):
            shapes = _shapes(sensor, world, colours[sensor.name])
            shapes.append(markers.axes(world, _AXES_M))
            for marker in shapes:
                marker.pose, marker.ns = pose_message(pose), sensor.name
            listed += shapes
            began = first.sensor_poses.get((sensor.name, key))
            if began is not None:
                ends = np.array([began[:3, 3], pose[:3, 3]])
                listed.append(markers.lines(world, ends, colours[sensor.name], sensor.name))
    return markers.numbered(listed)


def names(estimate: Estimate, shown: Sequence[str], colours: Dict[str, Colour]) -> List[Marker]:
    """Return the name of every sensor where it stands, in its colour, and which one is held."""
    world, listed = estimate.dataset.world, []
    for sensor in estimate.dataset.sensors.values():
        held = sensor.name == estimate.dataset.config.anchored_sensor
        words = f"{sensor.name} (held)" if held else sensor.name
        for _, pose in _places(estimate, sensor.name, shown):
            name = markers.name(world, words, colours[sensor.name], sensor.name)
            name.pose = pose_message(pose)
            listed.append(name)
    return markers.numbered(listed)


def ghost(first: Estimate, shown: Sequence[str]) -> List[Marker]:
    """Return every sensor where it began, transparent."""
    world, listed = first.dataset.world, []
    for sensor in first.dataset.sensors.values():
        for _, pose in _places(first, sensor.name, shown):
            for marker in _shapes(sensor, world, _GHOST_COLOUR):
                marker.pose, marker.ns = pose_message(pose), sensor.name
                marker.color.a = _GHOST_ALPHA
                listed.append(marker)
    return markers.numbered(listed)


def labeled_points(
    estimate: Estimate,
    shown: Sequence[str],
    sensor_colour: Dict[str, Colour],
    collection_colour: Optional[Dict[str, Colour]] = None,
) -> Dict[str, np.ndarray]:
    """Return the labeled points of each range sensor in the world, as `annotation.POINT`.

    Args:
        estimate: what is shown.
        shown: keys of the collections.
        sensor_colour: by sensor; points on the border are lighter.
        collection_colour: by collection; wins.
    """
    parts: Dict[str, List[np.ndarray]] = {
        name: [] for name, sensor in estimate.dataset.sensors.items() if sensor.kind.measures_range
    }
    for points in estimate.points():
        sensor, collection = points.key.sensor, points.key.collection
        world_T_sensor = estimate.sensor_poses.get((sensor, collection))
        if collection not in shown or world_T_sensor is None:
            continue
        step = -(-len(points.points) // _MOST_POINTS)
        table = np.zeros(len(points.points[::step]), POINT)
        xyz = se3.apply(world_T_sensor, points.points[::step].astype(float))
        for axis, values in zip("xyz", xyz.T):
            table[axis] = values
        table["idx"] = points.ids[::step]
        colour = collection_colour[collection] if collection_colour else sensor_colour[sensor]
        table["rgb"] = packed(_lighter(colour) if points.border else colour)
        parts[sensor].append(table)
    return {name: np.concatenate([np.zeros(0, POINT), *tables]) for name, tables in parts.items()}


def cloud(frame: str, table: np.ndarray) -> PointCloud2:
    """Return points (`annotation.POINT`) of a frame, valid at any time."""
    message = cloud_message(table, is_dense=True)
    message.header.frame_id = frame
    return message


def replaced(before: Iterable[Marker], now: Sequence[Marker]) -> List[Marker]:
    """Return markers preceded by the deletion of those that are not there any more."""
    kept = {(marker.ns, marker.id) for marker in now}
    gone = [marker for marker in before if (marker.ns, marker.id) not in kept]
    deletions = []
    for marker in gone:
        deletion = Marker(action=Marker.DELETE, ns=marker.ns, id=marker.id)
        deletion.header.frame_id, deletion.pose.orientation.w = marker.header.frame_id, 1.0
        deletions.append(deletion)
    return [*deletions, *now]


def _places(estimate: Estimate, sensor: str, shown: Sequence[str]) -> List[Tuple[str, np.ndarray]]:
    """Return where a sensor stands in some collections, each place once."""
    places: List[Tuple[str, np.ndarray]] = []
    for key in shown:
        pose = estimate.sensor_poses.get((sensor, key))
        if pose is None or any(np.allclose(pose, p, 0.0, _SAME_PLACE) for _, p in places):
            continue
        places.append((key, pose))
    return places


def _shapes(sensor: Sensor, frame: str, colour: Colour) -> List[Marker]:
    if sensor.camera is not None:
        return [markers.frustum(sensor.camera, frame, colour, *_FRUSTUM_M)]
    return [markers.sphere(frame, _LIDAR_M, colour)]


def _lighter(colour: Colour) -> Colour:
    red, green, blue = (0.45 * value + 0.55 for value in colour)
    return red, green, blue
