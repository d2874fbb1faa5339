"""What a calibration believed of its rig, and a test set says otherwise.

A calibration holds together with what it took for granted: the lens of a camera, the edges between
a sensor and the world that nobody estimated, the sizes of a board. A test set that has others
measures something else.
"""

from __future__ import annotations

from typing import List

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.model.believed_edges import edges_apart
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.pattern import Pattern

# Of the focal length: intrinsics that a calibration has estimated differ less from those given.
_SAME_LENS = 0.02
_CORNER_M, _BORDER_M = 0.0005, 0.002  # places of corners and of a border that are one board's


def rig_differences(train: Dataset, test: Dataset) -> List[Caveat]:
    """Return which sensors of a test set stand or see otherwise than when they were calibrated.

    Args:
        train: the calibrated dataset.
        test: the dataset to measure on.
    """
    return [*_of_edges(train, test), *_of_lenses(train, test)]


def board_differences(train: Dataset, test: Dataset) -> List[str]:
    """Return a sentence for each board of the test set that the train file has with other sizes.

    It may be another board, which is no fault.

    Args:
        train: the calibrated dataset.
        test: the dataset to measure on.
    """
    return [
        f"board '{name}' has {_sizes(pattern)} in the test set and {_sizes(train.patterns[name])} "
        f"in the train file: if it is one board, one of the two is wrong, and the sensors disagree "
        f"for that; measure it, and collect what was collected with the wrong sizes again"
        for name, pattern in test.patterns.items()
        if name in train.patterns and not _is_one_board(pattern, train.patterns[name])
    ]


def _is_one_board(one: Pattern, other: Pattern) -> bool:
    if one.corners_by_id.shape != other.corners_by_id.shape:
        return False
    corners, borders = (
        (one.corners_by_id, other.corners_by_id),
        (one.border.corners, other.border.corners),
    )
    return np.allclose(*corners, rtol=0.0, atol=_CORNER_M, equal_nan=True) and np.allclose(
        *borders, rtol=0.0, atol=_BORDER_M
    )


def _sizes(pattern: Pattern) -> str:
    """Return the sizes of a board in words."""
    there = pattern.corners_by_id[np.all(np.isfinite(pattern.corners_by_id), axis=1)]
    (width, height), border = (1e3 * np.ptp(p, axis=0) for p in (there, pattern.border.corners))
    return (
        f"{len(there)} corners over {width:.4g} x {height:.4g} mm and a border of "
        f"{border[0]:.4g} x {border[1]:.4g} mm"
    )


def _of_edges(train: Dataset, test: Dataset) -> List[Caveat]:
    held = {edge for c in train.collections.values() for edge in c.transforms}
    # A joint that stood still in each may stand elsewhere in the other.
    joints = {joint.edge for d in (train, test) for joint in d.joints.values()}
    still = [e for e in held - joints if train.edge_types.get(e) != MULTIPLE]
    return [
        Caveat(
            tuple(name for name in apart.sensors if name in train.sensors),
            f"the test set has '{apart.edge}' {apart.words} from where the train file has it, and "
            f"the calibration belongs to the latter",
            "collect both with the same description and configuration, or calibrate anew",
        )
        for apart in edges_apart(test, {edge: train.first_value(edge) for edge in still})
    ]


def _of_lenses(train: Dataset, test: Dataset) -> List[Caveat]:
    found = []
    for name, sensor in test.sensors.items():
        known = train.sensors[name].camera if name in train.sensors else None
        if known is None or sensor.camera is None:
            continue
        said = _another_lens(known, sensor.camera)
        if said:
            remedy = (
                "take both with one zoom and one camera_info, or calibrate anew; nothing is wrong "
                "where the calibration itself has estimated the lens by so much"
            )
            found.append(Caveat((name,), f"{said}; the train file's is used", remedy))
    return found


def _another_lens(train: Camera, test: Camera) -> str:
    """Return how the test set's camera differs from the calibrated one; empty: hardly."""
    apart = np.abs(test.K - train.K) / train.K[0, 0]
    if np.max(apart) <= _SAME_LENS:
        return ""
    of_train, of_test = (
        f"fx {c.K[0, 0]:.1f}, cx {c.K[0, 2]:.1f}, cy {c.K[1, 2]:.1f} px" for c in (train, test)
    )
    return f"the test set gives it another lens ({of_test}) than the train file ({of_train})"
