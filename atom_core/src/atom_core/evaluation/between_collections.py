"""Two sensors, or one with itself, in different collections, by way of a board that stays.

What the source sees of a fixed board in one collection is carried through a fixed frame to the
target in another one. With a camera on an arm this is the spread of the board: how far apart the
collections put it, in pixels, millimetres and degrees.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import Collection, Dict, Iterator, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.board_turn import Seen, turn_beyond_noise
from atom_core.evaluation.hand_eye_views import depends_on_calibration
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.own_edges import own_edge_between, why_own
from atom_core.evaluation.pairs import Pair
from atom_core.evaluation.results import PairResult, summarised
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.modality import modality_named
from atom_core.model.sensor import RGB
from atom_core.model.transforms import Edge, chain_transform

_STILL_M, _STILL_RAD = 1e-3, 1e-3  # what a frame may move that is said to stay
MOST_PAIRS = 3000  # of collections: more are thinned out evenly, which no mean notices
_NOTHING_MOVES = (
    "neither '{sensor}' nor the board moves between the collections: any calibration gives the same"
)


def spreads(
    dataset: Dataset,
    observed: Observed,
    true: Optional[Dataset] = None,
    own: Collection[Edge] = (),
) -> List[PairResult]:
    """Return how far each camera's collections put the fixed boards apart.

    Args:
        dataset: the test set with the calibrated edges.
        observed: its labels.
        true: the test set with the true edges.
        own: edges that are the test set's own; nothing is measured across them.
    """
    (kind,) = (kind for kind in modality_named(RGB).pairs if kind.target == RGB)
    results = []
    for sensor in dataset.sensors.values():
        fixed = [
            pattern.name
            for pattern in dataset.patterns.values()
            if pattern.fixed
            and any((sensor.name, pattern.name) in c.labels for c in dataset.collections.values())
        ]
        if sensor.modality != RGB or not fixed:
            continue
        pair = Pair(kind, sensor.name, sensor.name)
        moving = [name for name in fixed if depends_on_calibration(dataset, sensor.name, name)]
        if not moving:
            why = _NOTHING_MOVES.format(sensor=sensor.name)
            results.append(PairResult(pair, None, skipped=why))
            continue
        results.append(between_collections(pair, observed, dataset, true, patterns=moving, own=own))
    return results


def between_collections(
    pair: Pair,
    observed: Observed,
    dataset: Dataset,
    true: Optional[Dataset] = None,
    *,
    patterns: Optional[List[str]] = None,
    frame: Optional[str] = None,
    own: Collection[Edge] = (),
) -> PairResult:
    """Measure a pair over all pairs of collections that see the same fixed board.

    Args:
        pair: of sensors; a sensor with itself takes each two collections once.
        observed: the labels.
        dataset: with the calibrated edges.
        true: with the true edges.
        patterns: only these; None: all that are fixed.
        frame: in which the board stays; None: its parent.
        own: edges that are the test set's own; nothing is measured across them.

    Returns:
        Figures by "a-b": the source's and the target's collection.

    Raises:
        DatasetError: no board is fixed, or there is no such frame.
    """
    names = [n for n in patterns or dataset.patterns if dataset.patterns[n].fixed]
    if not names:
        raise DatasetError(
            f"{dataset.source}: no pattern is fixed in its parent_link; without a board that "
            f"stays, collections cannot be compared"
        )
    if frame is not None and frame not in dataset.graph:
        raise DatasetError(f"{dataset.source}: frame '{frame}' is in no transform; check -wf")
    names, across = _apart(pair, dataset, names, frame, own)
    if not names and across is not None:
        return PairResult(pair, None, skipped=why_own(across))
    seen, why = _measured(pair, observed, dataset, names, frame)
    if not seen:
        reason = why or "no two collections in which they see the same fixed board"
        return PairResult(pair, None, skipped=reason)
    floor = None if true is None else _by_name(_measured(pair, observed, true, names, frame)[0])
    return PairResult(
        pair,
        summarised(_by_name(seen)),
        at_truth=summarised(floor) if floor else None,
        unseen=sum(e.unseen for e in seen.values()),
        turned_rad=turn_beyond_noise(observed, seen) if pair.source == pair.target else None,
    )


def moves_of_frame(dataset: Dataset, frame: str) -> List[str]:
    """Return a sentence on each fixed board that cannot stay in a frame, since its parent does not.

    Args:
        dataset: with a fixed board at least.
        frame: in which the boards are to stay; it is one of the dataset's.
    """
    sentences = []
    for pattern in dataset.patterns.values():
        if not pattern.fixed or pattern.parent_frame not in dataset.graph:
            continue
        chain = dataset.graph.chain(frame, pattern.parent_frame)
        placed = [c.transforms for c in dataset.collections.values()]
        whole = [edges for edges in placed if all(edge in edges for edge, _ in chain)]
        if not whole:
            continue
        poses = np.array([chain_transform(chain, edges) for edges in whole])
        shifts_m, turns_rad = se3.pose_differences(poses[0], poses)
        if np.max(shifts_m) > _STILL_M or np.max(turns_rad) > _STILL_RAD:
            sentences.append(
                f"pattern '{pattern.name}' is fixed in '{pattern.parent_frame}', which moves "
                f"against '{frame}' (-wf) by up to {1e3 * np.max(shifts_m):.3g} mm and "
                f"{np.rad2deg(np.max(turns_rad)):.2g} deg between the collections: the figures "
                f"have that motion in them; leave -wf out, unless that is asked"
            )
    return sentences


def _apart(
    pair: Pair,
    dataset: Dataset,
    patterns: List[str],
    frame: Optional[str],
    own: Collection[Edge],
) -> Tuple[List[str], Optional[Edge]]:
    """Return the patterns that no own edge parts from the sensors, and the last such edge."""
    kept, across = [], None
    for pattern in patterns:
        middle = frame or dataset.patterns[pattern].parent_frame
        frames = [dataset.sensors[name].frame for name in (pair.source, pair.target)]
        found = [own_edge_between(dataset, own, middle, end) for end in frames]
        across = next((edge for edge in found if edge is not None), across)
        if not any(found):
            kept.append(pattern)
    return kept, across


def _measured(
    pair: Pair, observed: Observed, dataset: Dataset, patterns: List[str], frame: Optional[str]
) -> Tuple[Dict[Seen, Errors], str]:
    """Return errors by both detections, and why the last was not measured that was not."""
    errors: Dict[Seen, Errors] = {}
    why = ""
    for pattern in patterns:
        middle = frame or dataset.patterns[pattern].parent_frame
        of_source = _poses(dataset, pair.source, pattern, middle)
        of_target = _poses(dataset, pair.target, pattern, middle)
        for a, b in _pairs_of_collections(pair, list(of_source), list(of_target)):
            target_T_source = se3.inverse(of_target[b]) @ of_source[a]
            there = DetectionKey(a, pair.source, pattern)
            here = DetectionKey(b, pair.target, pattern)
            try:
                errors[there, here] = pair.kind.measure(observed, there, here, target_T_source)
            except NotMeasurableError as reason:
                why = str(reason)
    return errors, why


def _by_name(seen: Mapping[Seen, Errors]) -> Dict[Tuple[str, str], Errors]:
    """Return errors by ("a-b", pattern)."""
    return {
        (f"{there.collection}-{here.collection}", there.pattern): errors
        for (there, here), errors in seen.items()
    }


def _poses(dataset: Dataset, sensor: str, pattern: str, middle: str) -> Dict[str, np.ndarray]:
    """Return ``middle_T_sensor`` (4, 4) of the collections in which a sensor sees a pattern."""
    graph, frame = dataset.graph, dataset.sensors[sensor].frame
    return {
        key: pose(collection, graph, middle, frame)
        for key, collection in dataset.collections.items()
        if (sensor, pattern) in collection.labels
    }


def _pairs_of_collections(
    pair: Pair, of_source: List[str], of_target: List[str]
) -> Iterator[Tuple[str, str]]:
    if pair.source == pair.target:
        every = list(combinations(of_source, 2))
    else:
        every = list(product(of_source, of_target))
    count = min(len(every), MOST_PAIRS)
    for i in np.linspace(0, len(every) - 1, count).astype(int) if every else ():
        yield every[i]
