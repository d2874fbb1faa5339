"""How far each calibrated edge, board and joint is from the truth, before and after."""

from __future__ import annotations

from typing import Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth


class PoseError(NamedTuple):
    """An edge's error, found minus true.

    Attributes:
        shift_m: (3,) along the parent's axes.
        turn_rad: (3,) rotation vector about the parent's axes.
    """

    shift_m: np.ndarray
    turn_rad: np.ndarray

    @property
    def translation_m(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.shift_m))

    @property
    def rotation_rad(self) -> float:
        """Angle of the turn."""
        return float(np.linalg.norm(self.turn_rad))


class EdgeError(NamedTuple):
    """The errors of an edge.

    Attributes:
        edge: which.
        name: of its sensor (several, joined by a comma), additional tf or pattern.
        collection: in which; None where one value holds for all.
        before: at the start, after any disturbance; None where it had no value.
        after: as calibrated.
    """

    edge: Edge
    name: str
    collection: Optional[str]
    before: Optional[PoseError]
    after: PoseError


class JointError(NamedTuple):
    """The errors of a joint's parameter in its unit, found minus true."""

    joint: str
    parameter: str
    unit: str
    before: float
    after: float


def pose_error(true: np.ndarray, found: np.ndarray) -> PoseError:
    """Compare two values ``parent_T_child`` (4, 4) of an edge."""
    turn = se3.rotation_vector_from_rotation(found[:3, :3] @ true[:3, :3].T)
    return PoseError(found[:3, 3] - true[:3, 3], turn)


def edge_errors(initial: Dataset, solved: Dataset, truth: Truth) -> List[EdgeError]:
    """Compare the edges of sensors, of additional tfs and of boards with the truth.

    Args:
        initial: what the solver started from.
        solved: the calibrated dataset.
        truth: those that it does not know are left out.

    Returns:
        One for each edge, or for each edge and collection where values differ between them.
    """
    return [
        error
        for edge, name, true in _known(solved, truth)
        for error in _of_edge(edge, name, true, initial, solved)
    ]


def _known(solved: Dataset, truth: Truth) -> Iterator[Tuple[Edge, str, Mapping[str, np.ndarray]]]:
    """Yield edges with their names and true values by collection."""
    names: Dict[Edge, List[str]] = {}
    for sensor in solved.sensors.values():
        names.setdefault(sensor.edge, []).append(sensor.name)
    for name, entry in solved.config.additional_tfs.items():
        names.setdefault(entry.edge, []).append(name)
    for edge, of_edge in names.items():
        true = {key: truth.value(edge, key) for key in solved.collections}
        known = {key: value for key, value in true.items() if value is not None}
        yield edge, ", ".join(of_edge), known
    for name, pattern in solved.patterns.items():
        boards = {key: m for (board, key), m in truth.boards.items() if board == name}
        yield board_edge(pattern), name, boards


def _of_edge(
    edge: Edge, name: str, true: Mapping[str, np.ndarray], initial: Dataset, solved: Dataset
) -> List[EdgeError]:
    errors: List[EdgeError] = []
    values: List[Sequence[np.ndarray]] = []
    for key, matrix in true.items():
        found = solved.collections[key].transforms.get(edge) if key in solved.collections else None
        if found is None:
            continue
        start = initial.collections[key].transforms.get(edge)
        before = None if start is None else pose_error(matrix, start)
        errors.append(EdgeError(edge, name, key, before, pose_error(matrix, found)))
        values.append((matrix, found))
    if all(np.array_equal(a, b) for pair in values for a, b in zip(pair, values[0])):
        return [error._replace(collection=None) for error in errors[:1]]
    return errors


def joint_errors(initial: Dataset, solved: Dataset, truth: Truth) -> List[JointError]:
    """Compare the parameters of joints whose truth is known; those that were never off stay out."""
    errors = []
    for name in (joint for joint in truth.joints if joint in solved.joints):
        before, after = initial.joint(name), solved.joint(name)
        for parameter, value in truth.joints[name].items():
            pair = before.parameters[parameter] - value, after.parameters[parameter] - value
            if any(pair):
                errors.append(JointError(name, parameter, after.unit(parameter), *pair))
    return errors
