"""Labels of a simulated bag against its truth: what should be found, and what was.

The simulator's ``OUT.truth.json`` has the poses, ``OUT.labels.npz`` what each sensor saw of the
board (``atom_examples.cell_simulator.truth.Labels``).

* A board *to be found*: a LiDAR with returns from at least four of its layers, a depth camera with
  at least 500 pixels, in either case at most 70 degrees off the board's normal; a camera with a
  quarter of the corners in view.
* A *mixed* return or pixel is one at an edge: of the lines a beam's radius beside its middle some
  meet the board and some do not; a depth pixel outside the board with a neighbour on it. They
  count neither for precision nor for recall.
* Recall of a depth label is over the pixels of its grid, as it labels every n-th.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_json import read_truth
from atom_core.labeling.depth import DepthOptions
from atom_core.model.dataset import Dataset
from atom_core.model.dataset import pose as pose_of
from atom_core.model.labels import DetectionKey, Label, RangeLabel, RgbLabel
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.model.truth import with_truth

PATTERN = "pattern_1"
LARGEST_INCIDENCE_DEG = 70.0
LEAST_LAYERS, LEAST_PIXELS = 4, 500
LEAST_CORNERS = 0.25
MIXED_WITHIN_RAD = 0.0015  # of a beam's middle; half the divergence in sensors.yaml
LAYER_STEP_DEG, HIGHEST_LAYER_DEG = 2.0, 15.0  # of the simulated LiDARs; the lowest is at -15
TRUE_SHARE = 0.5  # of a label's points must be the board's; else it is a false board
WRONG_PX = 5.0  # a corner as far off is another one
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@dataclass
class Sight:
    """One board before one sensor in one collection: what is true, and what was labeled.

    Attributes:
        key: which.
        modality: of the sensor.
        to_be_found: geometry allows a label.
        found: there is one.
        false: it is on something else.
        incidence_deg: between the line to the board's middle and its normal.
        distance_m: to the board's middle.
        points: true returns, pixels or corners.
        layers: of a LiDAR that meet the board.
        in_view: share of the board between the lowest and the highest layer of a LiDAR.
        square_px: side of a square in the image, seen from the front.
        should, recalled: range sensors: points that belong to the label, and those in it.
        labeled, wrong: points of the label, and those that do not belong to it.
        border_m: (n,) limit points: distance to the true border, positive outside.
        error_px: (n, 2) labeled minus true corners.
    """

    key: DetectionKey
    modality: str
    to_be_found: bool = False
    found: bool = False
    false: bool = False
    incidence_deg: float = 0.0
    distance_m: float = 0.0
    points: int = 0
    layers: int = 0
    in_view: float = 1.0
    square_px: float = 0.0
    should: int = 0
    recalled: int = 0
    labeled: int = 0
    wrong: int = 0
    border_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
    error_px: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))


def sights(dataset_path: Path, truth_path: Path, labels_path: Path) -> List[Sight]:
    """Compare every collection of a dataset with the truth of the bag it was taken from.

    Args:
        dataset_path: ``dataset.json``.
        truth_path: ``OUT.truth.json``.
        labels_path: ``OUT.labels.npz``.

    Raises:
        ValueError: a collection was not taken at a stop.
    """
    dataset, truth = read_dataset(dataset_path), read_truth(truth_path)
    true, stops = with_truth(dataset, truth), json.loads(truth_path.read_text())["stops"]
    with np.load(labels_path) as arrays:
        seen = {name: arrays[name] for name in arrays.files}
    result = []
    for key, collection in true.collections.items():
        for name, sensor in dataset.sensors.items():
            stamp_s = _stamp_s(dataset, key, name)
            if stamp_s is None:
                continue
            stop = _stop_at(stops, stamp_s)
            world_T_pattern = truth.boards[(PATTERN, stop)]
            sensor_T_world = pose_of(collection, true.graph, sensor.frame, dataset.world)
            scene = _Scene(
                dataset,
                sensor,
                key,
                sensor_T_world @ world_T_pattern,
                {k.split("/")[2]: v for k, v in seen.items() if k.startswith(f"{stop}/{name}/")},
                stamp_s,
            )
            result.append(scene.compare(collection.labels.get((name, PATTERN))))
    return result


def _stamp_s(dataset: Dataset, collection: str, sensor: str) -> Optional[float]:
    data: Mapping[str, Any] = dataset.document["collections"][collection]["data"]
    if sensor not in data:
        return None
    stamp = data[sensor]["header"]["stamp"]
    return float(stamp["secs"] + 1e-9 * stamp["nsecs"])


def _stop_at(stops: Mapping[str, Mapping[str, float]], stamp_s: float) -> str:
    for stop, times in stops.items():
        if times["start_s"] - 1e-6 <= stamp_s <= times["end_s"] + 1e-6:
            return stop
    raise ValueError(f"a collection was taken at {stamp_s:.3f} s, while the board moved")


class _Scene:
    """The board before one sensor, as it truly is."""

    def __init__(
        self,
        dataset: Dataset,
        sensor: Sensor,
        collection: str,
        sensor_T_pattern: np.ndarray,
        seen: Dict[str, np.ndarray],
        stamp_s: float,
    ):
        """Take the truth of one stop and sensor, ``seen`` by the last part of its name."""
        self.dataset, self.sensor, self.seen = dataset, sensor, seen
        self.key = DetectionKey(collection, sensor.name, PATTERN)
        self.pattern = dataset.patterns[PATTERN]
        self.sensor_T_pattern, self.stamp_s = sensor_T_pattern, stamp_s

    def compare(self, label: Optional[Label]) -> Sight:
        middle = self.in_sensor(self.pattern.border.centre[None])[0]
        away = float(np.linalg.norm(middle))
        cosine = abs(float(self.sensor_T_pattern[:3, 2] @ middle)) / away
        sight = Sight(self.key, self.sensor.modality, distance_m=away)
        sight.incidence_deg = float(np.degrees(np.arccos(min(cosine, 1.0))))
        sight.found = label is not None and label.detected
        if self.sensor.modality == RGB:
            self._corners(sight, label)
        elif self.sensor.modality == LIDAR3D:
            self._returns(sight, label)
        elif self.sensor.modality == DEPTH:
            self._pixels(sight, label)
        return sight

    def in_sensor(self, on_board: np.ndarray) -> np.ndarray:
        return se3.apply(
            self.sensor_T_pattern, np.column_stack([on_board, np.zeros(len(on_board))])
        )

    def _corners(self, sight: Sight, label: Optional[Label]) -> None:
        camera = self.sensor.camera
        assert camera is not None
        corners = self.in_sensor(
            self.pattern.corners_of(np.arange(self.pattern.corner_count))[:, :2]
        )
        from_the_front = self.sensor_T_pattern[:3, 2] @ corners.mean(axis=0) > 0
        sight.points = int(np.sum(camera.in_image(corners))) if from_the_front else 0
        sight.to_be_found = sight.points >= LEAST_CORNERS * self.pattern.corner_count
        focal = float(camera.focal_px.mean())
        sight.square_px = focal * self.pattern.square_m / sight.distance_m
        if isinstance(label, RgbLabel) and label.detected:
            sight.error_px = label.pixels - camera.project(corners[label.ids])
            sight.labeled = len(label.ids)
            sight.wrong = int(np.sum(np.linalg.norm(sight.error_px, axis=1) > WRONG_PX))
            sight.false = sight.wrong > TRUE_SHARE * sight.labeled

    def _returns(self, sight: Sight, label: Optional[Label]) -> None:
        cloud = self.dataset.data.read(self.key.collection, self.sensor.name).astype(float)
        number = int(np.argmin(np.abs(self.seen["stamps"] - self.stamp_s)))
        if abs(self.seen["stamps"][number] - self.stamp_s) > 1e-3:
            raise ValueError(f"{self.key}: no truth of the cloud at {self.stamp_s:.3f} s")
        on_board = np.zeros(len(cloud), dtype=bool)
        on_board[self.seen[f"returns_{number}"]] = True
        board = cloud[on_board]
        elevation = np.degrees(np.arcsin(board[:, 2] / np.linalg.norm(board, axis=1)))
        sight.layers = len(np.unique(np.rint((elevation + HIGHEST_LAYER_DEG) / LAYER_STEP_DEG)))
        sight.points = int(on_board.sum())
        sight.in_view = self._between_layers()
        steep = sight.incidence_deg <= LARGEST_INCIDENCE_DEG
        sight.to_be_found = steep and sight.layers >= LEAST_LAYERS
        mixed = _mixed(cloud, self.sensor_T_pattern, self.pattern.border)
        if isinstance(label, RangeLabel) and label.detected:
            self._count(sight, label.indices, on_board, mixed, np.ones_like(on_board))
            sight.border_m = self._from_border(cloud[label.limit_indices])

    def _between_layers(self) -> float:
        steps = np.linspace(-1.0, 1.0, 41)
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        border = self.pattern.border
        points = self.in_sensor(border.centre + grid * border.half_size)
        elevation = np.degrees(np.arcsin(points[:, 2] / np.linalg.norm(points, axis=1)))
        return float(np.mean(np.abs(elevation) <= HIGHEST_LAYER_DEG + 0.5 * LAYER_STEP_DEG))

    def _pixels(self, sight: Sight, label: Optional[Label]) -> None:
        depth_m = self.dataset.data.read(self.key.collection, self.sensor.name)
        on_board = np.zeros(depth_m.size, dtype=bool)
        on_board[self.seen["pixels"]] = True
        sight.points = int(on_board.sum())
        steep = sight.incidence_deg <= LARGEST_INCIDENCE_DEG
        sight.to_be_found = steep and sight.points >= LEAST_PIXELS
        mask = on_board.reshape(depth_m.shape).astype(np.uint8)
        mixed = ((cv2.dilate(mask, _CROSS) > 0) & (mask == 0)).ravel()
        grid = np.zeros(depth_m.shape, dtype=bool)
        grid[:: DepthOptions.step, :: DepthOptions.step] = True
        valid = np.isfinite(depth_m) & (depth_m > 0)
        if isinstance(label, RangeLabel) and label.detected:
            indices = np.union1d(label.indices, label.limit_indices)
            self._count(sight, indices, on_board, mixed, (grid & valid).ravel())
            assert self.sensor.camera is not None
            row, column = np.divmod(label.limit_indices, depth_m.shape[1])
            xy = self.sensor.camera.normalise(np.column_stack([column, row]).astype(float))
            rays = np.column_stack([xy, np.ones(len(xy))])
            sight.border_m = self._from_border(rays)

    @staticmethod
    def _count(
        sight: Sight,
        indices: np.ndarray,
        on_board: np.ndarray,
        mixed: np.ndarray,
        counts: np.ndarray,
    ) -> None:
        labeled = np.zeros(len(on_board), dtype=bool)
        labeled[indices] = True
        sight.labeled = int(np.sum(labeled & ~mixed))
        sight.wrong = int(np.sum(labeled & ~mixed & ~on_board))
        sight.should = int(np.sum(on_board & ~mixed & counts))
        sight.recalled = int(np.sum(on_board & ~mixed & counts & labeled))
        sight.false = np.sum(labeled & on_board) < TRUE_SHARE * np.sum(labeled)

    def _from_border(self, rays: np.ndarray) -> np.ndarray:
        """Return how far outside the border [m] the lines of sight to points (n, 3) meet it."""
        in_plane, _ = _on_plane(rays, self.sensor_T_pattern)
        return self.pattern.border.signed_distance(in_plane)[0]


def _on_plane(rays: np.ndarray, sensor_T_pattern: np.ndarray):
    """Return where lines of sight (n, 3) meet the board's plane (n, 2) [m], and whether they do."""
    normal, origin = sensor_T_pattern[:3, 2], sensor_T_pattern[:3, 3]
    cosine = rays @ normal
    along = (origin @ normal) / np.where(np.abs(cosine) < 1e-9, 1e-9, cosine)
    points = se3.apply(se3.inverse(sensor_T_pattern), rays * along[:, None])
    return points[:, :2], along > 0


def _mixed(cloud: np.ndarray, sensor_T_pattern: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return (n,) bool: part of the beam meets the board, part of it does not."""
    up = np.array([0.0, 0.0, 1.0])  # the spin axis of the simulated LiDARs
    directions = cloud / np.linalg.norm(cloud, axis=1)[:, None]
    left = np.cross(up, directions)
    left /= np.linalg.norm(left, axis=1)[:, None]
    above = np.cross(directions, left)
    hits = []
    for side in (0.0 * left, left, -left, above, -above):
        in_plane, ahead = _on_plane(directions + MIXED_WITHIN_RAD * side, sensor_T_pattern)
        hits.append(ahead & (border.signed_distance(in_plane)[0] <= 0.0))
    return np.any(hits, axis=0) & ~np.all(hits, axis=0)
