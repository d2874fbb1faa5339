"""The estimate of a calibration: of a solver's iteration, or the answer, as poses and residuals.

Plain values, so that markers, pictures and messages of a live view need not know a solver.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Dict, Iterator, List, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.judge.statistics import Table, residual_table
from atom_core.calibration.start.boards import solved_dataset
from atom_core.errors import DatasetError
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import (
    BORDER,
    REPROJECTION,
    RangeBlock,
    ReprojectionBlock,
    ResidualBlock,
)
from atom_core.solvers.base import Iteration


class Corners(NamedTuple):
    """What a camera saw of a board, and where the calibration puts it.

    Attributes:
        key: the detection.
        ids: (n,) corners.
        detected: (n, 2) [px].
        projected: (n, 2) [px].
    """

    key: DetectionKey
    ids: np.ndarray
    detected: np.ndarray
    projected: np.ndarray


class Points(NamedTuple):
    """What a range sensor measured of a board.

    Attributes:
        key: the detection.
        points: (n, 3) in the sensor's frame [m].
        ids: (n,) of points in the cloud or of pixels in the image.
        border: True for those on the board's border.
    """

    key: DetectionKey
    points: np.ndarray
    ids: np.ndarray
    border: bool


@dataclass(frozen=True)
class Estimate:
    """What a solver has estimated: in an iteration, or as the answer.

    Attributes:
        number: of the iteration.
        cost: of the solver.
        dataset: with the estimated edges and boards in its transforms.
        problem: that is solved.
        x: its vector.
    """

    number: int
    cost: float
    dataset: Dataset
    problem: Problem
    x: np.ndarray

    @classmethod
    def of_iteration(cls, dataset: Dataset, iteration: Iteration) -> Estimate:
        """Return the estimate of an iteration; ``dataset`` is the one that is calibrated."""
        x = iteration.x.copy()
        solved = solved_dataset(dataset, iteration.problem, x, {})
        return cls(iteration.number, iteration.cost, solved, iteration.problem, x)

    @classmethod
    def of_calibration(cls, calibration: Calibration) -> Estimate:
        """Return the answer."""
        summary = calibration.summary
        return cls(
            summary.iterations,
            summary.cost_final,
            calibration.dataset,
            calibration.problem,
            summary.x,
        )

    @classmethod
    def of_solved(cls, solved: Solved) -> Estimate:
        """Return the answer of a calibration that is not judged yet."""
        summary, problem = solved.refined.summary, solved.refined.solver.problem
        return cls(summary.iterations, summary.cost_final, solved.dataset, problem, summary.x)

    def with_transforms_of(self, dataset: Dataset) -> Estimate:
        """Return it with sensors and boards where a dataset has them."""
        return replace(self, dataset=dataset)

    @cached_property
    def table(self) -> Table:
        """Statistics of the residuals, by sensor, kind and collection."""
        return residual_table(self.problem, self.x)

    @cached_property
    def sensor_poses(self) -> Dict[Tuple[str, str], np.ndarray]:
        """``world_T_sensor`` (4, 4) by sensor and collection, where its frame is known."""
        frames = {name: sensor.frame for name, sensor in self.dataset.sensors.items()}
        return self._world_poses(frames)

    @cached_property
    def board_poses(self) -> Dict[Tuple[str, str], np.ndarray]:
        """``world_T_pattern`` (4, 4) by pattern and collection, of those that are detected."""
        seen = {(key.pattern, key.collection) for key in self.problem.detections}
        frames = {name: pattern.frame for name, pattern in self.dataset.patterns.items()}
        return {key: pose for key, pose in self._world_poses(frames).items() if key in seen}

    @cached_property
    def poses_in_sensor(self) -> Mapping[DetectionKey, np.ndarray]:
        """``sensor_T_pattern`` (4, 4) of every detection."""
        return dict(zip(self.problem.detections, self.problem.poses(self.x)))

    def corners(self) -> Iterator[Corners]:
        """Yield the corners of every camera's detection."""
        poses = self.problem.poses(self.x)
        for block in self.problem.residual_blocks:
            if block.kind != REPROJECTION:
                continue
            assert isinstance(block, ReprojectionBlock)
            projected = block.pixels + block.residuals(poses)
            for key, mine in self._by_detection(block):
                yield Corners(key, block.ids[mine], block.pixels[mine], projected[mine])

    def points(self) -> Iterator[Points]:
        """Yield the labeled points of every range sensor's detection, the border's apart."""
        for block in self.problem.residual_blocks:
            if isinstance(block, RangeBlock):
                for key, mine in self._by_detection(block):
                    yield Points(key, block.points[mine], block.ids[mine], block.kind == BORDER)

    def used_collections(self) -> List[str]:
        """Return the keys of the collections that the problem has detections of."""
        used = {key.collection for key in self.problem.detections}
        return [key for key in self.dataset.collections if key in used]

    def _by_detection(self, block: ResidualBlock) -> Iterator[Tuple[DetectionKey, slice]]:
        """Yield detections and their items, which stand together."""
        present, starts = np.unique(block.detection, return_index=True)
        for detection, start, end in zip(present, starts, [*starts[1:], block.count]):
            yield self.problem.detections[detection], slice(int(start), int(end))

    def _world_poses(self, frames: Mapping[str, str]) -> Dict[Tuple[str, str], np.ndarray]:
        """Return ``world_T_frame`` by name and collection; without what has no place there."""
        graph, poses = self.dataset.graph, {}
        for name, frame in frames.items():
            for key, collection in self.dataset.collections.items():
                try:
                    poses[(name, key)] = pose(collection, graph, self.dataset.world, frame)
                except DatasetError:  # a board that nobody saw, a rig that hangs on nothing
                    continue
        return poses
