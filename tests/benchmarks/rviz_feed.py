"""Publishes what rviz_rate.py shows: a cloud, a picture, the state of a collector."""

import numpy as np
import rospy
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_srvs.srv import SetBool

from atom_calibration.msg import (
    CollectionState,
    CollectionStates,
    CollectorState,
    PatternState,
    SensorDetection,
    SensorState,
)
from atom_calibration.srv import DeleteCollection, SaveCollection

LAYERS, COLUMNS = 128, 1024
IMAGE_SIZE = (720, 1280)
CLOUD_HZ, IMAGE_HZ, STATE_HZ = 10.0, 5.0, 5.0
SENSORS = ("rgb_1", "rgb_2", "depth_1", "lidar_1", "lidar_2", "lidar_3")
COLLECTIONS = 23


def cloud_message() -> PointCloud2:
    """A room of 8 x 6 x 3 m around the LiDAR, with noise (131,072 points)."""
    rng = np.random.default_rng(0)
    azimuth = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)[None, :]
    elevation = np.linspace(-0.6, 0.6, LAYERS)[:, None]
    rays = np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ),
        axis=2,
    )
    walls_m = np.array([4.0, 3.0, 1.5]) / np.maximum(np.abs(rays), 1e-9)
    ranges_m = walls_m.min(axis=2) + 0.01 * rng.standard_normal((LAYERS, COLUMNS))
    data = np.zeros(LAYERS * COLUMNS, [("xyz", "<f4", 3), ("intensity", "<f4")])
    data["xyz"] = (rays * ranges_m[:, :, None]).reshape(-1, 3)
    data["intensity"] = rng.uniform(0, 255, len(data))
    message = PointCloud2(height=LAYERS, width=COLUMNS, point_step=16, row_step=16 * COLUMNS)
    message.header.frame_id = "lidar"
    names = ("x", "y", "z", "intensity")
    message.fields = [PointField(name, 4 * i, 7, 1) for i, name in enumerate(names)]
    message.data, message.is_dense = data.tobytes(), True
    return message


def image_message() -> Image:
    """A picture of noise."""
    pixels = np.random.default_rng(1).integers(0, 256, (*IMAGE_SIZE, 3), dtype=np.uint8)
    message = Image(height=IMAGE_SIZE[0], width=IMAGE_SIZE[1], encoding="rgb8")
    message.header.frame_id, message.step = "camera", 3 * IMAGE_SIZE[1]
    message.data = pixels.tobytes()
    return message


def state_message(now) -> CollectorState:
    """What a collector says, five times a second."""
    state = CollectorState(dataset_folder="data", collections=COLLECTIONS, message="Ready.")
    state.header.stamp = now
    for name in SENSORS:
        sensor = SensorState(name, name[:-2], 0, f"/{name}", name, now, [], [])
        sensor.patterns = [PatternState("board", True, "", int(now.nsecs % 97), 0, "", [])]
        state.sensors.append(sensor)
    return state


def collections_message() -> CollectionStates:
    """What it has collected."""
    message = CollectionStates()
    for number in range(COLLECTIONS):
        entry = CollectionState(f"{number:03d}", rospy.Time(10 + number), [])
        entry.detections = [SensorDetection(name, "board", 48) for name in SENSORS]
        message.collections.append(entry)
    return message


def main() -> None:
    """Publish until it is ended."""
    rospy.init_node("rviz_feed")
    offered = {
        "save_collection": SaveCollection,
        "delete_collection": DeleteCollection,
        "toggle_automatic_data_collector": SetBool,
    }
    for name, kind in offered.items():  # the panel only looks whether they are there
        rospy.Service(f"/collect_data/{name}", kind, lambda _: None)
    cloud, image = cloud_message(), image_message()
    publishers = {
        "cloud": rospy.Publisher("/lidar/points", PointCloud2, queue_size=1),
        "image": rospy.Publisher("/camera/labeled", Image, queue_size=1),
        "state": rospy.Publisher("/collect_data/state", CollectorState, queue_size=1),
    }
    latched = rospy.Publisher(
        "/collect_data/collections", CollectionStates, queue_size=1, latch=True
    )
    latched.publish(collections_message())

    def publish(name, message, make=None):
        def send(_):
            now = rospy.Time.now()
            made = make(now) if make else message
            made.header.stamp = now
            publishers[name].publish(made)

        return send

    rospy.Timer(rospy.Duration(1 / CLOUD_HZ), publish("cloud", cloud))
    rospy.Timer(rospy.Duration(1 / IMAGE_HZ), publish("image", image))
    rospy.Timer(rospy.Duration(1 / STATE_HZ), publish("state", None, state_message))
    rospy.spin()


if __name__ == "__main__":
    main()
