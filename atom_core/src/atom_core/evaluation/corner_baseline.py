"""A LiDAR against a camera by the corners of boards alone: PnP here, picked by hand there."""

from __future__ import annotations

from typing import List, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import rigid_fit
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

_TURNS = 4  # of a board onto itself, at most
_ROUNDS = 20


class CornerPairs(NamedTuple):
    """The corners of a board in one collection, from the top left on.

    Attributes:
        collection: its key.
        in_camera: (4, 3) [m].
        in_lidar: (4, 3) [m], perhaps beginning at another corner.
    """

    collection: str
    in_camera: np.ndarray
    in_lidar: np.ndarray


def corner_pairs(
    dataset: Dataset, camera: str, pattern: str, picked: Mapping[str, np.ndarray]
) -> List[CornerPairs]:
    """Return the corners of all collections that have them of both sensors.

    Args:
        dataset: with the camera's labels.
        camera: its name.
        pattern: the board.
        picked: (4, 3) corners in the LiDAR's frame, by collection.

    Raises:
        DatasetError: no collection has both.
    """
    rectangle = dataset.patterns[pattern].border.corners
    corners, observed = np.column_stack([rectangle, np.zeros(len(rectangle))]), Observed(dataset)
    found = []
    for key, in_lidar in picked.items():
        collection = dataset.collections.get(key)
        label = collection.labels.get((camera, pattern)) if collection else None
        if label is None or not label.detected:
            continue
        try:
            camera_T_pattern = observed.camera_T_pattern(DetectionKey(key, camera, pattern))
        except NotMeasurableError:
            continue
        found.append(CornerPairs(key, se3.apply(camera_T_pattern, corners), in_lidar))
    if not found:
        raise DatasetError(
            f"{dataset.source}: in no collection '{camera}' sees '{pattern}' where its corners are "
            f"picked; pick them with annotate_pattern_borders_in_lidar"
        )
    return found


def as_named(pairs: List[CornerPairs]) -> np.ndarray:
    """Return ``camera_T_lidar`` (4, 4) with the corners paired as they are named."""
    return rigid_fit(*_stacked(pairs))


def by_nearest(pairs: List[CornerPairs], camera_T_lidar: np.ndarray) -> np.ndarray:
    """Return ``camera_T_lidar`` (4, 4), with each board turned as it lies nearest.

    Args:
        pairs: the corners.
        camera_T_lidar: (4, 4) the start.
    """
    for _ in range(_ROUNDS):
        turned = [_turned(pair, camera_T_lidar) for pair in pairs]
        better = rigid_fit(*_stacked(turned))
        if np.allclose(better, camera_T_lidar, atol=1e-12):
            break
        camera_T_lidar = better
    return camera_T_lidar


def rms_m(pairs: List[CornerPairs], camera_T_lidar: np.ndarray) -> float:
    """Return how far corners are from one another [m], boards turned as they lie nearest."""
    turned = [_turned(pair, camera_T_lidar) for pair in pairs]
    in_lidar, in_camera = _stacked(turned)
    off = se3.apply(camera_T_lidar, in_lidar) - in_camera
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _turned(pair: CornerPairs, camera_T_lidar: np.ndarray) -> CornerPairs:
    """Return the pair, begun at the corner with which the boards lie nearest."""
    there = se3.apply(camera_T_lidar, pair.in_lidar)
    turns = [np.roll(there, turn, axis=0) - pair.in_camera for turn in range(_TURNS)]
    best = int(np.argmin([np.sum(off**2) for off in turns]))
    return pair._replace(in_lidar=np.roll(pair.in_lidar, best, axis=0))


def _stacked(pairs: List[CornerPairs]) -> Tuple[np.ndarray, np.ndarray]:
    return (
        np.concatenate([pair.in_lidar for pair in pairs]),
        np.concatenate([pair.in_camera for pair in pairs]),
    )
