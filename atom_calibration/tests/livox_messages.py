"""Messages of Livox's drivers, whose packages need not be installed."""

import genpy.dynamic
import rospy
from std_msgs.msg import Header

SEPARATOR = "=" * 80
HEADER = f"{SEPARATOR}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"


def livox_classes(package):
    """Return the classes CustomMsg and CustomPoint of a driver, as its definitions make them."""
    definition = (
        "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n"
        f"uint8[3] rsvd\n{package}/CustomPoint[] points\n{SEPARATOR}\nMSG: {package}/CustomPoint\n"
        "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\n"
        f"uint8 line\n{HEADER}"
    )
    classes = genpy.dynamic.generate_dynamic(f"{package}/CustomMsg", definition)
    return classes[f"{package}/CustomMsg"], classes[f"{package}/CustomPoint"]


def livox_message(package, points):
    message, point = livox_classes(package)
    head = Header(stamp=rospy.Time(12), frame_id="livox_frame")
    each = [point(7 * i, x, y, z, 40 + i, 16, i % 6) for i, (x, y, z) in enumerate(points)]
    return message(head, 12_000_000_000, len(each), 1, [0, 0, 0], each)
