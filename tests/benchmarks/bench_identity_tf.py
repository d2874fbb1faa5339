"""Labels of the simulated cell without its transforms: all of /tf_static identity.

``python3 tests/benchmarks/bench_identity_tf.py [--stops 23] [--realism plain] [--folder DIR]``:
records a bag, collects from it as it is and with every fixed edge replaced by identity, and
compares the labels of the same data: how many there are, and the share of points (corners) that
both have.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any, Dict, List, Set, Tuple

import numpy as np
import rosbag
from cell_runs import CellRun
from geometry_msgs.msg import Quaternion, Vector3

from atom_core.report.tables import text_table

LEAST_IOU = 0.95
Key = Tuple[str, str, int]  # sensor, pattern, stamp [ns]


def main() -> None:
    """Print a table, a row for each sensor."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stops", type=int, default=23)
    parser.add_argument("--realism", choices=("plain", "rough"), default="rough")
    parser.add_argument("--folder", type=Path, help="where files stay; default: nowhere")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.folder or Path(temporary)
        (folder / "identity").mkdir(parents=True, exist_ok=True)
        good = CellRun(0, folder, realism=args.realism)
        good.simulate("train", args.stops)
        identity = CellRun(0, folder / "identity", realism=args.realism)
        without_transforms(good.bag("train"), identity.bag("train"))
        for run in (good, identity):
            run.collect("train")
        print(text_table(COLUMNS, rows(labels_of(good), labels_of(identity))))


def without_transforms(bag: Path, copy: Path) -> None:
    """Copy a bag; what /tf_static holds is identity."""
    with rosbag.Bag(str(bag)) as source, rosbag.Bag(str(copy), "w") as target:
        for topic, message, stamp, header in source.read_messages(return_connection_header=True):
            if topic == "/tf_static":
                for edge in message.transforms:
                    edge.transform.translation = Vector3(0.0, 0.0, 0.0)
                    edge.transform.rotation = Quaternion(0.0, 0.0, 0.0, 1.0)
            target.write(topic, message, stamp, connection_header=header)


def labels_of(run: CellRun) -> Dict[Key, Set[int]]:
    """Return the indices of all labels, by sensor, pattern and stamp of the data."""
    document = json.loads(run.dataset("train").read_text(encoding="utf-8"))
    found: Dict[Key, Set[int]] = {}
    for collection in document["collections"].values():
        for pattern, of_sensors in collection["labels"].items():
            for sensor, label in of_sensors.items():
                if label["detected"]:
                    stamp = collection["data"][sensor]["header"]["stamp"]
                    time_ns = int(stamp["secs"]) * 10**9 + int(stamp["nsecs"])
                    found[(sensor, pattern, time_ns)] = _indices(label["idxs"])
    return found


def _indices(entries: List[Any]) -> Set[int]:
    return {int(e["id"]) if isinstance(e, dict) else int(e) for e in entries}


COLUMNS = [
    "sensor",
    "labels",
    "without transforms",
    "of the same data",
    "IoU, median",
    "least",
    f"below {LEAST_IOU}",
]


def rows(good: Dict[Key, Set[int]], other: Dict[Key, Set[int]]) -> List[List[str]]:
    """Return the cells of the table."""
    by_sensor: Dict[str, List[float]] = defaultdict(list)
    for key in good.keys() & other.keys():
        by_sensor[key[0]].append(len(good[key] & other[key]) / len(good[key] | other[key]))
    table = []
    for sensor in sorted({key[0] for key in good}):
        shares = np.array(by_sensor[sensor])
        counts = [sum(key[0] == sensor for key in labels) for labels in (good, other)]
        figures = ["", "", ""]
        if len(shares):
            figures = [f"{np.median(shares):.3f}", f"{shares.min():.3f}"]
            figures.append(str(int(np.sum(shares < LEAST_IOU))))
        table.append([sensor, *(str(c) for c in counts), str(len(shares)), *figures])
    return table


if __name__ == "__main__":
    main()
