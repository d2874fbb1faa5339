"""What a calibration says when its assumptions do not hold.

Each fault is planted into the paper's cell, or into a camera on an arm, and calibrated from a start
that is 0.1 m and 0.1 rad off. The table shows the worst sensor against the truth, in millimetres
and in stated sigmas, and the verdict. An answer is *confidently wrong* where it is called
`converged`, and a sensor is more than three sigmas and three millimetres off. Prints a table and
writes trust.csv; alone: `python3 tests/benchmarks/trust.py --seeds 3`.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Sequence

import numpy as np

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import Collection, Dataset, DataSource
from atom_core.model.transforms import Edge
from atom_core.report.calibration_results import calibration_results
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import paper_cell, scenes
from atom_core.synthetic.dataset import SyntheticDataset

DISTURBANCE = (0.1, 0.1)
SIGMAS, WRONG_M = 3.0, 0.003
_CENTRE_OFF = np.array([[0, 0, 20.0], [0, 0, 0], [0, 0, 0]])
LIDARS = ("lidar_1", "lidar_2", "lidar_3")

Change = Callable[[np.ndarray], np.ndarray]
Plant = Callable[[Dataset, np.random.Generator], Dataset]


class ChangedData(DataSource):
    """The data of a dataset, some sensors' changed."""

    def __init__(self, data: DataSource, changes: Mapping[str, Change]):
        """Take the data, and what is done to those of some sensors."""
        self._data, self._changes = data, changes

    def read(self, collection: str, sensor: str) -> Any:
        """Return the data as changed."""
        data = self._data.read(collection, sensor)
        return self._changes[sensor](data) if sensor in self._changes else data

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether there are data."""
        return self._data.has_data(collection, sensor)


class ExchangedData(DataSource):
    """The data of a dataset, one sensor's exchanged among collections."""

    def __init__(self, data: DataSource, sensor: str, taken_from: Mapping[str, str]):
        """Take the data, and from which collection those of a collection come."""
        self._data, self._sensor, self._taken_from = data, sensor, taken_from

    def read(self, collection: str, sensor: str) -> Any:
        """Return the data of the collection that they are taken from."""
        if sensor == self._sensor:
            collection = self._taken_from.get(collection, collection)
        return self._data.read(collection, sensor)

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether there are data."""
        return self._data.has_data(collection, sensor)


# ---------------------------------------------------------------------------------- faults


def nothing(dataset: Dataset, _: np.random.Generator) -> Dataset:
    """Return the dataset as it is."""
    return dataset


def changed(sensors: Sequence[str], change: Change) -> Plant:
    """Return what changes the data of some sensors."""

    def plant(dataset: Dataset, _: np.random.Generator) -> Dataset:
        return replace(dataset, data=ChangedData(dataset.data, dict.fromkeys(sensors, change)))

    return plant


def longer(points: np.ndarray) -> np.ndarray:
    """Return points that lie 30 mm farther from the sensor."""
    return points * (1.0 + 0.03 / np.linalg.norm(points, axis=1, keepdims=True))


def mirrored(points: np.ndarray) -> np.ndarray:
    """Return points mirrored in y."""
    return points * [1.0, -1.0, 1.0]


def board_scaled(factor: float) -> Plant:
    """Return what makes the configuration's board larger than it is."""

    def plant(dataset: Dataset, _: np.random.Generator) -> Dataset:
        patterns = {}
        for name, pattern in dataset.patterns.items():
            border = Rectangle(
                *(factor * (pattern.border.centre - pattern.border.half_size)),
                *(factor * (pattern.border.centre + pattern.border.half_size)),
            )
            patterns[name] = replace(
                pattern,
                square_m=factor * pattern.square_m,
                corners_by_id=factor * pattern.corners_by_id,
                border=border,
            )
        return replace(dataset, patterns=patterns)

    return plant


def off_centre(dataset: Dataset, _: np.random.Generator) -> Dataset:
    """Return a dataset whose board's print is 20 mm beside where the configuration has it."""
    patterns = {
        name: replace(p, corners_by_id=p.corners_by_id + [0.02, 0.0])
        for name, p in dataset.patterns.items()
    }
    return replace(dataset, patterns=patterns)


def focal_length(sensor: str, factor: float) -> Plant:
    """Return what makes a camera's focal length wrong."""

    def plant(dataset: Dataset, _: np.random.Generator) -> Dataset:
        camera = dataset.sensors[sensor].camera
        assert camera is not None
        wrong = replace(camera, K=camera.K * [[factor, 1, 1], [1, factor, 1], [1, 1, 1]])
        return _with_cameras(dataset, {sensor: wrong})

    return plant


def centre_off(dataset: Dataset, _: np.random.Generator) -> Dataset:
    """Return a dataset in which the image centre of rgb_1 is 20 px beside the true one."""
    camera = dataset.sensors["rgb_1"].camera
    assert camera is not None
    return _with_cameras(dataset, {"rgb_1": replace(camera, K=camera.K + _CENTRE_OFF)})


def _with_cameras(dataset: Dataset, cameras: Mapping[str, Any]) -> Dataset:
    sensors = {
        name: replace(sensor, camera=cameras.get(name, sensor.camera))
        for name, sensor in dataset.sensors.items()
    }
    return replace(dataset, sensors=sensors)


def exchanged(sensor: str, share: float, data_too: bool) -> Plant:
    """Return what exchanges a sensor's labels, and its data, among some of its collections."""

    def plant(dataset: Dataset, rng: np.random.Generator) -> Dataset:
        keys = [key.collection for key, _ in dataset.detections() if key.sensor == sensor]
        chosen = list(rng.choice(keys, max(int(round(share * len(keys))), 2), replace=False))
        taken_from = dict(zip(chosen, [*chosen[1:], chosen[0]]))
        collections: Dict[str, Collection] = {}
        for key, collection in dataset.collections.items():
            other = dataset.collections[taken_from.get(key, key)]
            mine = {k: v for k, v in collection.labels.items() if k[0] != sensor}
            theirs = {k: v for k, v in other.labels.items() if k[0] == sensor}
            collections[key] = replace(collection, labels={**mine, **theirs})
        data = ExchangedData(dataset.data, sensor, taken_from) if data_too else dataset.data
        return replace(dataset, collections=collections, data=data)

    return plant


def arm_noise(dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Return a dataset whose arm is 5 mm and 1 deg beside where it says it is, each time."""
    first = next(iter(dataset.collections.values()))
    edge = next(edge for edge in first.transforms if edge.child == "flange")
    changes: Dict[str, Dict[Edge, np.ndarray]] = {}
    for key, collection in dataset.collections.items():
        turn, shift = rng.normal(size=(2, 3)) * [[np.radians(1.0)], [0.005]] / np.sqrt(3.0)
        off = se3.transform(se3.rotation_from_rotation_vector(turn), shift)
        changes[key] = {edge: collection.transforms[edge] @ off}
    return dataset.with_transforms(changes)


class Fault(NamedTuple):
    """A fault, and the scene that it is planted into."""

    name: str
    scene: Callable[[int], SyntheticDataset]
    plant: Plant


def cell(seed: int) -> SyntheticDataset:
    """Return the paper's cell."""
    return paper_cell(seed, disturbance=DISTURBANCE)


def arm(seed: int) -> SyntheticDataset:
    """Return a camera on an arm."""
    return scenes.hand_eye(seed, collections=20, disturbance=DISTURBANCE)


FAULTS = (
    Fault("none", cell, nothing),
    Fault("every LiDAR reads 30 mm long", cell, changed(LIDARS, longer)),
    Fault("lidar_1 mirrored in y", cell, changed(["lidar_1"], mirrored)),
    Fault("lidar_1: labels of another collection in 40 %", cell, exchanged("lidar_1", 0.4, False)),
    Fault("lidar_1: data and labels exchanged in 30 %", cell, exchanged("lidar_1", 0.3, True)),
    Fault("rgb_1: labels exchanged in 30 %", cell, exchanged("rgb_1", 0.3, True)),
    Fault("board 0.5 % large", cell, board_scaled(1.005)),
    Fault("board 5 % large", cell, board_scaled(1.05)),
    Fault("print 20 mm off the board's centre", cell, off_centre),
    Fault("depth ten times too far", cell, changed(["depth_1"], lambda image: 10.0 * image)),
    Fault("depth 1 % too far", cell, changed(["depth_1"], lambda image: 1.01 * image)),
    Fault("rgb_1: image centre 20 px off", cell, centre_off),
    Fault("rgb_1: focal length 2 % long", cell, focal_length("rgb_1", 1.02)),
    Fault("rgb_1: focal length 10 % long", cell, focal_length("rgb_1", 1.10)),
    Fault("camera on an arm, none", arm, nothing),
    Fault("camera on an arm, arm 5 mm and 1 deg off", arm, arm_noise),
)


# ----------------------------------------------------------------------------------- figures


def trust(output: Path, seeds: int) -> None:
    """Plant every fault into a scene of each seed; print the table, write trust.csv."""
    rows = [_row(fault, seed) for fault in FAULTS for seed in range(seeds)]
    output.mkdir(parents=True, exist_ok=True)
    with (output / "trust.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    headers = ["fault", "wrong", "confidently", "worst [mm]", "worst [sigma]", "verdicts"]
    print(text_table(headers, [_summary(f, rows) for f in FAULTS], "Planted faults", 1))
    wrong = sum(bool(row["confidently_wrong"]) for row in rows)
    print(f"confidently wrong: {wrong} of {len(rows)}, to reach 0")


def _row(fault: Fault, seed: int) -> Dict[str, object]:
    scene = fault.scene(seed)
    row: Dict[str, object] = {"fault": fault.name, "seed": seed}
    try:
        result = calibrate(fault.plant(scene.dataset, np.random.default_rng([seed, 77])))
    except AtomError as error:
        figures = {"worst_mm": float("nan"), "worst_sigmas": float("nan")}
        said = {"status": "refused", "message": str(error), "warnings": ""}
        return {**row, **figures, "wrong": False, "confidently_wrong": False, **said}
    worst_m, worst_sigmas = _errors(result, scene)
    wrong = worst_m > WRONG_M and worst_sigmas > SIGMAS
    return {
        **row,
        "worst_mm": 1000.0 * worst_m,
        "worst_sigmas": worst_sigmas,
        "wrong": wrong,
        "confidently_wrong": wrong and result.status == CONVERGED,
        "status": result.status,
        "message": result.message,
        "warnings": " | ".join(result.warnings),
    }


def _errors(result: Calibration, scene: SyntheticDataset) -> List[float]:
    """Return the largest error of an estimated edge [m], and the largest in its stated sigmas."""
    metres, sigmas = [0.0], [0.0]
    for found in calibration_results(result, default_solver()).edges:
        if found.anchored or found.edge not in scene.truth.edges:
            continue
        off = found.parent_T_child[:3, 3] - scene.truth.edges[found.edge][:3, 3]
        metres.append(float(np.linalg.norm(off)))
        sigmas.append(float(np.max(np.abs(off) / np.maximum(found.sigma_translation_m, 1e-9))))
    return [max(metres), max(sigmas)]


def _summary(fault: Fault, rows: Sequence[Mapping[str, Any]]) -> List[object]:
    mine = [row for row in rows if row["fault"] == fault.name]
    statuses = [str(row["status"]) for row in mine]
    verdicts = ", ".join(f"{statuses.count(s)} {s}" for s in dict.fromkeys(statuses))
    worst = [np.nanmax([row[key] for row in mine] + [0.0]) for key in ("worst_mm", "worst_sigmas")]
    counts = [sum(bool(row[key]) for row in mine) for key in ("wrong", "confidently_wrong")]
    return [fault.name, *(f"{count} of {len(mine)}" for count in counts), *worst, verdicts]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench_output"))
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    trust(arguments.output, arguments.seeds)
