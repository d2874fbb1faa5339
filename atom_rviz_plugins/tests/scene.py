"""What the plugins are tried on: patches of points, a scan, a picture, services of a collector."""

from __future__ import annotations

import threading

import numpy as np
import rospy
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs.msg import Image, LaserScan, PointCloud2, PointField
from std_msgs.msg import ColorRGBA
from std_srvs.srv import SetBool, SetBoolResponse
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from atom_calibration.msg import (
    CalibrationState,
    CollectionState,
    CollectionStates,
    CollectorState,
    PatternState,
    ResidualSummary,
    SensorDetection,
    SensorState,
)
from atom_calibration.srv import (
    DeleteCollection,
    DeleteCollectionResponse,
    SaveCollection,
    SaveCollectionResponse,
    SetSeed,
    SetSeedResponse,
)

LEFT, RIGHT = (255, 0, 0), (0, 0, 255)  # colours of the patches of points
NAME = (0, 255, 255)  # colour of a name that stands below a patch
SCAN = (0, 255, 0)  # colour of the scan
BLOCK = (255, 0, 255)  # colour of the block in the picture
BLOCK_PX = (200, 120, 40, 30)  # its left column, top row, width, height
IMAGE_SIZE = (480, 640)
SIDE = 20  # points along a patch
SPACING_M = 0.02
LEFT_M, RIGHT_M = (2.0, 0.5, 0.3), (2.0, -0.5, 0.3)  # middles of the patches in the cloud's frame
SCAN_BEAMS, SCAN_LOST, SCAN_RANGE_M, SCAN_STEP_RAD = 24, 4, 1.0, 0.02  # the first ones are lost
LIDAR = "my-lidar"  # with a sign that no topic has
SCAN_MIDDLE_M = (0.0, SCAN_RANGE_M, 0.0)  # of the returns, in the scan's frame


def cloud_message(stamp):
    """An organised cloud: a row of NaN, then the left patch, then the right one."""
    steps = (np.arange(SIDE) - (SIDE - 1) / 2) * SPACING_M
    patch = np.stack([*np.meshgrid(steps, steps, indexing="ij"), np.zeros((SIDE, SIDE))], axis=2)
    nothing = np.full((1, SIDE, 3), np.nan)
    points = np.concatenate([nothing, patch + LEFT_M, patch + RIGHT_M]).reshape(-1, 3)
    colours = [0] * SIDE
    for red, green, blue in (LEFT, RIGHT):
        colours += [red << 16 | green << 8 | blue] * SIDE**2
    data = np.zeros(len(points), [("xyz", np.float32, 3), ("rgb", np.uint32)])
    data["xyz"], data["rgb"] = points, colours
    message = PointCloud2(height=2 * SIDE + 1, width=SIDE, point_step=16, row_step=16 * SIDE)
    message.header.frame_id, message.header.stamp = "lidar", stamp
    message.fields = [
        PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(["x", "y", "z"])
    ] + [PointField("rgb", 12, PointField.FLOAT32, 1)]
    message.data = data.tobytes()
    return message


def scan_message(stamp):
    """A scan: beams that are lost, then an arc about the y axis."""
    arc_rad = (SCAN_BEAMS - SCAN_LOST - 1) * SCAN_STEP_RAD
    first_rad = np.pi / 2 - arc_rad / 2 - SCAN_LOST * SCAN_STEP_RAD
    message = LaserScan(angle_min=first_rad, angle_increment=SCAN_STEP_RAD)
    message.header.frame_id, message.header.stamp = "scanner", stamp
    message.angle_max = first_rad + (SCAN_BEAMS - 1) * SCAN_STEP_RAD
    message.range_min, message.range_max = 0.1, 10.0
    message.ranges = [np.inf] * SCAN_LOST + [SCAN_RANGE_M] * (SCAN_BEAMS - SCAN_LOST)
    return message


def image_message(stamp):
    """A grey picture with a block in it."""
    pixels = np.full((*IMAGE_SIZE, 3), 90, np.uint8)
    left, top, width, height = BLOCK_PX
    pixels[top : top + height, left : left + width] = BLOCK
    message = Image(height=IMAGE_SIZE[0], width=IMAGE_SIZE[1], encoding="bgr8")
    message.header.frame_id, message.header.stamp = "camera", stamp
    message.step = 3 * IMAGE_SIZE[1]
    message.data = pixels[:, :, ::-1].tobytes()
    return message


def transforms_message():
    """world to lidar: a quarter turn about z, and moved; world to scanner: moved."""
    lidar, scanner = TransformStamped(), TransformStamped()
    lidar.header.frame_id, lidar.child_frame_id = "world", "lidar"
    lidar.transform.translation.x = 0.5
    lidar.transform.translation.y = -2.0
    lidar.transform.rotation.z = lidar.transform.rotation.w = np.sqrt(0.5)
    scanner.header.frame_id, scanner.child_frame_id = "world", "scanner"
    scanner.transform.translation.x = 0.5
    scanner.transform.translation.y = -1.6
    scanner.transform.rotation.w = 1.0
    return TFMessage([lidar, scanner])


def name_marker():
    """A name one metre below the left patch, which hides what is there."""
    x, y, _ = LEFT_M
    marker = Marker(type=Marker.TEXT_VIEW_FACING, ns="names", text="IIIIII")
    marker.header.frame_id = "lidar"
    marker.pose.position = Point(x, y + 0.15, -1.0)
    marker.pose.orientation.w = 1.0
    marker.color = ColorRGBA(*(part / 255.0 for part in NAME), 1.0)
    return marker


class Scene:
    """Publishes all of it, and notes which services are called."""

    def __init__(self):
        self.calls = []
        self._services = []
        self._collections = ["000", "001", "002"]
        self._automatic = False
        self._lock = threading.Lock()
        self._publishers = {
            "cloud": rospy.Publisher("/lidar/points", PointCloud2, queue_size=1),
            "scan": rospy.Publisher("/scanner/scan", LaserScan, queue_size=1),
            "image": rospy.Publisher("/camera/labeled", Image, queue_size=1),
            "names": rospy.Publisher("/names", MarkerArray, queue_size=1, latch=True),
            "tf": rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True),
            "state": rospy.Publisher(
                "/collect_data/state", CollectorState, queue_size=1, latch=True
            ),
            "collections": rospy.Publisher(
                "/collect_data/collections", CollectionStates, queue_size=1, latch=True
            ),
            "calibration": rospy.Publisher(
                "/calibrate/state", CalibrationState, queue_size=1, latch=True
            ),
        }
        self._publishers["tf"].publish(transforms_message())
        self._publishers["names"].publish(MarkerArray([name_marker()]))
        self._publish_collections()
        self._publish_calibration()
        self._timer = rospy.Timer(rospy.Duration(0.2), self._publish)

    def offer_services(self):
        """The collector begins to run."""
        self._services = [
            rospy.Service("/collect_data/save_collection", SaveCollection, self._save),
            rospy.Service("/collect_data/delete_collection", DeleteCollection, self._delete),
            rospy.Service("/collect_data/toggle_automatic_data_collector", SetBool, self._toggle),
            rospy.Service("/my_lidar/set_seed", SetSeed, self._seed),
            rospy.Service("/my_scanner/set_seed", SetSeed, self._seed),
        ]

    def withdraw_services(self):
        """The collector ends."""
        for service in self._services:
            service.shutdown()

    # ---- messages

    def _publish(self, _):
        now = rospy.Time.now()
        self._publishers["cloud"].publish(cloud_message(now))
        self._publishers["scan"].publish(scan_message(now))
        self._publishers["image"].publish(image_message(now))
        state = CollectorState(dataset_folder="data/first", automatic=self._automatic)
        state.header.stamp = now
        state.collections = len(self._collections)
        lidar = SensorState(LIDAR, "lidar3d", 0x4F94C7, "/lidar/points", "lidar", now, [], [])
        lidar.patterns = [
            PatternState("board", False, "fewer than 10 points near the seed", 0, 0, "", [])
        ]
        camera = SensorState("camera", "rgb", 0x42B8A3, "/camera", "camera", now, [], [])
        camera.patterns = [
            PatternState("board", True, "", 48, 54, "blur 0.8 px, 2.1 m, 34 deg", [])
        ]
        scanner = SensorState(
            "my_scanner", "lidar2d", 0xEDB021, "/scanner/scan", "scanner", now, [], []
        )
        state.sensors = [camera, scanner, lidar]
        state.message = "Ready."
        self._publishers["state"].publish(state)

    def _publish_collections(self):
        message = CollectionStates()
        for number, name in enumerate(self._collections):
            collection = CollectionState(name, rospy.Time(10 + number), [])
            collection.detections = [SensorDetection("camera", "board", 48)]
            if number != 1:
                collection.detections.append(SensorDetection(LIDAR, "board", 512))
            message.collections.append(collection)
        self._publishers["collections"].publish(message)

    def _publish_calibration(self):
        message = CalibrationState(running=True, status="running", iteration=4, cost=321.5)
        message.residuals = [
            ResidualSummary("camera", 0x42B8A3, "reprojection", "px", 1100, 0.31, 24.7, ""),
            ResidualSummary(LIDAR, 0x4F94C7, "orthogonal", "m", 9000, 0.0098, 0.12, ""),
            ResidualSummary(LIDAR, 0x4F94C7, "border", "m", 420, 0.021, 0.0204, ""),
        ]
        self._publishers["calibration"].publish(message)

    # ---- services

    def _note(self, *call):
        with self._lock:
            self.calls.append(call)

    def _save(self, _):
        self._note("save")
        self._collections.append("003")
        self._publish_collections()
        return SaveCollectionResponse(True, "Collection 003 is saved.", "003")

    def _delete(self, request):
        self._note("delete", request.collection_name)
        self._collections.remove(request.collection_name)
        self._publish_collections()
        return DeleteCollectionResponse(True, "")

    def _toggle(self, request):
        self._note("automatic", request.data)
        self._automatic = request.data
        return SetBoolResponse(True, "")

    def _seed(self, request):
        self._note("seed", tuple(request.position))
        return SetSeedResponse(True, "")
