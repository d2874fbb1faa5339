"""Every pair of sensors by itself, from the board's pose or plane and outline: no joint solve.

What tools for one camera and one LiDAR do: the board's pose comes from one sensor alone (a camera:
planar PnP; a range sensor: plane and outline of its label), and the other sensor is moved until its
points lie on that plane and its limit points on that outline, over all collections. Two cameras:
the mean of what each image pair says.
"""

from __future__ import annotations

from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from scipy.optimize import least_squares

from atom_core.evaluation.baselines.links import (
    FEWEST,
    Link,
    LinkedRig,
    board_by_range,
    board_middle,
    linked_rig,
    motion_between,
    move_against_each_other,
    seen_by_both,
    usual_pose,
)
from atom_core.evaluation.board_pose import moved
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.pairs import pairs_of
from atom_core.geometry import se3
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

PAIRWISE = "pairwise"
_POINTS = 200  # of a label, evenly taken
_ROBUST_M = 0.02  # farther residuals weigh less (soft L1)
_ITERATIONS = 100


class _Board(NamedTuple):
    """A board in the target, and the source's points on it."""

    board_T_target: np.ndarray
    inside: np.ndarray
    limit: np.ndarray
    border: Rectangle


def pairwise_baseline(dataset: Dataset) -> LinkedRig:
    """Solve every pair that shares boards, each by itself.

    Args:
        dataset: with the data and labels.
    """
    observed, links = Observed(dataset), []
    unsolved: Dict[Tuple[str, str], str] = {}
    for source, target in _pairs(dataset):
        if move_against_each_other(dataset, source, target):
            unsolved[source, target] = "they move against each other"
            continue
        found = _link(dataset, observed, source, target)
        if isinstance(found, Link):
            links.append(found)
        else:
            unsolved[source, target] = found
    return linked_rig(PAIRWISE, dataset, links, unsolved)


def _pairs(dataset: Dataset) -> List[Tuple[str, str]]:
    """Return each two sensors once that have a kind of pair, the source first."""
    pairs = (pair for pair in pairs_of(dataset.sensors) if not pair.reverse)
    return list(dict.fromkeys((pair.source, pair.target) for pair in pairs))


def _link(dataset: Dataset, observed: Observed, source: str, target: str) -> Union[Link, str]:
    """Return the link of a pair, or a text: why there is none."""
    both = seen_by_both(dataset, source, target)
    if not both:
        return "they share no board"
    if dataset.sensors[source].kind.measures_range:
        return _by_points(dataset, observed, both)
    poses = []
    for of_source, of_target in both:
        in_source = _pose_of_board(dataset, observed, of_source)
        in_target = _pose_of_board(dataset, observed, of_target)
        if in_source is not None and in_target is not None:
            poses.append(in_target @ se3.inverse(in_source))
    if not poses:
        return "their corners do not determine a board's pose in both"
    return Link(source, target, usual_pose(poses), len(poses))


def _pose_of_board(dataset: Dataset, observed: Observed, key: DetectionKey) -> Optional[np.ndarray]:
    """Return ``sensor_T_pattern`` (4, 4) by one sensor alone; None where it does not tell."""
    if dataset.sensors[key.sensor].kind.measures_range:
        return board_by_range(dataset, key)
    try:
        return observed.camera_T_pattern(key)
    except NotMeasurableError:
        return None


def _by_points(
    dataset: Dataset, observed: Observed, both: List[Tuple[DetectionKey, DetectionKey]]
) -> Union[Link, str]:
    boards: List[_Board] = []
    middles: List[Tuple[np.ndarray, np.ndarray]] = []
    for of_source, of_target in both:
        target_T_board = _pose_of_board(dataset, observed, of_target)
        middle = board_middle(dataset, of_source)
        if target_T_board is None or middle is None:
            continue
        border = dataset.patterns[of_target.pattern].border
        points = observed.points(of_source)
        thinned = points.inside[:: max(len(points.inside) // _POINTS, 1)]
        limit = points.limit[:: max(len(points.limit) // _POINTS, 1)]
        boards.append(_Board(se3.inverse(target_T_board), thinned, limit, border))
        in_target = se3.apply(target_T_board, border.centre_in_pattern[None])[0]
        middles.append((middle, in_target))
    if len(boards) < FEWEST:
        words = " and ".join(_told_by(dataset, observed, keys) for keys in zip(*both))
        return f"{len(boards)} boards that both tell; it takes {FEWEST} ({words})"
    start = motion_between(*(np.array(side) for side in zip(*middles)))
    if start is None:
        return "the boards' middles lie on a line"
    step = least_squares(
        _residuals(boards, start),
        np.zeros(6),
        loss="soft_l1",
        f_scale=_ROBUST_M,
        x_scale=np.array([0.1] * 3 + [0.1] * 3),
        max_nfev=_ITERATIONS,
    ).x
    of_source, of_target = both[0]
    return Link(of_source.sensor, of_target.sensor, moved(start, step), len(boards))


def _told_by(dataset: Dataset, observed: Observed, keys: Sequence[DetectionKey]) -> str:
    """Return how many boards a sensor's own labels tell, and whether its data files are absent."""
    told = sum(_pose_of_board(dataset, observed, key) is not None for key in keys)
    is_range = dataset.sensors[keys[0].sensor].kind.measures_range
    absent = is_range and not any(dataset.data.has_data(k.collection, k.sensor) for k in keys)
    why = ", its data files are absent" if absent else ""
    return f"'{keys[0].sensor}' by itself tells {told} of {len(keys)}{why}"


def _residuals(boards: List[_Board], start: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function step (6,) -> distances to planes and outlines (n,) [m]."""

    def residuals(step: np.ndarray) -> np.ndarray:
        target_T_source = moved(start, step)
        found = []
        for board in boards:
            board_T_source = board.board_T_target @ target_T_source
            found.append(se3.apply(board_T_source, board.inside)[:, 2])
            limit = se3.apply(board_T_source, board.limit)[:, :2]
            found.append(board.border.signed_distance(limit)[0])
        return np.concatenate(found)

    return residuals
