"""Small messages and bags, for tests and rostests."""

from pathlib import Path

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from atom_core.geometry import se3


class Make:
    """Makes messages and bags."""

    @staticmethod
    def header(frame, stamp_s):
        return Header(stamp=rospy.Time.from_sec(stamp_s), frame_id=frame)

    @classmethod
    def image(cls, pixels, encoding="bgr8", frame="cam", stamp_s=1.0, padding=0, big=False):
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        return Image(
            header=cls.header(frame, stamp_s),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(big),
            step=rows.shape[1],
            data=rows.tobytes(),
        )

    @classmethod
    def camera_info(cls, width=64, height=48, frame="cam", stamp_s=1.0, model="plumb_bob", D=None):
        K = [50.0, 0.0, width / 2, 0.0, 50.0, height / 2, 0.0, 0.0, 1.0]
        return CameraInfo(
            header=cls.header(frame, stamp_s),
            height=height,
            width=width,
            K=K,
            distortion_model=model,
            D=[0.0] * 5 if D is None else D,
        )

    @classmethod
    def cloud(cls, table, height=1, row_padding=0, frame="lidar", stamp_s=1.0):
        """A cloud from a structured array; the layout is the array's own."""
        kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
        fields = []
        for name in table.dtype.names:
            dtype, offset = table.dtype.fields[name][:2]
            count = int(np.prod(dtype.shape)) or 1
            fields.append(PointField(name, offset, kinds[dtype.base.str[1:]], count))
        big = table.dtype[0].base.byteorder == ">"
        step, width = table.dtype.itemsize, len(table) // height
        rows = np.frombuffer(table.tobytes(), np.uint8).reshape(height, width * step)
        rows = np.pad(rows, ((0, 0), (0, row_padding)), constant_values=77)
        return PointCloud2(
            header=cls.header(frame, stamp_s),
            height=height,
            width=width,
            fields=fields,
            is_bigendian=big,
            point_step=step,
            row_step=rows.shape[1],
            data=rows.tobytes(),
        )

    @classmethod
    def xyz_cloud(cls, points, **options):
        table = np.zeros(len(points), dtype=[(axis, "<f4") for axis in "xyz"])
        for column, axis in enumerate("xyz"):
            table[axis] = points[:, column]
        return cls.cloud(table, **options)

    @classmethod
    def intrinsics(cls, camera, frame="cam", stamp_s=1.0):
        return CameraInfo(
            header=cls.header(frame, stamp_s),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            D=list(camera.D) or [0.0] * 5,
            K=camera.K.ravel().tolist(),
        )

    @classmethod
    def transform(cls, parent, child, matrix, stamp_s=1.0):
        message = TransformStamped(header=cls.header(parent, stamp_s), child_frame_id=child)
        t, q = message.transform.translation, message.transform.rotation
        t.x, t.y, t.z = matrix[:3, 3]
        q.x, q.y, q.z, q.w = se3.quaternion_from_rotation(matrix[:3, :3])
        return message

    @classmethod
    def tf(cls, parent, child, matrix, stamp_s=1.0):
        return TFMessage([cls.transform(parent, child, matrix, stamp_s)])

    @classmethod
    def transforms(cls, edges, stamp_s=1.0):
        return TFMessage([cls.transform(*edge, m, stamp_s) for edge, m in edges.items()])

    @staticmethod
    def bag(path, messages, **options):
        """Write (topic, message, recorded_s) to a bag."""
        with rosbag.Bag(str(path), "w", **options) as bag:
            for topic, message, recorded_s in messages:
                bag.write(topic, message, rospy.Time.from_sec(recorded_s))
        return Path(path)
