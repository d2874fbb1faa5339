"""What RViz draws: frustums, boards, sensors, points. Values in, `Marker` messages out.

A marker with stamp zero and ``frame_locked`` follows its frame, so that moving a transform moves
it without publishing it again.
"""

from __future__ import annotations

from typing import Container, Dict, Iterable, List, Mapping, Optional

import numpy as np
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from atom_calibration.messages.poses import point_message, pose_message
from atom_core.geometry.camera import Camera
from atom_core.model.colours import Colour
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import CHARUCO, Pattern

NEAR_M, FAR_M = 0.3, 3.0  # of a frustum
_LINE_M = 0.006
_BOARD_THICKNESS_M = 0.004
_NAME_M = 0.09  # where a display draws it in space
_ARROW_COLOUR: Colour = (0.85, 0.85, 0.85)
_ARROW_ENDS = (0.5, 0.9)  # of a marker's size, as RViz has its own
_ARROW_SHAPE = (0.06, 0.16, 0.2)  # of a marker's size: shaft, head, length of the head


def frustum(
    camera: Camera,
    frame: str,
    colour: Colour,
    near_m: float = NEAR_M,
    far_m: float = FAR_M,
    namespace: str = "frustum",
) -> Marker:
    """Return the lines around what a camera sees, from `near_m` to `far_m` along its axis [m].

    Args:
        camera: intrinsics; the corners of the image are undistorted.
        frame: the optical frame.
        colour: of the lines.
        near_m: depth of the near face [m].
        far_m: depth of the far face [m].
        namespace: of the marker.
    """
    near, far = (_image_corners(camera, depth) for depth in (near_m, far_m))
    lines: List[np.ndarray] = []
    for i in range(4):
        j = (i + 1) % 4
        lines += [near[i], near[j], far[i], far[j], near[i], far[i]]
    marker = _marker(Marker.LINE_LIST, frame, namespace, colour, 0.9)
    marker.scale.x = _LINE_M
    marker.points = _points(np.array(lines))
    return marker


def board(
    pattern: Pattern,
    colour: Colour,
    frame_T_pattern: Optional[np.ndarray] = None,
    frame: Optional[str] = None,
    namespace: str = "board",
    number: int = 0,
) -> List[Marker]:
    """Return a board: a plate of its size and its squares.

    Args:
        pattern: the board.
        colour: of the plate.
        frame_T_pattern: (4, 4) its pose [m]; identity when None.
        frame: in which it is drawn; the pattern's own when None.
        namespace: of the markers.
        number: number of the first of the two markers.
    """
    pose = np.eye(4) if frame_T_pattern is None else frame_T_pattern
    frame = pattern.frame if frame is None else frame
    plate = _marker(Marker.CUBE, frame, namespace, colour, 0.7, number)
    centre = np.eye(4)
    centre[:3, 3] = [*pattern.border.centre, 0.5 * _BOARD_THICKNESS_M]
    plate.pose = pose_message(pose @ centre)
    plate.scale = Vector3(*(2 * pattern.border.half_size), _BOARD_THICKNESS_M)
    squares = _marker(Marker.TRIANGLE_LIST, frame, namespace, (0.05, 0.05, 0.05), 0.9, number + 1)
    squares.pose = pose_message(pose)
    squares.scale = Vector3(1.0, 1.0, 1.0)
    squares.points = _points(_black_squares(pattern))
    return [plate, squares]


def sphere(frame: str, diameter_m: float, colour: Colour, alpha: float = 0.8) -> Marker:
    """Return a sphere at the origin of a frame, or of the interactive marker it belongs to."""
    marker = _marker(Marker.SPHERE, frame, "sphere", colour, alpha)
    marker.scale = Vector3(diameter_m, diameter_m, diameter_m)
    return marker


def axes(frame: str, length_m: float) -> Marker:
    """Return the axes of a frame: x red, y green, z blue."""
    marker = _marker(Marker.LINE_LIST, frame, "axes", (1.0, 1.0, 1.0), 1.0)
    marker.scale.x = 0.05 * length_m
    ends = np.eye(3) * length_m
    marker.points = _points(np.array([p for end in ends for p in (np.zeros(3), end)]))
    marker.colors = [ColorRGBA(*colour, 1.0) for colour in np.eye(3) for _ in range(2)]
    return marker


def text(frame: str, words: str, height_m: float, colour: Colour, above_m: float = 0.0) -> Marker:
    """Return words that face the viewer, `above_m` over the origin of a frame [m]."""
    marker = _marker(Marker.TEXT_VIEW_FACING, frame, "text", colour, 1.0)
    marker.text, marker.scale.z, marker.pose.position.z = words, height_m, above_m
    return marker


def name(frame: str, words: str, colour: Colour, sensor: str) -> Marker:
    """Return what the display of names shows beside the origin of a sensor's frame."""
    marker = text(frame, words, _NAME_M, colour)
    marker.ns = sensor
    return marker


def sensor_names(
    config: CalibrationConfig, colours: Mapping[str, Colour], held: Container[str] = ()
) -> MarkerArray:
    """Return the name of each sensor at the frame of its data, in its colour.

    Args:
        config: the sensors.
        colours: by sensor.
        held: those whose pose stays, which their names say.
    """
    return MarkerArray(
        [
            name(entry.link, f"{key} (held)" if key in held else key, colours[key], key)
            for key, entry in config.sensors.items()
        ]
    )


def arrows(axis: np.ndarray, size_m: float) -> List[Marker]:
    """Return two arrows of no sensor's colour along an axis (3,), for a marker of a size [m]."""
    made = []
    for number, way in enumerate((1.0, -1.0)):
        marker = _marker(Marker.ARROW, "", "arrows", _ARROW_COLOUR, 0.9, number)
        marker.scale = Vector3(*(size_m * share for share in _ARROW_SHAPE))
        marker.points = _points(np.array([way * end * size_m * axis for end in _ARROW_ENDS]))
        made.append(marker)
    return made


def lines(
    frame: str, ends: np.ndarray, colour: Colour, namespace: str = "lines", width_m: float = _LINE_M
) -> Marker:
    """Return lines between pairs of points (2 n, 3) [m] of a frame."""
    marker = _marker(Marker.LINE_LIST, frame, namespace, colour, 0.9)
    marker.scale.x = width_m
    marker.points = _points(ends)
    return marker


def points(
    frame: str,
    positions: np.ndarray,
    size_m: float,
    colour: Colour,
    namespace: str = "points",
    number: int = 0,
) -> Marker:
    """Return points (n, 3) [m] of a frame."""
    marker = _marker(Marker.POINTS, frame, namespace, colour, 1.0, number)
    marker.scale.x = marker.scale.y = size_m
    marker.points = _points(positions)
    return marker


def numbered(markers: Iterable[Marker]) -> List[Marker]:
    """Give the markers of one array different numbers within their namespaces."""
    numbers: Dict[str, int] = {}
    listed = list(markers)
    for marker in listed:
        marker.id = numbers[marker.ns] = numbers.get(marker.ns, -1) + 1
    return listed


def _marker(
    kind: int, frame: str, namespace: str, colour: Colour, alpha: float, number: int = 0
) -> Marker:
    marker = Marker(type=kind, action=Marker.ADD, ns=namespace, id=number, frame_locked=True)
    marker.header.frame_id = frame
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(*(float(value) for value in colour), alpha)
    return marker


def _image_corners(camera: Camera, depth_m: float) -> np.ndarray:
    """Return where the rays of the image's corners are at a depth, (4, 3) [m]."""
    right, bottom = camera.width - 0.5, camera.height - 0.5
    pixels = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    return camera.ray_points(pixels, np.full(4, depth_m))


def _black_squares(pattern: Pattern) -> np.ndarray:
    """Return two triangles, six corners (3,) [m], for each black square, just before the plate."""
    side = pattern.square_m
    first = 0.0 if pattern.kind == CHARUCO else -side  # where the squares begin
    triangles: List[np.ndarray] = []
    for row in range(pattern.rows + 1):
        for column in range(pattern.columns + 1):
            if (row + column) % 2 == 0:
                corner = np.array([first + column * side, first + row * side, -0.001])
                a, b, c, d = corner + side * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
                triangles += [a, c, b, a, d, c]
    return np.array(triangles)


def _points(positions: np.ndarray) -> List[Point]:
    return [point_message(position) for position in positions]
