"""How far frames are from where they truly are, seen from another frame, by collection."""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose


class FrameError(NamedTuple):
    """The error of a frame's pose, in that frame's axes.

    Attributes:
        shift_m: (3,).
        turn_rad: (3,), a rotation vector, or roll, pitch, yaw.
    """

    shift_m: np.ndarray
    turn_rad: np.ndarray

    @property
    def translation_m(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.shift_m))


def frame_errors(found: Dataset, true: Dataset, target: str, frame: str) -> Dict[str, np.ndarray]:
    """Return ``found_T_true`` (4, 4) of a frame by collection, seen from a target frame.

    Args:
        found: with the calibrated edges.
        true: the same collections with the true ones.
        target: the frame from which both are seen.
        frame: whose pose.

    Raises:
        DatasetError: a frame is in no transform.
    """
    graph = found.graph
    for name in (target, frame):
        if name not in graph:
            raise DatasetError(f"{found.source}: frame '{name}' is in no transform of the dataset")
    errors = {}
    for key, collection in found.collections.items():
        target_T_found = pose(collection, graph, target, frame)
        target_T_true = pose(true.collections[key], graph, target, frame)
        errors[key] = se3.inverse(target_T_found) @ target_T_true
    return errors


def calibrated_frames(dataset: Dataset) -> List[str]:
    """Return the children of the edges of sensors and additional tfs, each once."""
    return list(dict.fromkeys(edge.child for edge in dataset.calibrated_edges))


def by_rotation_vector(found_T_true: np.ndarray) -> FrameError:
    """Return the parts of a difference (4, 4), its rotation as a vector."""
    turn = se3.rotation_vector_from_rotation(found_T_true[:3, :3])
    return FrameError(found_T_true[:3, 3], turn)


def by_angles(found_T_true: np.ndarray) -> FrameError:
    """Return the parts of a difference (4, 4), its rotation as roll, pitch, yaw."""
    return FrameError(found_T_true[:3, 3], se3.rpy_from_rotation(found_T_true[:3, :3]))


def row_of(error: FrameError, rotation_rad: float) -> List[float]:
    """Return ATOM's eight columns: both sizes, then the components."""
    parts = [*error.shift_m, *error.turn_rad]
    return [error.translation_m, rotation_rad, *(float(value) for value in parts)]


def mean_rows(rows: Sequence[Sequence[float]]) -> List[float]:
    """Return the mean of each column."""
    return [float(value) for value in np.mean(np.array(rows), axis=0)]
