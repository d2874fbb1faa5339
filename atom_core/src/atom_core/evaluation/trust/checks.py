"""Three questions to a calibration that need no truth.

*Split-half*: do two halves of the collections give the same answer, as far as each can tell?
*Leave one sensor out*: do the boards, as all other sensors have them, put a sensor where the joint
solution has it, and how well do they predict what it sees? *Loops*: do three poses, each from two
sensors alone, close to nothing around a triangle?
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy import special

from atom_core.calibration.calibrate import Calibration, judged, solved
from atom_core.calibration.judge.judgement import INCONSISTENT
from atom_core.calibration.judge.statistics import kinds_of, residual_table
from atom_core.calibration.options import (
    DESCRIPTION,
    OFF,
    SUGGEST,
    CalibrationOptions,
)
from atom_core.errors import AtomError
from atom_core.evaluation.baselines.links import move_against_each_other, seen_by_both
from atom_core.evaluation.edge_spread import edge_spread
from atom_core.evaluation.trust.relative import (
    RelativePose,
    difference,
    jacobian,
    largest_in_sigmas,
    relative_pose,
    stepped,
)
from atom_core.evaluation.trust.two_estimates import edge_difference
from atom_core.geometry import se3
from atom_core.model.config_entries import PriorConfig
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.measurements import Measured, measured_detections
from atom_core.solvers.base import CONVERGED
from atom_core.solvers.stops import stops_of

FALSE_ALARMS = 0.01  # of each of the three questions
FEWEST_BOARDS = 4  # two sensors have in common, for a loop
FEWEST_STOPS = 8  # to be halved
WORSE = 1.5  # times as far off as in the joint solution: what a sensor sees is not predicted
_TRUSTED = (CONVERGED, INCONSISTENT)  # a contradiction is what is asked about


class Compared(NamedTuple):
    """A difference that should be nothing.

    Attributes:
        names: of the sensors.
        sigmas: the largest of its six numbers in its standard deviation.
        translation_m, rotation_rad: of it.
    """

    names: Tuple[str, ...]
    sigmas: float
    translation_m: float
    rotation_rad: float


class Predicted(NamedTuple):
    """A sensor by the boards of all others.

    Attributes:
        compared: its place by them against that in the joint solution.
        kind: of its residuals, the one that grows most.
        joint, predicted: their mean in the joint solution and with the boards of the others
            [px or m].
    """

    compared: Compared
    kind: str
    joint: float
    predicted: float

    @property
    def ratio(self) -> float:
        """By how much the residuals grow."""
        return self.predicted / max(self.joint, 1e-12)


@dataclass(frozen=True)
class Trust:
    """What the three questions gave.

    Attributes:
        halves: each sensor in two halves of the collections; empty where they tell nothing.
        halves_limit: of their sigmas.
        left_out: each sensor by the boards of all others.
        left_out_limit: of their sigmas.
        loops: around each triangle of sensors.
        loops_limit: of their sigmas.
        untold: why something could not be asked.
    """

    halves: Tuple[Compared, ...]
    halves_limit: float
    left_out: Tuple[Predicted, ...]
    left_out_limit: float
    loops: Tuple[Compared, ...]
    loops_limit: float
    untold: Tuple[str, ...]


def trust_checks(calibration: Calibration, asked: Optional[CalibrationOptions] = None) -> Trust:
    """Ask a calibration the three questions; it is solved again in parts.

    Args:
        calibration: as solved.
        asked: the options that it was solved with; None: the defaults.
    """
    untold: List[str] = []
    if calibration.status not in _TRUSTED:
        why = f"nothing was asked: the calibration is {calibration.status}"
        return Trust((), 0.0, (), 0.0, (), 0.0, (why,))
    whole = _with_priors(calibration).selected(collections=_used(calibration))
    options = _options(calibration, asked or CalibrationOptions())
    parts = _Parts(whole, options, measured_detections(whole), untold)
    halves = _halves(whole, stops_of(calibration.problem, calibration.summary.x), parts)
    left_out = [
        found
        for name in whole.sensors
        for found in [_left_out(calibration, whole, parts, name)]
        if found is not None
    ]
    loops = _loops(whole, parts)
    return Trust(
        tuple(halves),
        limit_of(len(halves)),
        tuple(left_out),
        limit_of(len(left_out)),
        tuple(loops),
        limit_of(len(loops)),
        tuple(dict.fromkeys(untold)),
    )


class _Parts(NamedTuple):
    """How parts of a calibration are solved again.

    Attributes:
        whole: the calibrated dataset.
        options: of all of it.
        known: what was read of its detections, which parts share.
        untold: grows by why something could not be asked.
    """

    whole: Dataset
    options: CalibrationOptions
    known: Mapping[DetectionKey, Measured]
    untold: List[str]

    def known_of(self, part: Dataset) -> Dict[DetectionKey, Measured]:
        """Return what was read of detections that are the same in a part."""
        return {
            key: self.known[key]
            for key, label in part.detections()
            if key in self.known
            and label is self.whole.label(key)
            and part.sensors[key.sensor] is self.whole.sensors[key.sensor]
            and part.patterns[key.pattern] is self.whole.patterns[key.pattern]
        }


def limit_of(count: int) -> float:
    """Return by how many sigmas one of six numbers of some differences may be off."""
    return float(-special.ndtri(FALSE_ALARMS / (2.0 * BLOCK_SIZE * max(count, 1))))


def _with_priors(calibration: Calibration) -> Dataset:
    """Return the calibrated dataset with all priors in its configuration.

    There they are passed over in parts that hold what they are of; asked for, they are refused.
    """
    known = calibration.free.priors.values()
    priors = {prior.name: PriorConfig(prior.sigma_m, prior.sigma_rad) for prior in known}
    dataset = calibration.dataset
    return replace(dataset, config=replace(dataset.config, priors=priors))


def _used(calibration: Calibration) -> List[str]:
    return [key for key in calibration.dataset.collections if key not in calibration.unused]


def _options(calibration: Calibration, asked: CalibrationOptions) -> CalibrationOptions:
    """Return options for solving a part of it again, from where it stands."""
    return replace(
        asked,
        anchor_sensors=calibration.free.anchored_sensors,
        additional_tfs=tuple(calibration.free.additional_tfs),
        initial_guess=DESCRIPTION,
        noisy_initial_guess=(0.0, 0.0),
        model_errors=OFF if asked.model_errors == SUGGEST else asked.model_errors,
        keep_collections=(),
        keep_detections=(),
        only_anchored_sensor=False,
        priors={},  # they stand in the configuration
    )


def _of_sensors(options: CalibrationOptions, dataset: Dataset) -> CalibrationOptions:
    """Return the options without what is of sensors that a part does not have."""

    def there(names: Sequence[str]) -> Tuple[str, ...]:
        return tuple(name for name in names if name in dataset.sensors)

    return replace(
        options,
        anchor_sensors=there(options.anchor_sensors),
        intrinsics=there(options.intrinsics),
        range_offset=there(options.range_offset),
        range_scale=there(options.range_scale),
        depth_offset=there(options.depth_offset),
        depth_scale=there(options.depth_scale),
    )


def _solved(dataset: Dataset, parts: _Parts, what: str, **changed: Any) -> Optional[Calibration]:
    """Return a part's calibration with changed options; None where it has none to trust."""
    options = _of_sensors(replace(parts.options, **changed), dataset)
    try:
        found = judged(solved(dataset, options, parts.known_of(dataset)))
    except AtomError as error:
        parts.untold.append(f"{what}: {error}")
        return None
    if found.status not in _TRUSTED:
        parts.untold.append(f"{what}: {found.message}")
        return None
    return found


# ---- two halves


def _halves(dataset: Dataset, stops: Mapping[str, str], parts: _Parts) -> List[Compared]:
    """Compare two halves; pictures of one stop, which share what is wrong there, stay together."""
    collections: Dict[str, List[str]] = {}
    for key in dataset.collections:
        collections.setdefault(stops.get(key, key), []).append(key)
    places = list(collections.values())
    if len(places) < FEWEST_STOPS:
        few = len(places) < len(dataset.collections)
        where = f" in {len(places)} place(s) only" if few else ""
        what = f"{len(dataset.collections)} collections{where}, it takes {FEWEST_STOPS}"
        parts.untold.append(f"two halves: {what}")
        return []
    halves = ([key for keys in places[i::2] for key in keys] for i in (0, 1))
    one, other = (
        _solved(dataset.selected(collections=keys), parts, "two halves") for keys in halves
    )
    if one is None or other is None:
        return []
    found = []
    for name, sensor in dataset.sensors.items():
        if sensor.edge not in one.free.held_edges(dataset):
            found.append(_compared((name,), *edge_difference(one, other, sensor.edge)))
    return found


def _spread(calibration: Calibration, edge: Edge) -> np.ndarray:
    found = edge_spread(calibration, edge)
    return np.zeros((BLOCK_SIZE, BLOCK_SIZE)) if found is None else found


def _compared(names: Tuple[str, ...], numbers: np.ndarray, covariance: np.ndarray) -> Compared:
    turn, shift = numbers[:3], numbers[3:]
    sigmas = largest_in_sigmas(numbers, covariance)
    return Compared(names, sigmas, float(np.linalg.norm(shift)), float(np.linalg.norm(turn)))


# ---- one sensor left out


def _left_out(
    calibration: Calibration,
    whole: Dataset,
    parts: _Parts,
    name: str,
) -> Optional[Predicted]:
    what = f"without {name}"
    others = [other for other in whole.sensors if other != name]
    if not others:
        return None
    held = tuple(other for other in parts.options.anchor_sensors if other != name)
    if not held:  # the gauge: one of the others stays where the joint solution has it
        held = (others[0],)
    rest = whole.selected(sensors=others)
    # That a sensor alone is not calibrated, as the other one of two is not, goes without saying.
    asked = parts if len(others) > 1 else parts._replace(untold=[])
    by_others = _solved(rest, asked, what, anchor_sensors=held, ignore_anchored_sensor=True)
    if by_others is None:
        return None
    boards = by_others.dataset
    alone = replace(boards, sensors={name: whole.sensors[name]}).selected(
        collections=_used(by_others)
    )
    seen = _of_use(alone, others, name, calibration.dataset)
    if not seen:
        parts.untold.append(
            f"{what}: no other sensor tells which way round a board is that it sees"
        )
        return None
    predicted = _solved(
        alone.selected(collections=seen),
        parts,
        what,
        anchor_sensors=(),
        anchor_patterns=True,
        ignore_anchored_sensor=True,
    )
    if predicted is None:
        return None
    edge = whole.sensors[name].edge
    change = difference(whole.first_value(edge), predicted.dataset.first_value(edge))
    covariance = _spread(predicted, edge) + _spread(calibration, edge)
    kind, joint, now = _grown(calibration, predicted, name)
    return Predicted(_compared((name,), change, covariance), kind, joint, now)


def _of_use(alone: Dataset, others: Sequence[str], name: str, whole: Dataset) -> List[str]:
    """Return the collections in which the others place a board as this sensor needs it.

    A range sensor does not tell which way round a rectangle is, and a camera has to know it.
    """
    telling = [other for other in others if not whole.sensors[other].kind.measures_range]
    found = []
    for key, collection in alone.collections.items():
        boards = [pattern for sensor, pattern in collection.labels if sensor == name]
        by = others if whole.sensors[name].kind.measures_range else telling
        if any((other, board) in collection.labels for other in by for board in boards):
            found.append(key)
    return found


def _grown(before: Calibration, after: Calibration, name: str) -> Tuple[str, float, float]:
    """Return the kind of a sensor's residuals that grows most, and its two means."""
    tables = [residual_table(c.problem, c.summary.x) for c in (before, after)]
    kinds = [{k: t[name, k, None].mean for k in kinds_of(t, name)} for t in tables]
    common = [kind for kind in kinds[0] if kind in kinds[1]]
    kind = max(common, key=lambda k: kinds[1][k] / max(kinds[0][k], 1e-12))
    return kind, kinds[0][kind], kinds[1][kind]


# ---- loops


def _loops(dataset: Dataset, parts: _Parts) -> List[Compared]:
    links: Dict[Tuple[str, str], RelativePose] = {}
    for one, other in combinations(dataset.sensors, 2):
        found = _by_themselves(dataset, parts, one, other)
        if found is not None:
            links[one, other] = found
    found_loops = []
    for a, b, c in combinations(dataset.sensors, 3):
        around = [links.get(pair) for pair in ((a, b), (b, c), (a, c))]
        if all(link is not None for link in around):
            found_loops.append(_loop((a, b, c), [link for link in around if link is not None]))
    if len(dataset.sensors) > 2 and not found_loops:
        parts.untold.append(
            f"loops: no three sensors of which each two share {FEWEST_BOARDS} boards"
        )
    return found_loops


def _by_themselves(dataset: Dataset, parts: _Parts, one: str, other: str) -> Optional[RelativePose]:
    """Return ``one_T_other`` by these two sensors alone."""
    sensors = [dataset.sensors[name] for name in (one, other)]
    both = seen_by_both(dataset, one, other)
    if len(both) < FEWEST_BOARDS or sensors[0].edge == sensors[1].edge:
        return None
    if move_against_each_other(dataset, one, other):
        return None
    pair = dataset.selected(sensors=(one, other), collections=[key.collection for key, _ in both])
    found = _solved(
        pair,
        parts,
        f"{one} and {other} by themselves",
        anchor_sensors=(one,),
        ignore_anchored_sensor=True,
        additional_tfs=(),
    )
    return None if found is None else relative_pose(found, one, other)


def _loop(names: Tuple[str, str, str], parts: Sequence[RelativePose]) -> Compared:
    """Return what is left of ``a_T_b b_T_c (a_T_c)^-1``."""

    def closed(poses: Sequence[np.ndarray]) -> np.ndarray:
        return poses[0] @ poses[1] @ se3.inverse(poses[2])

    poses = [part.target_T_source for part in parts]
    now = closed(poses)
    covariance = np.zeros((BLOCK_SIZE, BLOCK_SIZE))
    for i, part in enumerate(parts):

        def moved(numbers: np.ndarray, i: int = i) -> np.ndarray:
            return closed([stepped(p, numbers) if k == i else p for k, p in enumerate(poses)])

        slope = jacobian(moved, now)
        covariance += slope @ part.covariance @ slope.T
    return _compared(names, difference(np.eye(4), now), covariance)
