"""Is an answer ever good and wrong? Wrong values drawn by chance, in rigs whose truth is known.

One value of a dataset is made wrong: a camera's intrinsics, a transform of one collection, a label,
a board's measures. Then it is calibrated. Told is what ends with the verdict *good* and no warning,
and has an edge more than five of its combined sigmas beside the truth.

    nice -n 10 python3 tests/benchmarks/bench_wrong_answers.py --seconds 600 --seed 0

A transform that is wrong in all collections alike is not drawn: where it is on the way to the
sensor, the calibrated edge takes it up, and the sensor is where it should be.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.stated_errors import stated_errors
from atom_core.report.verdict import GOOD
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import scenes

COLLECTIONS, RIGS = 12, 30  # of each kind
FAR = 5.0  # combined sigmas
SIZES = (0.002, 0.005, 0.01, 0.03, 0.1, 0.3)
KINDS = {
    "random": lambda seed: scenes.random_scene(seed, collections=COLLECTIONS),
    "cameras": lambda seed: scenes.random_scene(
        seed, rgb=3, depth=0, lidar3d=0, collections=COLLECTIONS
    ),
    "camera, LiDAR": lambda seed: scenes.random_scene(
        seed, rgb=1, depth=0, lidar3d=1, collections=COLLECTIONS
    ),
    "camera on arm": lambda seed: scenes.hand_eye(seed, collections=COLLECTIONS),
    "board on arm": lambda seed: scenes.board_on_arm(seed, collections=COLLECTIONS),
    "LiDARs": lambda seed: scenes.lidar_only(seed, collections=COLLECTIONS),
}
Change = Callable[[Dict[str, Any], random.Random], Optional[str]]  # what was done, None: nothing


def _some_size(chance: random.Random) -> float:
    return chance.choice(SIZES) * chance.choice((-1, 1))


def _camera(document: Dict[str, Any], chance: random.Random) -> Optional[str]:
    cameras = [n for n, sensor in document["sensors"].items() if sensor.get("camera_info")]
    return chance.choice(cameras) if cameras else None


def _labels(document: Dict[str, Any], chance: random.Random) -> Dict[str, Any]:
    """Return the detected labels of a collection by sensor."""
    collection = chance.choice(list(document["collections"].values()))
    (by_sensor,) = collection["labels"].values()
    return {name: label for name, label in by_sensor.items() if label.get("detected")}


def _corners(document: Dict[str, Any], chance: random.Random) -> List[Dict[str, Any]]:
    """Return the corners of a camera's label; none where no camera sees the board."""
    seen = [label["idxs"] for label in _labels(document, chance).values()]
    of_cameras = [idxs for idxs in seen if idxs and isinstance(idxs[0], dict)]
    return chance.choice(of_cameras) if of_cameras else []


def intrinsics(document: Dict[str, Any], chance: random.Random) -> Optional[str]:
    """Make a focal length, a centre or a distortion coefficient wrong."""
    name = _camera(document, chance)
    if name is None:
        return None
    info, size = document["sensors"][name]["camera_info"], _some_size(chance)
    which = chance.choice(["f", "f", "cx", "cy", "D"])
    if which == "f":
        info["K"][0], info["K"][4] = (info["K"][i] * (1.0 + size) for i in (0, 4))
    elif which == "D":
        index = chance.randrange(len(info["D"]))
        info["D"][index] += size
    else:
        info["K"][{"cx": 2, "cy": 5}[which]] *= 1.0 + size
    return f"{which} of {name} by {size:g}"


def swapped_intrinsics(document: Dict[str, Any], chance: random.Random) -> Optional[str]:
    """Give two cameras each other's intrinsics."""
    one, other = _camera(document, chance), _camera(document, chance)
    if one is None or other is None or one == other:
        return None
    first, second = (document["sensors"][name] for name in (one, other))
    first["camera_info"], second["camera_info"] = second["camera_info"], first["camera_info"]
    return f"{one} and {other}"


def transform(document: Dict[str, Any], chance: random.Random) -> str:
    """Move or turn a transform in one collection."""
    key = chance.choice(list(document["collections"]))
    name = chance.choice(list(document["collections"][key]["transforms"]))
    entry, size = document["collections"][key]["transforms"][name], abs(_some_size(chance))
    direction = se3.random_direction(np.random.default_rng(chance.getrandbits(32))) * size
    if chance.random() < 0.5:
        entry["trans"] = [float(v) for v in np.array(entry["trans"]) + direction]
        return f"{name} of {key} by {size:g} m"
    turned = se3.rotation_from_quaternion(np.array(entry["quat"]))
    turned = turned @ se3.rotation_from_rotation_vector(direction)
    entry["quat"] = [float(v) for v in se3.quaternion_from_rotation(turned)]
    return f"{name} of {key} by {size:g} rad"


def corners(document: Dict[str, Any], chance: random.Random) -> Optional[str]:
    """Shift the corners of a label, or give them each other's numbers, or exchange x and y."""
    found, how = (
        _corners(document, chance),
        chance.choice(["shift", "reverse", "roll", "transpose"]),
    )
    if not found:
        return None
    ids, shift = [corner["id"] for corner in found], 100.0 * _some_size(chance)
    others = {"reverse": ids[::-1], "roll": ids[1:] + ids[:1]}.get(how, ids)
    for corner, number in zip(found, others):
        corner["id"] = number
        if how == "shift":
            corner["x"] += shift
        if how == "transpose":
            corner["x"], corner["y"] = corner["y"], corner["x"]
    return f"{how} {shift:g}" if how == "shift" else how


def points(document: Dict[str, Any], chance: random.Random) -> Optional[str]:
    """Put other points into the label of a range sensor."""
    labels = _labels(document, chance)
    seen = [n for n, v in labels.items() if v["idxs"] and not isinstance(v["idxs"][0], dict)]
    if not seen:
        return None
    name = chance.choice(seen)
    indices = labels[name]["idxs"]
    count = max(int(chance.choice(SIZES) * len(indices)), 1)
    beyond = {min(i + chance.choice((50, 200)), max(indices)) for i in indices[:count]}
    labels[name]["idxs"] = sorted(beyond | set(indices[count:]))
    return f"{count} of {name}"


def board(document: Dict[str, Any], chance: random.Random) -> str:
    """Describe a board that is larger or smaller, or has another border."""
    (entry,) = document["calibration_config"]["calibration_patterns"].values()
    document["patterns"], size = {}, _some_size(chance) / 3.0
    if chance.random() < 0.5:
        entry["size"] *= 1.0 + size
        entry["inner_size"] *= 1.0 + size
        return f"squares by {size:g}"
    border = entry["border_size"]
    wider = {axis: max(width + size, 0.0) for axis, width in border.items()}
    entry["border_size"] = wider
    return f"border by {size:g} m"


CHANGES: Dict[str, Change] = {
    "intrinsics": intrinsics,
    "swapped intrinsics": swapped_intrinsics,
    "transform": transform,
    "corners": corners,
    "points": points,
    "board": board,
}


def outcome(folder: Path, truth: Any) -> str:
    """Return how a changed dataset ends: refused, not good, warned, good, or far off."""
    try:
        found = calibrate(read_dataset(folder / "changed.json"))
    except AtomError:
        return "refused"
    results = calibration_results(found, default_solver())
    if calibration_verdict(results).grade != GOOD:
        return "not good"
    errors = stated_errors(results.edges, truth)
    if max((error.in_combined_sigmas for error in errors), default=0.0) <= FAR:
        return "good"
    return "warned" if found.warnings else "FAR OFF"


def drawn(place: Path, seed: int) -> Tuple[str, str]:
    """Return how one draw ends, and what it was."""
    chance = random.Random(seed)
    kind, name, rig = (
        chance.choice(list(KINDS)),
        chance.choice(list(CHANGES)),
        chance.randrange(RIGS),
    )
    scene, folder = KINDS[kind](rig), place / f"{kind} {rig}"
    if not folder.exists():
        write_dataset_folder(scene.dataset, folder, name="drawn")
    document = json.loads((folder / "dataset.json").read_text("utf-8"))
    told = CHANGES[name](document, chance)
    if told is None:
        return "unchanged", ""
    (folder / "changed.json").write_text(json.dumps(document), "utf-8")
    return outcome(folder, scene.truth), f"{kind} {rig}, {name}: {told}"


def main() -> None:
    """Print each answer that is good and far off, and how many there were of each kind."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    counts: Counter = Counter()
    end, seed = time.monotonic() + args.seconds, args.seed
    with tempfile.TemporaryDirectory() as place:
        while time.monotonic() < end:
            ended, what = drawn(Path(place), seed)
            counts[ended] += 1
            if ended == "FAR OFF":
                print(f"{ended}: seed {seed}, {what}", flush=True)
            seed += 1
    print(", ".join(f"{count} {ended}" for ended, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
