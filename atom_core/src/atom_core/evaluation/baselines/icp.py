"""ICP of whole clouds, for every pair of LiDARs and of a LiDAR with a depth camera.

Point to point, within 0.1 m, as the evaluation of Rato et al., "A sensor-to-pattern calibration
framework for multi-modal industrial collaborative cells", J. Manufacturing Systems 64 (2022), has
it: collection by collection, from two starts, and of all collections the average or the best.
Besl, McKay, "A method for registration of 3-D shapes", PAMI 14 (1992).
"""

from __future__ import annotations

from itertools import combinations
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from scipy.spatial import cKDTree

from atom_core.evaluation.baselines.links import (
    Link,
    LinkedRig,
    board_middle,
    linked_rig,
    motion_between,
    move_against_each_other,
    seen_by_both,
    sensors_of,
)
from atom_core.evaluation.hand_eye_views import mean_pose
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.sensor import DEPTH, LIDAR3D

ICP = "icp"
INITIAL, ALIGNED = "initial", "aligned"
AVERAGE, BEST, ALL = "average", "best", "all"
METHODS = (
    *(f"icp_{start}_{choice}" for start in (INITIAL, ALIGNED) for choice in (AVERAGE, BEST)),
    f"icp_{ALIGNED}_{ALL}",
)
REACH_M = 0.1  # farther points are no counterparts
_MOST_POINTS = 4000  # of a source cloud: evenly thinned beyond; the target's are all taken
_ITERATIONS = 100
_SETTLED = 1e-6  # change of the error and of the share of counterparts, as parts
_FEWEST_POINTS = 10
_NO_INITIAL = "give the dataset before it was calibrated as --initial"


class Registered(NamedTuple):
    """A result of ICP.

    Attributes:
        target_T_source: (4, 4).
        rms_m: of the distances between counterparts [m].
    """

    target_T_source: np.ndarray
    rms_m: float


class Clouds(NamedTuple):
    """One collection's clouds: the source's points (n, 3) [m], the target's as a tree."""

    source: np.ndarray
    target: cKDTree


def icp_baselines(dataset: Dataset, initial: Optional[Dataset] = None) -> List[LinkedRig]:
    """Solve every pair in the paper's four variants, and once over all collections.

    ``initial`` begins where the dataset has the sensors before calibration, ``aligned`` where the
    middles of the boards that both sensors see lie on one another, as a person would put them.

    Args:
        dataset: with the clouds and labels.
        initial: before it was calibrated; None: there are no variants from there.

    Returns:
        One for each of ``METHODS``.
    """
    links: Dict[str, List[Link]] = {method: [] for method in METHODS}
    unsolved: Dict[str, Dict[Tuple[str, str], str]] = {method: {} for method in METHODS}
    for source, target in _pairs(dataset):
        for method, found in _of_pair(dataset, initial, source, target).items():
            if isinstance(found, Link):
                links[method].append(found)
            else:
                unsolved[method][source, target] = found
    return [linked_rig(m, dataset, links[m], unsolved[m]) for m in METHODS]


def _pairs(dataset: Dataset) -> List[Tuple[str, str]]:
    lidars, depth = sensors_of(dataset, LIDAR3D), sensors_of(dataset, DEPTH)
    return [*combinations(lidars, 2), *((name, other) for name in lidars for other in depth)]


def _of_pair(
    dataset: Dataset, initial: Optional[Dataset], source: str, target: str
) -> Dict[str, Union[Link, str]]:
    """Return for each method a link, or a text: why there is none."""
    if move_against_each_other(dataset, source, target):
        return dict.fromkeys(METHODS, "they move against each other")
    clouds = _clouds(dataset, source, target)
    if not clouds:
        return dict.fromkeys(METHODS, "no collection has data of both")
    starts = {
        INITIAL: None if initial is None else _initial_pose(initial, source, target),
        ALIGNED: aligned_by_boards(dataset, source, target),
    }
    missing = {INITIAL: _NO_INITIAL, ALIGNED: "they share too few boards to be put together"}
    found: Dict[str, Union[Link, str]] = {}
    for name, start in starts.items():
        of_start = [method for method in METHODS if name in method]
        if start is None:
            found.update(dict.fromkeys(of_start, missing[name]))
            continue
        each = [registered([pair], start) for pair in clouds]
        known = [r for r in each if r is not None]
        if not known:
            why = f"no counterparts within {REACH_M:g} m"
            found.update(dict.fromkeys(of_start, why))
            continue
        best = min(known, key=lambda r: r.rms_m)
        mean = mean_pose([r.target_T_source for r in known])
        found[f"icp_{name}_{AVERAGE}"] = Link(source, target, mean, len(known))
        found[f"icp_{name}_{BEST}"] = Link(source, target, best.target_T_source, 1)
        if name == ALIGNED:
            whole = registered(clouds, start)
            found[f"icp_{name}_{ALL}"] = (
                f"too few counterparts within {REACH_M:g} m"
                if whole is None
                else Link(source, target, whole.target_T_source, len(clouds))
            )
    return found


def _clouds(dataset: Dataset, source: str, target: str) -> List[Clouds]:
    found = []
    for key in dataset.collections:
        if not all(dataset.data.has_data(key, name) for name in (source, target)):
            continue
        there, here = (whole_cloud(dataset, key, name) for name in (source, target))
        if min(len(there), len(here)) >= _FEWEST_POINTS:
            thinned = there[:: max(-(-len(there) // _MOST_POINTS), 1)]
            found.append(Clouds(thinned, cKDTree(here)))
    return found


def whole_cloud(dataset: Dataset, collection: str, sensor: str) -> np.ndarray:
    """Return all points (n, 3) [m] that a range sensor has in a collection, in its frame."""
    data = dataset.data.read(collection, sensor)
    camera = dataset.sensors[sensor].camera
    if camera is None:
        return data[np.all(np.isfinite(data), axis=1)]
    row, column = np.nonzero(np.isfinite(data) & (data > 0.0))
    rays = camera.normalise(np.column_stack([column, row]).astype(float))
    depth = data[row, column][:, None]
    return np.column_stack([rays, np.ones(len(rays))]) * depth


def _initial_pose(initial: Dataset, source: str, target: str) -> Optional[np.ndarray]:
    if source not in initial.sensors or target not in initial.sensors:
        return None
    first = next(iter(initial.collections.values()))
    frames = initial.sensors[target].frame, initial.sensors[source].frame
    return pose(first, initial.graph, *frames)


def aligned_by_boards(dataset: Dataset, source: str, target: str) -> Optional[np.ndarray]:
    """Return ``target_T_source`` (4, 4) that puts the boards' middles together; None: too few."""
    both = seen_by_both(dataset, source, target)
    middles = [(board_middle(dataset, a), board_middle(dataset, b)) for a, b in both]
    known = [(a, b) for a, b in middles if a is not None and b is not None]
    return motion_between(*(np.array(side) for side in zip(*known))) if known else None


def registered(clouds: Sequence[Clouds], start: np.ndarray) -> Optional[Registered]:
    """Move the sources' points onto the targets', of all collections at once.

    Args:
        clouds: by collection.
        start: ``target_T_source`` (4, 4).

    Returns:
        None where fewer than three points have a counterpart within ``REACH_M``.
    """
    now, following, before = start, start, (np.inf, np.inf)
    total = sum(len(pair.source) for pair in clouds)
    rms = np.inf
    for _ in range(_ITERATIONS):
        now = following
        sources, targets, squares = [], [], 0.0
        for pair in clouds:
            distance, index = pair.target.query(
                se3.apply(now, pair.source), distance_upper_bound=REACH_M
            )
            near = np.isfinite(distance)
            sources.append(pair.source[near])
            targets.append(pair.target.data[index[near]])
            squares += float(np.sum(distance[near] ** 2))
        count = sum(len(points) for points in sources)
        moved = motion_between(np.concatenate(sources), np.concatenate(targets)) if count else None
        if moved is None:
            return None
        rms, share = float(np.sqrt(squares / count)), count / total
        if abs(before[0] - rms) < _SETTLED * rms and abs(before[1] - share) < _SETTLED:
            break
        following, before = moved, (rms, share)
    return Registered(now, rms)
