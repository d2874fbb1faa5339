"""Whether the sensors hang together through the boards they share, and what ties them to world."""

from __future__ import annotations

from typing import Dict, Hashable, Iterable, List, Sequence, Tuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from atom_core.errors import CalibrationError, quoted
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import chain_transform
from atom_core.problem.builder import FreeEdges
from atom_core.problem.measurements import Measurement

_STILL_M, _STILL_RAD = 1e-4, 1e-4  # encoders and a localisation that stand still report less


def components(dataset: Dataset, measurements: Sequence[Measurement]) -> List[List[str]]:
    """Return the groups of sensors that shared boards connect, largest first."""
    if not measurements:
        return []
    number: Dict[Hashable, int] = {}  # of each edge of sensors and each board
    ends = [
        [number.setdefault(node, len(number)) for node in _nodes(dataset, m)] for m in measurements
    ]
    links = coo_matrix((np.ones(len(ends)), np.transpose(ends)), shape=2 * (len(number),))
    _, group_of = connected_components(links, directed=False)
    groups: Dict[int, List[str]] = {}
    for sensor in dataset.sensors.values():
        node = ("edge", sensor.edge)
        if node in number:
            groups.setdefault(group_of[number[node]], []).append(sensor.name)
    return sorted(groups.values(), key=lambda group: (-len(group), group))


def _nodes(dataset: Dataset, m: Measurement) -> Tuple[Hashable, Hashable]:
    """Return what a measurement connects: an edge of sensors, and a board."""
    board = dataset.patterns[m.key.pattern].board_key(m.key.collection)
    return ("edge", dataset.sensors[m.key.sensor].edge), ("board", board)


def check_connected(dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges) -> None:
    """Refuse sensors without a detection, and groups that nothing connects.

    Raises:
        CalibrationError: naming the sensors, or the components.
    """
    seen = {m.key.sensor for m in measurements}
    blind = [name for name in dataset.sensors if name not in seen]
    if blind:
        detected = {key.sensor for key, _ in dataset.detections()}
        alone = [name for name in blind if name in detected]
        what = (
            f"sensor {quoted(alone)} sees no board together with another sensor, so nothing ties "
            f"it to the rig; {_remedy(dataset, alone)}"
            if alone
            else f"sensor {quoted(blind)} has no detection in any collection used; collect again"
        )
        several = len(dataset.sensors) > 1
        raise CalibrationError(f"{what}, or leave it out with -ssf" if several else what)
    if free.anchor_patterns:
        return
    groups = components(dataset, measurements)
    if len(groups) > 1 and any(_is_loose(dataset, measurements, free, group) for group in groups):
        named = "; ".join(f"{{{', '.join(group)}}}" for group in groups)
        raise CalibrationError(
            f"the sensors are not connected through shared boards: components {named}; add "
            f"collections in which sensors of different components see the board together, or "
            f"select one component with -ssf"
        )


def _is_loose(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges, group: Sequence[str]
) -> bool:
    """Tell whether neither a held sensor nor what moves tells where a group of sensors is."""
    if set(free.anchored_sensors) & set(group):
        return False
    keys = [m.key for m in measurements if m.key.sensor in group]
    collections = sorted({key.collection for key in keys})
    return nothing_moves(dataset, group, {key.pattern for key in keys}, collections)


def _remedy(dataset: Dataset, alone: Sequence[str]) -> str:
    """Return what ties sensors to the rig that see boards by themselves."""
    single = len(dataset.sensors) == 1
    several = (
        "use a second sensor that sees the boards, too"
        if single
        else "collect boards that are seen by both"
    )
    loose = [pattern.name for pattern in dataset.patterns.values() if not pattern.fixed]
    parents = [dataset.patterns[name].parent_frame for name in loose]
    carriers, keys = [dataset.sensors[name].edge.parent for name in alone], [*dataset.collections]
    if all(stand_still(dataset, [carrier, *parents], keys) for carrier in carriers):
        return several
    still = f"if pattern {quoted(loose)} does not move in the frame that it is attached to"
    said = f"{still} while the robot moves, set `fixed: true` of it in the configuration"
    return said if single else f"{several}; {said}"


def nothing_moves(
    dataset: Dataset,
    sensors: Iterable[str],
    patterns: Iterable[str],
    collections: Sequence[str],
) -> bool:
    """Tell whether nothing moves between what carries these sensors and the fixed ones of boards.

    What carries all of them about does not count, nor the parent of a board that is elsewhere in
    each collection.
    """
    fixed = [dataset.patterns[name] for name in patterns if dataset.patterns[name].fixed]
    frames = [dataset.sensors[sensor].edge.parent for sensor in sensors]
    return stand_still(dataset, frames + [pattern.parent_frame for pattern in fixed], collections)


def stand_still(dataset: Dataset, frames: Sequence[str], collections: Iterable[str]) -> bool:
    """Tell whether frames stand still to each other, but for the noise of an encoder."""
    used = [dataset.collections[key].transforms for key in collections]
    for frame in dict.fromkeys(frames):
        chain = dataset.graph.chain(frames[0], frame)
        whole = [tfs for tfs in used if all(step.edge in tfs for step in chain)]
        poses = np.array([chain_transform(chain, transforms) for transforms in whole])
        if len(poses) == 0:
            continue
        moved_m, turned_rad = se3.pose_differences(poses[0], poses)
        if np.max(moved_m) > _STILL_M or np.max(turned_rad) > _STILL_RAD:
            return False
    return True
