"""Whether a rig stands as it was calibrated, asked with two or three new boards.

The sensors start where the description has them and are calibrated anew with the new boards alone.
How far each one comes out elsewhere is compared with how exactly the new boards tell that and how
exactly the description was known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Dict, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.refine.rejection import Rejected
from atom_core.errors import AtomError, CalibrationError
from atom_core.evaluation.board_agreement import Disagreement, disagreement
from atom_core.evaluation.changes import TOLD_M, TOLD_RAD, limit_of
from atom_core.evaluation.drift_question import Question, scatter_of, with_common_scatter
from atom_core.evaluation.edge_errors import PoseError, pose_error
from atom_core.evaluation.edge_spread import edge_spread, known_spread
from atom_core.evaluation.rarity import found_from, rarity
from atom_core.evaluation.spreads import NO_SPREAD, NUMBERS, Spread, joint_covariance
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.model_errors import ErrorPriors
from atom_core.solvers.base import FAILED, NOT_CONVERGED

FEWEST_BOARDS = 2
FEWEST_ALONE = 3  # sensors, for that each can be asked for while all others are held
LEAST_M, LEAST_RAD = 0.0005, float(np.radians(0.02))  # a smaller change is none, however sure
# By how much detections of a range sensor vary beyond noise is estimated itself (`scatter_of`).
# A detection has six numbers, which are not independent; it counts as three. Unknown: ten of them.
_NUMBERS_OF_A_DETECTION, _DETECTIONS = 3, 10


class EdgeDrift(NamedTuple):
    """How far an edge is from its description.

    Attributes:
        edge: parent and child.
        sensors: that stand on it.
        change: found minus described, along and about the parent's axes.
        chi_square: of six numbers, as rare as the change is if nothing moved (`rarity`), by the
            joint covariance of the calibration and of the new boards as its detections varied; of
            three sensors or more, while all others are held.
        moved: beyond the limit, by no trifle, and where the boards tell little by more than they
            would notice.
        beyond_detections: beyond it even where detections of the new boards are off as a whole, as
            `calibrate` assumes of a few boards.
        beyond_usual: beyond it even with the errors that sensors and boards usually have, which
            move a sensor where the boards stand elsewhere than before.
        found_m, found_rad: the smallest shift without a turn, and turn without a shift, in the
            worst direction, that is noticed in 95 % of cases.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    change: PoseError
    chi_square: float
    moved: bool
    beyond_detections: bool
    found_m: float
    found_rad: float
    beyond_usual: bool = True

    @property
    def told(self) -> bool:
        """Whether the new boards suffice to notice what matters."""
        return self.found_m <= TOLD_M and self.found_rad <= TOLD_RAD


@dataclass(frozen=True)
class Drift:
    """What new boards say of a rig.

    Attributes:
        reference: the sensors that were held, against which the others are told.
        edges: all others.
        limit: of the chi-squares.
        boards: how many collections were used.
        untold: sensors of which the new boards say nothing.
        contradiction: what contradicts itself among the new boards; None: nothing does.
        left_out: new labels that contradict the others, wherever the sensors stand.
        disagreement: of the new boards on a sensor that seems to have moved; then none is called
            so.
        rests_on: the only collection without which nothing is seen to have moved; None: there is
            none, or several.
        caveats: what puts sensors in doubt, whatever the new boards say; whoever asks adds it.
    """

    reference: Tuple[str, ...]
    edges: Tuple[EdgeDrift, ...]
    limit: float
    boards: int
    untold: Tuple[str, ...]
    contradiction: Optional[str] = None
    left_out: Tuple[Rejected, ...] = ()
    disagreement: Optional[Disagreement] = None
    rests_on: Optional[str] = None
    caveats: Tuple[Caveat, ...] = ()

    @property
    def moved(self) -> Tuple[EdgeDrift, ...]:
        """The edges that moved."""
        return tuple(edge for edge in self.edges if edge.moved)

    @property
    def contested(self) -> bool:
        """Whether the new boards say different things, so that nothing is told."""
        return self.disagreement is not None or (self.contradiction is not None and not self.moved)

    def without_moved(self, of_boards: Disagreement) -> Drift:
        """Return the same, where boards disagree on what seems to have moved."""
        edges = tuple(edge._replace(moved=False) for edge in self.edges)
        return replace(self, edges=edges, disagreement=of_boards)


def drift(
    dataset: Dataset,
    described: Mapping[Edge, np.ndarray],
    spreads: Mapping[Edge, Spread],
    known_errors: ErrorPriors = MappingProxyType({}),
    moving: Mapping[str, Tuple[float, float]] = MappingProxyType({}),
) -> Drift:
    """Tell which sensors moved since a rig was calibrated.

    Each sensor is asked for while all others are held, which finds the smallest moves. Who moved is
    then told with all of them free: where others seem to have moved against the one that is held,
    each sensor is held in turn, and the fewest that explain it are blamed.

    Args:
        dataset: new boards; its own values of the sensors' edges do not count.
        described: ``parent_T_child`` (4, 4) of the sensors' edges.
        spreads: how exactly they are known, turns [rad] and shifts [m] in the parent's axes.
        known_errors: of sensors and boards, as the rig's calibration found them.
        moving: by the frame of a moving part, how far its poses are off [m, rad], likewise.

    Raises:
        CalibrationError: fewer than two collections, or the new boards tie nothing.
    """
    used = {key.collection for key, _ in dataset.detections()}
    if len(used) < FEWEST_BOARDS:
        raise CalibrationError(
            f"{dataset.source}: {len(used)} collection(s) with a board; whether the rig has moved "
            f"takes {FEWEST_BOARDS} or more"
        )
    edges = {edge: described[edge] for edge in dataset.calibrated_edges if edge in described}
    standing = dataset.with_transforms(dict.fromkeys(dataset.collections, edges))
    asked = Question(standing, with_common_scatter(standing, spreads), known_errors, moving)
    first = _drift(asked, ())
    asked = asked.without(first.left_out)
    found = replace(_told_apart(asked, first), left_out=first.left_out)
    of_boards = disagreement(asked, [edge.edge for edge in found.moved])
    if of_boards is not None:
        return found.without_moved(of_boards)
    return replace(found, rests_on=_rests_on(asked) if found.moved else None)


def _rests_on(asked: Question) -> Optional[str]:
    """Return the only collection without which nothing is seen to have moved, if there is one."""
    keys = list(asked.standing.collections)
    if len(keys) <= FEWEST_BOARDS:
        return None
    needed = []
    for key in keys:
        fewer = asked.without_collection(key)
        try:
            still = _told_apart(fewer, _drift(fewer, ())).moved
        except AtomError:
            continue
        needed += [] if still else [key]
    return needed[0] if len(needed) == 1 else None


def _told_apart(asked: Question, first: Drift) -> Drift:
    """Return who moved, by what each sensor alone and all together tell."""
    edges = list(asked.standing.sensor_edges)
    if len(edges) < FEWEST_ALONE:  # two sensors: holding one is all that can be done
        return _blamed(asked, first)
    limit = limit_of(len(edges))
    alone, others_disagree = _each_alone(asked, edges, limit)
    suspects = [edge for edge, found in alone.items() if found.moved]
    if not suspects and not others_disagree:
        return _asked_alone(first, alone, limit, ())
    blamed = _blamed(asked, first)
    if blamed.moved or not suspects:
        return _asked_alone(blamed, alone, limit, [edge.edge for edge in blamed.moved])
    most = max(suspects, key=lambda edge: alone[edge].chi_square)
    if most not in [edge.edge for edge in first.edges]:  # the one that is held
        free = next(n for n, s in asked.standing.sensors.items() if s.edge != most)
        first = _drift(asked, (free,))
    return _asked_alone(first, alone, limit, (most,))


def _blamed(asked: Question, first: Drift) -> Drift:
    """Return what the fewest moved sensors explain, whoever is held."""
    if len(first.moved) < 2:
        return first
    others = [name for name in asked.standing.sensors if name not in first.reference]
    rivals = [found for found in (_or_none(asked, name) for name in others) if found]
    fewer = [found for found in rivals if found.moved and len(found.moved) < len(first.moved)]
    return min(fewer, key=lambda found: (len(found.moved), _worst_left(found)), default=first)


def _each_alone(
    asked: Question, edges: Sequence[Edge], limit: float
) -> Tuple[Dict[Edge, EdgeDrift], bool]:
    """Return how far each sensor is while all others are held, and whether any others disagree.

    Then the others place the boards, and a small move shows that would be lost among many numbers.
    Where they disagree on the boards, as with one of them that moved, nothing is told of the one.
    """
    standing, spreads, found = asked.standing, asked.spreads, {}
    others_disagree = False
    for edge in edges:
        held = [name for name, sensor in standing.sensors.items() if sensor.edge != edge]
        try:
            solved = calibrate(standing, asked.options(held))
        except AtomError:
            continue
        if solved.status in (FAILED, NOT_CONVERGED):
            continue
        if solved.status == INCONSISTENT:
            others_disagree = True
        elif edge_spread(solved, edge) is not None:
            known = spreads.get(edge, NO_SPREAD)
            if not np.any(known.of_model):
                known = _of_the_held(spreads)
            found[edge] = _edge_drift(solved, standing, edge, known, limit)
    return found, others_disagree


def _of_the_held(spreads: Mapping[Edge, Spread]) -> Spread:
    """Return how exactly a sensor that was held is known in relation to the others.

    As the one of them that is known best, in the mean of all directions.
    """
    others = [spread for spread in spreads.values() if np.any(spread.of_model)]
    if not others:
        return NO_SPREAD
    found = []
    for matrices in zip(*(spread[:2] for spread in others)):
        whole = np.zeros((NUMBERS, NUMBERS))
        for part in (ROTATION, TRANSLATION):
            least = min(float(np.trace(matrix[part, part])) / 3.0 for matrix in matrices)
            whole[part, part] = least * np.eye(3)
        found.append(whole)
    return Spread(found[0], found[1], min(spread.detections for spread in others))


def _asked_alone(
    found: Drift, alone: Mapping[Edge, EdgeDrift], limit: float, moved: Sequence[Edge]
) -> Drift:
    """Return a result with the figures of each edge alone, and who is called moved."""
    edges = []
    for edge in found.edges:
        own = alone.get(edge.edge)
        marked = edge._replace(moved=edge.edge in moved)
        if own is not None:
            marked = marked._replace(
                chi_square=own.chi_square,
                beyond_detections=own.beyond_detections,
                found_m=own.found_m,
                found_rad=own.found_rad,
                beyond_usual=own.beyond_usual,
            )
        edges.append(marked)
    untold = [name for name in found.untold if not _told(edges, name)]
    return replace(found, edges=tuple(edges), limit=limit, untold=tuple(untold))


def _told(edges: Sequence[EdgeDrift], name: str) -> bool:
    return any(name in edge.sensors and edge.told for edge in edges)


def _worst_left(found: Drift) -> float:
    return max((edge.chi_square for edge in found.edges if not edge.moved), default=0.0)


def _or_none(asked: Question, held: str) -> Optional[Drift]:
    try:
        return _drift(asked, (held,))
    except AtomError:
        return None


def _drift(asked: Question, held: Sequence[str]) -> Drift:
    standing, spreads = asked.standing, asked.spreads
    solved = calibrate(standing, asked.options(held))
    anchored = solved.free.anchored_sensors
    if solved.status in (FAILED, NOT_CONVERGED):
        raise CalibrationError(
            f"{standing.source}: the new boards alone cannot be solved ({solved.message}); collect "
            f"others, and see what `check` says of them"
        )
    every = standing.calibrated_edges
    estimated = [edge for edge in every if edge_spread(solved, edge) is not None]
    limit = limit_of(len(estimated))
    of_reference = _reference_spread(standing, spreads, anchored)
    edges = tuple(
        _edge_drift(solved, standing, edge, spreads.get(edge, NO_SPREAD) + of_reference, limit)
        for edge in estimated
    )
    names = {name for edge in edges for name in edge.sensors} | set(anchored)
    untold = [name for name in standing.sensors if name not in names]
    untold += [name for edge in edges if not edge.told for name in edge.sensors]
    boards = len({key.collection for key in solved.problem.detections})
    remark = solved.message if solved.status == INCONSISTENT else None
    left_out = tuple(solved.rejected)
    return Drift(tuple(anchored), edges, limit, boards, tuple(untold), remark, left_out)


def _reference_spread(
    dataset: Dataset, spreads: Mapping[Edge, Spread], anchored: Sequence[str]
) -> Spread:
    """Return how exactly the described place of what is held is known itself."""
    total = NO_SPREAD
    for edge in {dataset.sensors[name].edge for name in anchored}:
        total = total + spreads.get(edge, NO_SPREAD)
    return total


def _edge_drift(
    solved: Calibration, standing: Dataset, edge: Edge, described: Spread, limit: float
) -> EdgeDrift:
    """Return how far an edge is; ``described`` is how exactly its description is known."""
    new = known_spread(solved, edge)
    by_new = scatter_of(described) * new.of_model
    covariance = joint_covariance(described, Spread(by_new, by_new))
    change = pose_error(standing.first_value(edge), solved.dataset.first_value(edge))
    names = standing.sensors_on(edge)
    measures_range = any(standing.sensors[name].kind.measures_range for name in names)
    freedom = _freedom(described) if measures_range else np.inf
    square = rarity(change, covariance, freedom)
    usual = covariance + described.usual + new.usual
    trifle = change.translation_m < LEAST_M and change.rotation_rad < LEAST_RAD
    found = EdgeDrift(
        edge,
        names,
        change,
        square,
        square > limit and not trifle,
        rarity(change, described.stated + new.stated) > limit,
        found_from(covariance, limit, freedom, TRANSLATION),
        found_from(covariance, limit, freedom, ROTATION),
        rarity(change, usual) > limit,
    )
    larger = change.translation_m > found.found_m or change.rotation_rad > found.found_rad
    return found._replace(moved=found.moved and (found.told or larger))


def _freedom(described: Spread) -> float:
    """Return how many independent numbers told the scatter; infinity where there is none."""
    if not np.any(described.of_model):
        return np.inf
    return _NUMBERS_OF_A_DETECTION * float(described.detections or _DETECTIONS)
