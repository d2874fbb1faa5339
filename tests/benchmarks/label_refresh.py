"""How soon RViz is sent a label that was corrected by hand, with the cell's whole clouds.

The node `dataset_playback` shows a collection of the simulated rig. Points of a LiDAR's label are
removed and put back, as the keys `r` and `p` do; a corner of a camera is moved by two clicks. What
is measured is the time from the message that RViz sends to the annotated cloud or image, and to the
state that the panel shows.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Callable, List, NamedTuple, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PointStamped
from seed_refresh import running_master, start_program, wait_until
from sensor_msgs.msg import Image, PointCloud2, PointField

from atom_calibration.msg import PlaybackState
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.model.dataset import Dataset
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.synthetic import paper_cell
from atom_core.synthetic.memory import Sampling

LIDAR, CAMERA = "lidar_1", "rgb_1"
_INDEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("index", "<u4")])
_SOON_S = 5.0  # more than any answer takes


class Refresh(NamedTuple):
    """How a kind of correction was answered.

    Attributes:
        what: it is.
        shown_ms: (n,) to the annotated data that RViz draws.
        told_ms: (n,) to the state in the panel.
    """

    what: str
    shown_ms: np.ndarray
    told_ms: np.ndarray


def label_refresh(corrections: int = 50) -> List[Refresh]:
    """Measure both; needs a built workspace on the environment.

    Args:
        corrections: of each kind.
    """
    with tempfile.TemporaryDirectory() as name, running_master(name) as environment:
        folder = Path(name)
        os.environ.update(environment)
        cell = paper_cell(0, "train", sampling=Sampling(background_step=1))
        path = write_dataset_folder(cell.dataset, folder / "data", name="cell")
        words = ("--dataset", path, "--output", folder / "dataset_corrected.json")
        node = start_program("rosrun", "atom_calibration", "dataset_playback", *words)
        try:
            rospy.init_node("label_refresh", disable_signals=True)
            dataset = read_dataset(path)
            return [_points(dataset, corrections), _corners(dataset, corrections)]
        finally:
            node.terminate()
            node.wait(60)


def _points(dataset: Dataset, corrections: int) -> Refresh:
    """Remove points of a cloud's label, put them back, and so on."""
    key, label = _first(dataset, LIDAR)
    assert isinstance(label, RangeLabel)
    topic = dataset.sensors[LIDAR].topic
    watch = _Watch(f"{topic}/labeled3d", PointCloud2)
    header = _shown(topic, PointCloud2, key)
    keys = [_publisher(f"/rviz/selected_{kind}points", PointCloud2) for kind in ("remove_", "")]
    indices = np.asarray(label.indices)[:20]
    fields = [PointField(name, 4 * i, 7, 1) for i, name in enumerate("xyz")]
    chosen = np.zeros(len(indices), _INDEX)
    chosen["index"] = indices
    message = PointCloud2(
        header=header,
        height=1,
        width=len(chosen),
        fields=[*fields, PointField("index", 12, 6, 1)],
        point_step=_INDEX.itemsize,
        row_step=chosen.nbytes,
        data=chosen.tobytes(),
        is_dense=True,
    )
    for number in range(corrections):
        watch.time(lambda number=number: keys[number % 2].publish(message))
    return watch.refresh(f"points of {LIDAR}")


def _corners(dataset: Dataset, corrections: int) -> Refresh:
    """Choose a corner of an image and say where it belongs, to and fro."""
    key, label = _first(dataset, CAMERA)
    assert isinstance(label, RgbLabel)
    topic = f"{dataset.sensors[CAMERA].topic}/labeled2d"
    watch = _Watch(topic, Image)
    header = _shown(topic, Image, key)
    clicks = _publisher(f"{topic}/mouse_click", PointStamped)
    place = np.array(label.pixels[0])
    for number in range(corrections):
        there = label.pixels[0] + (4.0 if number % 2 == 0 else 0.0)
        for pixel in (place, there):  # the corner, and where it belongs
            message = PointStamped(header=header)
            message.point.x, message.point.y = pixel
            watch.time(lambda message=message: clicks.publish(message))
        place = there
    return watch.refresh(f"corners of {CAMERA}")


class _Watch:
    """Notes when annotated data and the state have come."""

    def __init__(self, topic: str, kind: Any):
        self._shown_s: List[float] = []
        self._told_s: List[float] = []
        self._found: List[Tuple[float, float]] = []
        for name, of, heard in (
            (topic, kind, self._shown_s),
            ("/dataset_playback/state", PlaybackState, self._told_s),
        ):
            rospy.Subscriber(name, of, _noting(heard), buff_size=2**24, tcp_nodelay=True)
        wait_until(lambda: self._shown_s and self._told_s, f"{topic} is shown")

    def time(self, act: Callable[[], None]) -> None:
        """Do something, and wait for both answers."""
        time.sleep(0.05)
        self._shown_s.clear()
        self._told_s.clear()
        begin_s = time.perf_counter()
        act()
        wait_until(lambda: self._shown_s and self._told_s, "a corrected label")
        self._found.append((self._shown_s[0] - begin_s, self._told_s[0] - begin_s))

    def refresh(self, what: str) -> Refresh:
        """Return all that was measured."""
        shown_ms, told_ms = 1e3 * np.array(self._found).T
        return Refresh(what, shown_ms, told_ms)


def _noting(heard: List[float]) -> Callable[[Any], None]:
    return lambda _: heard.append(time.perf_counter())


def _publisher(topic: str, kind: Any) -> rospy.Publisher:
    publisher = rospy.Publisher(topic, kind, queue_size=5, tcp_nodelay=True)
    wait_until(publisher.get_num_connections, f"the node hears {topic}")
    return publisher


def _first(dataset: Dataset, sensor: str) -> Tuple[str, Any]:
    """Return the first collection in which a sensor has a label, and that label."""
    return next((d.collection, label) for d, label in dataset.detections() if d.sensor == sensor)


def _shown(topic: str, kind: Any, collection: str) -> Any:
    """Show a collection; return the header of what is shown then."""
    from atom_calibration.srv import ShowCollection

    show = rospy.ServiceProxy("/dataset_playback/show_collection", ShowCollection)
    show(collection)
    time.sleep(1.0)  # what was sent before has come by then
    return rospy.wait_for_message(topic, kind, _SOON_S).header


if __name__ == "__main__":
    for one in label_refresh(int(sys.argv[1]) if len(sys.argv) > 1 else 50):
        percentiles = [np.percentile(ms, [50, 95]) for ms in (one.shown_ms, one.told_ms)]
        print(one.what, *percentiles)
    os._exit(0)
