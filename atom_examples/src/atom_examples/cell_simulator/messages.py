"""From arrays to ROS messages."""

from __future__ import annotations

from typing import Dict, Mapping, Optional, Tuple, Union

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import (
    CameraInfo,
    CompressedImage,
    Image,
    JointState,
    LaserScan,
    PointCloud2,
    PointField,
)
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from atom_core import opencv as cv2
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import Edge
from atom_core.synthetic.lidar2d import Lidar2dModel
from atom_examples.cell_simulator.depth import millimetres
from atom_examples.cell_simulator.lidar import Scan

_JPEG_QUALITY = 95
# As velodyne_pointcloud lays them out: offset, numpy's and the message's type of each field. A scan
# is one instant here, so `time` is 0.
_LAYOUT = {
    "x": (0, "<f4", PointField.FLOAT32),
    "y": (4, "<f4", PointField.FLOAT32),
    "z": (8, "<f4", PointField.FLOAT32),
    "intensity": (12, "<f4", PointField.FLOAT32),
    "ring": (16, "<u2", PointField.UINT16),
    "time": (18, "<f4", PointField.FLOAT32),
}
_POINT = np.dtype(
    {
        "names": list(_LAYOUT),
        "formats": [kind for _, kind, _ in _LAYOUT.values()],
        "offsets": [offset for offset, _, _ in _LAYOUT.values()],
        "itemsize": 22,
    }
)
_FIELDS = [PointField(name, offset, kind, 1) for name, (offset, _, kind) in _LAYOUT.items()]


def header(frame: str, stamp: rospy.Time, seq: int = 0) -> Header:
    """Return a header."""
    return Header(seq=seq, stamp=stamp, frame_id=frame)


def colour_image(picture: np.ndarray, head: Header) -> Image:
    """Return a picture (height, width, 3), red green blue, as rgb8."""
    return _image(picture, "rgb8", head)


def depth_image(depth_m: np.ndarray, encoding: str, head: Header) -> Image:
    """Return depths (height, width) [m] as 16UC1 (mm, 0 = none) or 32FC1 (m, NaN = none)."""
    return _image(millimetres(depth_m) if encoding == "16UC1" else depth_m, encoding, head)


def _image(array: np.ndarray, encoding: str, head: Header) -> Image:
    height, width = array.shape[:2]
    array = np.ascontiguousarray(array)
    return Image(
        header=head,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=array.strides[0],
        data=array.tobytes(),
    )


def jpeg_image(picture: np.ndarray, head: Header) -> CompressedImage:
    """Return a picture, red green blue, as compressed_image_transport publishes it."""
    blue_first = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", blue_first, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return CompressedImage(head, "rgb8; jpeg compressed bgr8", data.tobytes())


def png_depth_image(depth_m: np.ndarray, head: Header) -> CompressedImage:
    """Return depths as a PNG of 16 bits [mm], without loss."""
    _, data = cv2.imencode(".png", millimetres(depth_m))  # unasked it is fastest, and smallest
    return CompressedImage(head, "16UC1; png compressed ", data.tobytes())


def camera_info(camera: Camera, head: Header) -> CameraInfo:
    """Return the intrinsics of a camera whose images are not rectified."""
    P = np.column_stack([camera.K, np.zeros(3)])
    D = camera.D if camera.D.size else np.zeros(5)
    model = "plumb_bob" if camera.model == "none" else camera.model
    return CameraInfo(
        header=head,
        height=camera.height,
        width=camera.width,
        distortion_model=model,
        D=D.tolist(),
        K=camera.K.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=P.ravel().tolist(),
    )


def point_cloud(scan: Scan, ring: Optional[np.ndarray], head: Header) -> PointCloud2:
    """Return a scan as an unordered cloud of its returns; without rings it has no such field."""
    points = np.zeros(len(scan.beam), dtype=_POINT)
    for axis, name in enumerate("xyz"):
        points[name] = scan.points[:, axis]
    points["intensity"] = scan.intensity
    if ring is not None:
        points["ring"] = ring
    return PointCloud2(
        header=head,
        height=1,
        width=len(points),
        fields=[field for field in _FIELDS if ring is not None or field.name != "ring"],
        is_bigendian=False,
        point_step=_POINT.itemsize,
        row_step=_POINT.itemsize * len(points),
        data=points.tobytes(),
        is_dense=True,
    )


def laser_scan(scan: Scan, model: Lidar2dModel, scan_time_s: float, head: Header) -> LaserScan:
    """Return a scan with a range for each beam: infinite where nothing came back (REP 117)."""
    ranges, intensities = np.full(model.beams, np.inf), np.zeros(model.beams)
    ranges[scan.beam] = np.linalg.norm(scan.points, axis=1)
    intensities[scan.beam] = scan.intensity
    return LaserScan(
        header=head,
        angle_min=model.angle_min,
        angle_max=model.angle_min + (model.beams - 1) * model.angle_increment,
        angle_increment=model.angle_increment,
        time_increment=0.0,  # all of it is one instant here
        scan_time=scan_time_s,
        range_min=model.range_m[0],
        range_max=model.range_m[1],
        ranges=ranges.tolist(),
        intensities=intensities.tolist(),
    )


def transforms(edges: Mapping[Edge, np.ndarray], stamp: rospy.Time) -> TFMessage:
    """Return edges of the tree."""
    return TFMessage(
        [
            TransformStamped(header(edge.parent, stamp), edge.child, _transform(matrix))
            for edge, matrix in edges.items()
        ]
    )


def split_edges(
    robot: RobotDescription, positions: Mapping[str, float]
) -> Tuple[Dict[Edge, np.ndarray], Dict[Edge, np.ndarray]]:
    """Return the fixed edges of a robot, for /tf_static, and the moving ones, for /tf."""
    edges = robot.transforms(positions)
    fixed = {joint.edge for joint in robot.joints.values() if joint.type == FIXED}
    return (
        {edge: matrix for edge, matrix in edges.items() if edge in fixed},
        {edge: matrix for edge, matrix in edges.items() if edge not in fixed},
    )


def joint_state(positions: Mapping[str, float], stamp: rospy.Time, seq: int = 0) -> JointState:
    """Return joints at rest."""
    return JointState(
        header=header("", stamp, seq),
        name=list(positions),
        position=list(positions.values()),
        velocity=[0.0] * len(positions),
        effort=[],
    )


def pose(world_T_thing: np.ndarray) -> Pose:
    """Return a pose message."""
    message = Pose()
    _fill(message.position, message.orientation, world_T_thing)
    return message


def matrix_of(message: Pose) -> np.ndarray:
    """Return the (4, 4) of a pose message."""
    p, q = message.position, message.orientation
    return se3.from_quaternion(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def _transform(matrix: np.ndarray) -> Transform:
    message = Transform()
    _fill(message.translation, message.rotation, matrix)
    return message


def _fill(position: Union[Point, Vector3], orientation: Quaternion, matrix: np.ndarray) -> None:
    position.x, position.y, position.z = (float(v) for v in matrix[:3, 3])
    x, y, z, w = (float(v) for v in se3.quaternion_from_rotation(matrix[:3, :3]))
    orientation.x, orientation.y, orientation.z, orientation.w = x, y, z, w
