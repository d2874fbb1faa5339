"""Write a dataset as a bag: data of all sensors, intrinsics, transforms, positions of joints."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from atom_calibration.messages.cameras import camera_info_message
from atom_calibration.messages.poses import transforms_message
from atom_calibration.modalities.table import is_labeled, ros_modality
from atom_calibration.runtime import running
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.sources.bag_writer import new_bag
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import DatasetError, OutputError
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.selection import select_names
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

_LONGEST_S = 600.0  # that a collection may be held
_RATE_HZ = 5.0
_BEGIN_S = 0.01  # static transforms come before everything else

Entry = Tuple[str, Any, float]  # topic, message, time [s]


class Timing(NamedTuple):
    """When data are written.

    Attributes:
        hold_s: a collection lasts so long, its data repeated; 0: once, at their own stamps.
        rate_hz: how often they are repeated.
    """

    hold_s: float
    rate_hz: float = _RATE_HZ


def main(words: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(running.arguments() if words is None else list(words))
    return running.guarded("atom_dataset_to_rosbag", lambda: _run(args))


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog="atom_dataset_to_rosbag", description=__doc__)
    names = ("-i", "--input", "-json", "--json_file")
    add_option(made, "dataset", *names, required=True, type=Path, metavar="FILE", help="its JSON")
    text = "the bag (default: output.bag)"
    add_option(made, "output", "-o", type=Path, default=Path("output.bag"), metavar="F", help=text)
    text = "collections to write: names, globs, '!name', or ATOM's lambda strings"
    add_option(made, "collection_selection_function", "-csf", nargs="+", metavar="S", help=text)
    text = (
        "a collection lasts so many seconds, as if everything stood still, so that collectors find "
        "it (default: 2); 0: data once, at their own stamps"
    )
    add_option(made, "hold", type=float, default=2.0, metavar="S", help=text)
    add_option(made, "overwrite", "-ow", action="store_true", help="replace the bag")
    return made


def _run(args: argparse.Namespace) -> int:
    if args.output.exists() and not args.overwrite:
        raise OutputError(f"{args.output}: exists already; add --overwrite, or choose another name")
    if not 0.0 <= args.hold <= _LONGEST_S:
        raise OutputError(
            f"--hold {args.hold:g}: give seconds up to {_LONGEST_S:g}, or 0: the data's stamps"
        )

    def choose(keys: Sequence[str]) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    dataset = read_dataset(args.dataset, choose)
    absent = write_bag(dataset, args.output, Timing(args.hold))
    for line in absent:
        sys.stderr.write(f"atom_dataset_to_rosbag: warning: {line}\n")
    counts = f"{len(dataset.sensors)} sensors, {len(dataset.collections)} collections"
    sys.stdout.write(f"{args.output.resolve()}: {counts}\n")
    return 0


def write_bag(dataset: Dataset, path: Path, timing: Timing) -> List[str]:
    """Write a bag; return what it lacks, a sentence each.

    Raises:
        DatasetError: no data file is there, or one is damaged.
        OutputError: the bag cannot be written; nothing is left of it.
    """
    has = {(k, s) for k in dataset.collections for s in dataset.sensors if _has(dataset, k, s)}
    if not has:
        raise DatasetError(f"{dataset.source}: there are no data of any sensor; restore the files")
    with new_bag(path) as bag:
        _write_static(bag, dataset, _begin_s(dataset, timing) - _BEGIN_S)
        for topic, message, time_s in _entries(dataset, timing):
            bag.write(topic, message, rospy.Time.from_sec(time_s))
    without = [(key, s) for key in dataset.collections for s in dataset.sensors]
    return [f"collection {k} has no data of '{s}'" for k, s in without if (k, s) not in has]


def _has(dataset: Dataset, key: str, sensor: str) -> bool:
    return is_labeled(dataset.sensors[sensor].modality) and dataset.data.has_data(key, sensor)


def _entries(dataset: Dataset, timing: Timing) -> Iterator[Entry]:
    """Yield everything but the static transforms, in the order of time."""
    begin_s = _begin_s(dataset, timing)
    constant = constant_edges(dataset)
    for number, key in enumerate(dataset.collections):
        messages = dict(_messages(dataset, key))
        stamps = {name: _stamp_s(dataset, key, name) for name in messages}
        if timing.hold_s:
            ticks = max(int(round(timing.hold_s * timing.rate_hz)), 1)
            first_s = begin_s + number * ticks / timing.rate_hz
            times = [first_s + i / timing.rate_hz for i in range(ticks)]
            rounds = [dict.fromkeys(messages, time_s) for time_s in times]
        else:
            rounds = [stamps]
        for stamps_s in rounds:
            now_s = min(stamps_s.values(), default=begin_s)
            yield from _state(dataset, key, constant, now_s)
            for name, stamp_s in sorted(stamps_s.items(), key=lambda item: item[1]):
                yield from _data(
                    dataset.sensors[name], _topic(dataset, name), messages[name], stamp_s
                )


def _messages(dataset: Dataset, key: str) -> Iterator[Tuple[str, Any]]:
    """Yield the message of each sensor that has data in a collection, without its stamp."""
    for name, sensor in dataset.sensors.items():
        if _has(dataset, key, name):
            ros = ros_modality(sensor.modality)
            message = ros.encode(ros.from_dataset(dataset.data.read(key, name)))
            message.header.frame_id = sensor.frame
            yield name, message


def _data(sensor: Sensor, topic: str, message: Any, stamp_s: float) -> Iterator[Entry]:
    message.header.stamp = rospy.Time.from_sec(stamp_s)
    if sensor.camera is not None:
        info = camera_info_message(sensor.camera)
        info.header = message.header
        yield f"{topic.rpartition('/')[0]}/camera_info", info, stamp_s
    yield topic, message, stamp_s


def _state(
    dataset: Dataset, key: str, constant: Mapping[Edge, np.ndarray], time_s: float
) -> Iterator[Entry]:
    """Yield the transforms that differ between collections, and the joints."""
    collection, stamp = dataset.collections[key], rospy.Time.from_sec(time_s)
    boards = {board_edge(pattern) for pattern in dataset.patterns.values()}
    moving = {
        edge: value
        for edge, value in collection.transforms.items()
        if edge not in constant and edge not in boards
    }
    if moving:
        yield "/tf", transforms_message(moving, stamp), time_s
    if collection.joints:
        state = JointState(name=list(collection.joints))
        state.position = [joint.position for joint in collection.joints.values()]
        state.header.stamp = stamp
        yield "/joint_states", state, time_s


def constant_edges(dataset: Dataset) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of the edges, boards' aside, that no collection changes."""
    boards = {board_edge(pattern) for pattern in dataset.patterns.values()}
    found: Dict[Edge, np.ndarray] = {}
    changing = set(boards)
    for collection in dataset.collections.values():
        for edge, value in collection.transforms.items():
            if not np.array_equal(found.setdefault(edge, value), value):
                changing.add(edge)
    return {edge: value for edge, value in found.items() if edge not in changing}


def _write_static(bag: Any, dataset: Dataset, time_s: float) -> None:
    stamp = rospy.Time.from_sec(time_s)
    header = {
        "topic": "/tf_static",
        "type": TFMessage._type,
        "md5sum": TFMessage._md5sum,
        "message_definition": TFMessage._full_text,
        "callerid": "/atom_dataset_to_rosbag",
        "latching": "1",
    }
    message = transforms_message(constant_edges(dataset), stamp)
    bag.write("/tf_static", message, stamp, connection_header=header)


def _topic(dataset: Dataset, name: str) -> str:
    """Return the topic of raw data, which a sensor may have had compressed."""
    entry = dataset.config.sensors.get(name)
    topic = entry.topic_name if entry is not None else dataset.sensors[name].topic
    return topic or topic_of(name, "image_raw")


def _begin_s(dataset: Dataset, timing: Timing) -> float:
    stamps = [
        _stamp_s(dataset, key, name)
        for key in dataset.collections
        for name in dataset.sensors
        if _has(dataset, key, name)
    ]
    begin_s = min(stamps)
    return max(begin_s, 1.0) if timing.hold_s else begin_s


def _stamp_s(dataset: Dataset, key: str, name: str) -> float:
    """Return the stamp [s] of a sensor's data; without one, the collection's number."""
    data = (dataset.document["collections"][key].get("data") or {}).get(name) or {}
    stamp = (data.get("header") or {}).get("stamp") or {}
    stamp_s = float(stamp.get("secs", 0)) + 1e-9 * float(stamp.get("nsecs", 0))
    return stamp_s + _BEGIN_S if stamp_s == 0.0 else stamp_s
