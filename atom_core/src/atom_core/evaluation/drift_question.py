"""What new boards are asked of a rig: whether it stands as it was calibrated."""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.calibration.options import OFF, CalibrationOptions
from atom_core.calibration.refine.rejection import Rejected
from atom_core.evaluation.spreads import NUMBERS, Spread
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.problem.model_errors import ErrorPriors


class Question(NamedTuple):
    """What is asked whether it has moved.

    Attributes:
        standing: new boards, the sensors where they are described.
        spreads: how exactly that is known.
        known_errors: of sensors and boards.
        moving: by the frame of a moving part, how far its poses are off [m, rad].
    """

    standing: Dataset
    spreads: Mapping[Edge, Spread]
    known_errors: ErrorPriors
    moving: Mapping[str, Tuple[float, float]]

    def options(self, held: Sequence[str]) -> CalibrationOptions:
        """Return how the new boards are solved while some sensors are held; none: what must be."""
        options = CalibrationOptions(
            model_errors=OFF, known_errors=self.known_errors, moving_edge_sigma=self.moving
        )
        if not held:
            return options
        return replace(options, anchor_sensors=tuple(held), ignore_anchored_sensor=True)

    def of_collection(self, key: str) -> Question:
        """Return the question to one of the boards."""
        return self._replace(standing=self.standing.selected(collections=[key]))

    def of_those_who_see(self) -> Question:
        """Return the question to the sensors that see a board: with others all would be refused."""
        seeing = {key.sensor for key, _ in self.standing.detections()}
        sensors = [name for name in self.standing.sensors if name in seeing]
        return self._replace(standing=self.standing.selected(sensors=sensors))

    def without_collection(self, key: str) -> Question:
        """Return the question to all boards but one."""
        others = [other for other in self.standing.collections if other != key]
        return self._replace(standing=self.standing.selected(collections=others))

    def without(self, left_out: Sequence[Rejected]) -> Question:
        """Return the question without some labels."""
        dataset = self.standing
        for key in (rejected.key for rejected in left_out):
            dataset = dataset.with_labels(key.collection, {(key.sensor, key.pattern): None})
        return self._replace(standing=dataset)


def scatter_of(described: Spread) -> float:
    """Return by how much detections vary more than their noise, as the rig's calibration had it.

    All limit points of a board's side are off together, for one, where a LiDAR's steps happen to
    end. Two or three new boards do not tell that themselves.
    """
    if not np.any(described.of_model):
        return described.scatter
    ratios = np.linalg.solve(described.of_model + 1e-18 * np.eye(NUMBERS), described.stated)
    return max(described.scatter, float(np.trace(ratios)) / NUMBERS)


def with_common_scatter(standing: Dataset, spreads: Mapping[Edge, Spread]) -> Dict[Edge, Spread]:
    """Return the spreads; range sensors of a modality scatter as much as they do in the mean.

    What a dozen detections of one tell of its own is little.
    """
    found = dict(spreads)
    for kind in {s.modality: s.kind for s in standing.sensors.values()}.values():
        alike = {s.edge for s in standing.sensors.values() if s.kind is kind}
        known = [e for e in alike if e in spreads and np.any(spreads[e].of_model)]
        if kind.measures_range and known:
            mean = float(np.mean([scatter_of(spreads[edge]) for edge in known]))
            # Its scatter is not taken as known (`_freedom` in drift.py): nothing is taken back.
            alike_known = {e: spreads[e]._replace(scatter=mean, freedom=np.inf) for e in known}
            found.update(alike_known)
    return found
