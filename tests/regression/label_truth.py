"""Labels of a simulated recording against what the sensors truly saw (``.labels.npz``)."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_json import read_truth
from atom_core.model.dataset import pose
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB
from atom_core.model.truth import with_truth

# What a sensor must have of a board that it can be asked to find.
LEAST_CORNERS, LEAST_PIXELS, LEAST_LAYERS = 0.25, 500, 4
STEEPEST_RANGE_DEG = 70.0
# Where a camera can be asked for exact corners.
STEEPEST_CORNERS_DEG, LEAST_SQUARE_PX = 60.0, 22.0


@dataclass
class Score:
    """Labels of one modality.

    Attributes:
        possible: detections that the geometry allows.
        found: those of them that were labeled.
        missed: the others, by collection and sensor.
        false: labels that are mostly not the board, by collection and sensor.
        errors_px: (n, 2) of corners, found minus true.
        hits, labeled, true: points or pixels that are labeled and true, labeled, true. Labels of
            depth images hold a part of the pixels, so that their recall says nothing.
    """

    possible: int = 0
    found: int = 0
    missed: list = field(default_factory=list)
    false: list = field(default_factory=list)
    errors_px: list = field(default_factory=list)
    hits: int = 0
    labeled: int = 0
    true: int = 0

    @property
    def share(self):
        return self.found / self.possible

    @property
    def precision(self):
        return self.hits / self.labeled

    @property
    def recall(self):
        return self.hits / self.true


def scores(dataset_file, bag):
    """Return the score of each modality of a dataset collected from a simulated bag."""
    bag = Path(bag)
    truth_file = bag.with_suffix(".truth.json")
    stops = json.loads(truth_file.read_text("utf-8"))["stops"]
    dataset, truth = read_dataset(dataset_file), read_truth(truth_file)
    arrays = np.load(bag.with_suffix(".labels.npz"))
    (pattern,) = dataset.patterns.values()
    exact = with_truth(dataset, type(truth)(truth.edges))
    result = {RGB: Score(), DEPTH: Score(), LIDAR3D: Score()}
    for key, collection in exact.collections.items():
        for name, sensor in exact.sensors.items():
            stamp = _stamp(dataset, key, name)
            if stamp is None:
                continue
            stop = next(s for s, t in stops.items() if t["start_s"] <= stamp < t["end_s"])
            world_T_sensor = pose(collection, exact.graph, exact.world, sensor.frame)
            sensor_T_pattern = se3.inverse(world_T_sensor) @ truth.boards[(pattern.name, stop)]
            seen = _Seen(arrays, f"{stop}/{name}", stamp, sensor_T_pattern, pattern)
            label = collection.labels.get((name, pattern.name))
            _judge(result[sensor.modality], sensor, seen, label, dataset, key)
    return result


@dataclass
class _Seen:
    """What one sensor saw of the board in one collection."""

    arrays: object
    place: str
    stamp_s: float
    sensor_T_pattern: np.ndarray
    pattern: object

    @property
    def incidence_deg(self):
        centre = np.append(self.pattern.border.centre, 0.0)
        ray = se3.apply(self.sensor_T_pattern, centre[None])[0]
        normal = self.sensor_T_pattern[:3, 2]
        return float(np.degrees(np.arccos(min(abs(normal @ ray) / np.linalg.norm(ray), 1.0))))

    @property
    def corner_ids(self):
        return self.arrays[f"{self.place}/corner_ids"]

    @property
    def pixels(self):
        return self.arrays[f"{self.place}/pixels"]

    @property
    def returns(self):
        stamps = self.arrays[f"{self.place}/stamps"]
        scan = int(np.argmin(np.abs(stamps - self.stamp_s)))
        assert abs(stamps[scan] - self.stamp_s) < 1e-3, self.place
        return self.arrays[f"{self.place}/returns_{scan}"]


def _judge(score, sensor, seen, label, dataset, key):
    detected = label is not None and label.detected
    if sensor.modality == RGB:
        possible = len(seen.corner_ids) >= LEAST_CORNERS * seen.pattern.corner_count
        good = _judge_corners(score, sensor, seen, label) if detected else 0.0
    else:
        true = seen.pixels if sensor.modality == DEPTH else seen.returns
        possible = seen.incidence_deg <= STEEPEST_RANGE_DEG and (
            len(true) >= LEAST_PIXELS
            if sensor.modality == DEPTH
            else _layers(dataset.data.read(key, sensor.name)[true]) >= LEAST_LAYERS
        )
        good = _judge_points(score, true, label) if detected else 0.0
    what = f"{key} {sensor.name}"
    if detected and good < 0.5:
        score.false.append(what)
    if possible:
        score.possible += 1
        score.found += int(detected)
        score.missed += [] if detected else [what]


def _judge_corners(score, sensor, seen, label):
    """Keep the errors of corners; return which share of them is right to a few pixels."""
    every = seen.pattern.corners_of(np.arange(seen.pattern.corner_count))
    exact = sensor.camera.project(se3.apply(seen.sensor_T_pattern, every))
    errors = label.pixels - exact[label.ids]
    large = _square_px(exact, seen.pattern.columns) >= LEAST_SQUARE_PX
    if large and seen.incidence_deg <= STEEPEST_CORNERS_DEG:
        score.errors_px.extend(errors.tolist())
    return float(np.mean(np.linalg.norm(errors, axis=1) < 5.0))


def _square_px(corners, columns):
    """Return the median length of a square's side in the image."""
    grid = corners.reshape(-1, columns, 2)
    steps = [np.diff(grid, axis=axis).reshape(-1, 2) for axis in (0, 1)]
    return float(np.median(np.linalg.norm(np.vstack(steps), axis=1)))


def _judge_points(score, true, label):
    hits = len(np.intersect1d(true, label.indices))
    score.hits += hits
    score.labeled += len(label.indices)
    score.true += len(true)
    return hits / len(label.indices)


def _layers(points):
    """Return the number of layers of points (n, 3) of the simulated LiDARs, 2 deg apart."""
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    return len(np.unique(np.round(elevation)))


def _stamp(dataset, key, name):
    data = dataset.document["collections"][key]["data"].get(name)
    if data is None:
        return None
    stamp = data["header"]["stamp"]
    return stamp["secs"] + 1e-9 * stamp["nsecs"]
