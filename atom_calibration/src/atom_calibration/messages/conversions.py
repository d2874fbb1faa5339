"""Messages to the core's types: the only module that knows both.

Messages out of a bag have types generated on the fly, so a message is told by its ``_type`` and
read by its fields; nothing here needs a master.
"""

from __future__ import annotations

from typing import Any, Dict, Iterable, List, Optional, Tuple

import cv2
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, TransformStamped, Vector3

from atom_calibration.errors import MessageError
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.modality import modality_of_message
from atom_core.model.transforms import Edge

IMAGE, COMPRESSED_IMAGE = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
POINT_CLOUD, LASER_SCAN = "sensor_msgs/PointCloud2", "sensor_msgs/LaserScan"
CAMERA_INFO, TF_MESSAGE = "sensor_msgs/CameraInfo", "tf2_msgs/TFMessage"

_POINT_FIELD_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_CHANNEL_TYPES = {
    "8U": "u1",
    "8S": "i1",
    "16U": "u2",
    "16S": "i2",
    "32S": "i4",
    "32F": "f4",
    "64F": "f8",
}
_COLOURS: Dict[str, Tuple[str, int, Optional[int]]] = {
    "bgr8": ("u1", 3, None),
    "rgb8": ("u1", 3, cv2.COLOR_RGB2BGR),
    "bgra8": ("u1", 4, cv2.COLOR_BGRA2BGR),
    "rgba8": ("u1", 4, cv2.COLOR_RGBA2BGR),
    "mono8": ("u1", 1, cv2.COLOR_GRAY2BGR),
    "8UC1": ("u1", 1, cv2.COLOR_GRAY2BGR),
    "8UC3": ("u1", 3, None),
    "bgr16": ("u2", 3, None),
    "rgb16": ("u2", 3, cv2.COLOR_RGB2BGR),
    "mono16": ("u2", 1, cv2.COLOR_GRAY2BGR),
    "yuv422": ("u1", 2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": ("u1", 2, cv2.COLOR_YUV2BGR_YUYV),
    # OpenCV names a Bayer pattern by its second row, ROS by its first.
    "bayer_rggb8": ("u1", 1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": ("u1", 1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": ("u1", 1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": ("u1", 1, cv2.COLOR_BayerGB2BGR),
}
_MILLIMETRE = 0.001  # REP 118: depths of whole numbers are millimetres
_COMPRESSED_DEPTH_HEADER = 12  # bytes of compressed_depth_image_transport before the PNG


def modality_of(message_type: str) -> Optional[str]:
    """Return the modality that a type of messages has when the configuration names none."""
    modality = modality_of_message(message_type)
    return None if modality is None else modality.name


def stamp_s(message: Any) -> float:
    """Return the time of a message's data [s]."""
    return float(message.header.stamp.to_sec())


# --- images -----------------------------------------------------------------------------------


def colour_image(message: Any) -> np.ndarray:
    """Return an Image or CompressedImage as (height, width, 3) uint8, blue green red.

    Raises:
        MessageError: the image is empty, cut off, or in an encoding that is not known.
    """
    if message._type == COMPRESSED_IMAGE:
        image = _decompressed(message, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        return _eight_bits(image)
    if message.encoding not in _COLOURS:
        raise MessageError(
            f"encoding '{message.encoding}' is no colour or grey image that is known; use one of "
            f"{', '.join(_COLOURS)}"
        )
    kind, channels, conversion = _COLOURS[message.encoding]
    image = _eight_bits(_pixels(message, kind, channels))
    return image if conversion is None else cv2.cvtColor(image, conversion)


def depth_image(message: Any) -> np.ndarray:
    """Return a depth Image or CompressedImage as (height, width) float32 [m], NaN where none.

    Whole numbers are millimetres and 0 is no depth (REP 118); other numbers are metres.

    Raises:
        MessageError: the image is empty, cut off, or no depth image.
    """
    if message._type == COMPRESSED_IMAGE:
        stored = _decompressed_depth(message)
    elif message.encoding in ("16UC1", "mono16"):
        stored = _pixels(message, "u2", 1)
    elif message.encoding in ("32FC1", "64FC1"):
        stored = _pixels(message, _CHANNEL_TYPES[message.encoding[:-2]], 1)
    else:
        raise MessageError(
            f"encoding '{message.encoding}' is no depth image; use 16UC1 (millimetres) or 32FC1 "
            f"(metres)"
        )
    scale = _MILLIMETRE if stored.dtype.kind == "u" else 1.0
    depth_m = (stored * np.float32(scale)).astype(np.float32)
    with np.errstate(invalid="ignore"):
        depth_m[~(np.isfinite(depth_m) & (depth_m > 0))] = np.nan
    return depth_m


def _pixels(message: Any, kind: str, channels: int) -> np.ndarray:
    """Return the pixels (height, width[, channels]) without the padding of the rows."""
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = message.height, message.width, message.step
    row = width * channels * dtype.itemsize
    if not height or not width or not len(message.data):
        raise MessageError(
            f"the image is empty ({width} x {height} pixels, {len(message.data)} bytes); record "
            f"it again, or leave the sensor out"
        )
    if step < row or len(message.data) < step * (height - 1) + row:
        raise MessageError(
            f"the image is cut off: {len(message.data)} bytes in rows of {step} are too few for "
            f"{width} x {height} pixels of {message.encoding}; record it again"
        )
    data = np.frombuffer(message.data, dtype=np.uint8)
    shape, strides = (height, row), (step, 1)
    rows = np.ascontiguousarray(np.lib.stride_tricks.as_strided(data, shape, strides))
    image = rows.view(dtype).astype(dtype.newbyteorder("="), copy=False)
    return image.reshape((height, width) if channels == 1 else (height, width, channels))


def _decompressed(message: Any, flags: int) -> np.ndarray:
    image: Any = None
    if len(message.data):
        image = cv2.imdecode(np.frombuffer(message.data, dtype=np.uint8), flags)
    if image is None:
        raise MessageError(
            f"the compressed image (format '{message.format}', {len(message.data)} bytes) cannot "
            f"be decoded; it is empty or cut off: record it again"
        )
    return image


def _decompressed_depth(message: Any) -> np.ndarray:
    """Return what compressed_image_transport or compressed_depth_image_transport packed."""
    stored: Any
    if "compressedDepth" not in message.format:
        stored = _decompressed(message, cv2.IMREAD_UNCHANGED)
    else:
        data = np.frombuffer(message.data, dtype=np.uint8)[_COMPRESSED_DEPTH_HEADER:]
        stored = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
        if stored is None:
            raise MessageError(f"the compressed depth ('{message.format}') cannot be decoded")
        if message.format.startswith("32FC1"):
            # The transport stores a / depth + b, with a and b in the header.
            a, b = np.frombuffer(message.data, dtype="<f4", count=3)[1:]
            with np.errstate(divide="ignore"):
                return np.where(stored > 0, a / (stored - b), np.nan).astype(np.float32)
    if stored.ndim != 2 or stored.dtype != np.uint16:
        raise MessageError(
            f"the compressed image (format '{message.format}') is no depth of 16 bits; is it "
            f"another sensor's, or was it packed as JPEG?"
        )
    return stored


def _eight_bits(image: np.ndarray) -> np.ndarray:
    return image if image.dtype == np.uint8 else (image >> 8).astype(np.uint8)


# --- clouds -----------------------------------------------------------------------------------


def point_cloud(message: Any) -> np.ndarray:
    """Return a PointCloud2 as a structured array (n,), row after row, any layout of the fields.

    Fields keep their names and types; one with a count above 1 has that many columns. Invalid
    points stay, so that indices are those of the message.

    Raises:
        MessageError: x, y or z is absent, the message is cut off, or a field is unknown.
    """
    dtype = _point_dtype(message)
    _check_positions(dtype)
    height, width, step = message.height, message.width, message.point_step
    data = np.frombuffer(message.data, dtype=np.uint8)
    row = width * step
    row_step = max(message.row_step, row) if height > 1 else row
    needed = row_step * (height - 1) + row if height else 0
    if len(data) < needed:
        raise MessageError(
            f"the cloud is cut off: {len(data)} bytes instead of {needed} for {width} x {height} "
            f"points; record it again"
        )
    if not height or not width:
        return np.zeros(0, dtype=dtype)
    rows = np.lib.stride_tricks.as_strided(data, (height, row), (row_step, 1))
    return np.ascontiguousarray(rows).reshape(-1).view(dtype)


def cloud_xyz(points: np.ndarray) -> np.ndarray:
    """Return positions (n, 3) float32 [m] of a structured cloud; what is not finite is NaN."""
    xyz = np.column_stack([points[axis].astype(np.float32) for axis in "xyz"])
    xyz[~np.all(np.isfinite(xyz), axis=1)] = np.nan
    return xyz


def laser_scan(message: Any) -> np.ndarray:
    """Return a LaserScan as points (n, 3) [m] in the plane z = 0; invalid ranges are NaN."""
    ranges = np.asarray(message.ranges, dtype=float)
    with np.errstate(invalid="ignore"):
        valid = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    ranges = np.where(valid, ranges, np.nan)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), 0.0 * ranges])


def _point_dtype(message: Any) -> np.dtype:
    order = ">" if message.is_bigendian else "<"
    names: List[str] = []
    formats: List[Any] = []
    offsets: List[int] = []
    for field in message.fields:
        if field.datatype not in _POINT_FIELD_TYPES:
            raise MessageError(
                f"field '{field.name}' has the datatype {field.datatype}, which PointField does "
                f"not define"
            )
        if not field.name or field.name in names:
            continue  # padding that some drivers declare
        kind = order + _POINT_FIELD_TYPES[field.datatype]
        names.append(field.name)
        formats.append(kind if field.count <= 1 else (kind, (field.count,)))
        offsets.append(field.offset)
    layout: Any = {"names": names, "formats": formats, "offsets": offsets}
    layout["itemsize"] = message.point_step
    try:
        return np.dtype(layout)
    except ValueError:
        raise MessageError(
            f"the fields {', '.join(names)} do not fit into a point of {message.point_step} bytes"
        ) from None


def _check_positions(dtype: np.dtype) -> None:
    names = dtype.names or ()
    absent = [axis for axis in "xyz" if axis not in names]
    if absent:
        raise MessageError(
            f"the cloud has no field {', '.join(absent)} (its fields: {', '.join(names) or 'none'}"
            f"); choose a topic with positions"
        )


# --- intrinsics and transforms ----------------------------------------------------------------


def camera(message: Any) -> Camera:
    """Return the intrinsics of a CameraInfo.

    Raises:
        MessageError: the camera is not calibrated, or its numbers do not fit its model.
    """
    if not message.K[0] or not message.width or not message.height:
        raise MessageError(
            f"the camera is not calibrated (fx = {message.K[0]}, {message.width} x "
            f"{message.height} pixels); calibrate its intrinsics first"
        )
    try:
        return Camera(
            width=int(message.width),
            height=int(message.height),
            K=np.array(message.K, dtype=float),
            D=np.array(message.D, dtype=float),
            model=message.distortion_model or "plumb_bob",
        )
    except ValueError as error:
        raise MessageError(f"camera_info: {error}") from None


def frame(name: str) -> str:
    """Return a frame's name as tf2 has it, without the slash of old drivers."""
    return name.lstrip("/")


def edge_of(message: Any) -> Edge:
    """Return the edge of a TransformStamped."""
    return Edge(frame(message.header.frame_id), frame(message.child_frame_id))


def transform(message: Any) -> np.ndarray:
    """Return ``parent_T_child`` (4, 4) of a TransformStamped.

    Raises:
        MessageError: a number is not finite, or the quaternion has no length.
    """
    t, q = message.transform.translation, message.transform.rotation
    translation, quaternion = np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w])
    if not (np.all(np.isfinite(translation)) and np.linalg.norm(quaternion) > 1e-6):
        raise MessageError(
            f"transform '{edge_of(message)}' is no pose (translation {translation.tolist()}, "
            f"quaternion {quaternion.tolist()}); correct its publisher"
        )
    return se3.from_quaternion(translation, quaternion)


def transform_message(edge: Edge, parent_T_child: np.ndarray, stamp: Any) -> TransformStamped:
    """Return a transform as tf has it.

    Args:
        edge: from the parent to the child.
        parent_T_child: (4, 4) pose of the child [m].
        stamp: a ``rospy.Time``.
    """
    pose = pose_message(parent_T_child)
    message = TransformStamped(child_frame_id=edge.child)
    message.header.frame_id, message.header.stamp = edge.parent, stamp
    message.transform.translation = Vector3(pose.position.x, pose.position.y, pose.position.z)
    message.transform.rotation = pose.orientation
    return message


def point_message(position: Iterable[float]) -> Point:
    """Return a position (3,) [m] as a message."""
    return Point(*(float(value) for value in position))


def pose_message(frame_T_object: np.ndarray) -> Pose:
    """Return a pose (4, 4) [m] as a message."""
    quaternion = se3.quaternion_from_rotation(frame_T_object[:3, :3])
    return Pose(
        point_message(frame_T_object[:3, 3]),
        Quaternion(*(float(value) for value in quaternion)),
    )


def pose_matrix(message: Any) -> np.ndarray:
    """Return ``frame_T_object`` (4, 4) [m] of a Pose.

    Raises:
        MessageError: a number is not finite, or the quaternion has no length.
    """
    p, q = message.position, message.orientation
    position, quaternion = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
    if not (np.all(np.isfinite(position)) and np.linalg.norm(quaternion) > 1e-6):
        raise MessageError(
            f"this is no pose (position {position.tolist()}, quaternion {quaternion.tolist()}); "
            f"correct its publisher"
        )
    return se3.from_quaternion(position, quaternion)


def header_document(message: Any) -> Dict[str, Any]:
    """Return a header as plain values, as ATOM's datasets have it."""
    stamp = message.header.stamp
    return {
        "seq": int(message.header.seq),
        "stamp": {"secs": int(stamp.secs), "nsecs": int(stamp.nsecs)},
        "frame_id": frame(message.header.frame_id),
    }
