"""A calibration and methods that take two sensors at a time, on one test set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.baselines.links import Link, LinkedRig
from atom_core.evaluation.evaluate import Evaluation, evaluate, pair_errors
from atom_core.evaluation.ground_truth import ground_truth_errors, reference_sensor
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.evaluation.observed import Borders, Observed
from atom_core.evaluation.pairs import Pair, pairs_of
from atom_core.evaluation.results import summarised
from atom_core.geometry import se3
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.truth import Truth, with_truth


class PoseError(NamedTuple):
    """How far a pose is from the true one."""

    translation_m: float
    rotation_deg: float


class PairScore(NamedTuple):
    """A pair's RMS, by one kind of comparison; None where nothing could be measured.

    Attributes:
        pair: the sensors and the kind.
        rms: with the method's pose.
        calibration: with the calibration's.
        at_truth: with the true one; None without a truth.
    """

    pair: Pair
    rms: Optional[float]
    calibration: Optional[float]
    at_truth: Optional[float]


class LinkScore(NamedTuple):
    """What a link is worth.

    Attributes:
        link: the method's pose of one sensor in the other.
        pairs: by each kind of comparison.
        error, calibration: of the link, and of the calibration in its place, against the truth;
            None without one.
    """

    link: Link
    pairs: Tuple[PairScore, ...]
    error: Optional[PoseError] = None
    calibration: Optional[PoseError] = None


class SensorScore(NamedTuple):
    """A placed sensor's error in the reference, and the calibration's, against the truth."""

    error: PoseError
    calibration: PoseError


@dataclass(frozen=True)
class RigComparison:
    """A method beside a calibration, on the same test set.

    Attributes:
        rig: the method's answer.
        evaluation: of the rig that its links make; None where it has none.
        links: link by link.
        reference: the sensor in which the others are placed; None where there is none.
        sensors: errors of those placed, without the reference; empty without a truth.
    """

    rig: LinkedRig
    evaluation: Optional[Evaluation]
    links: Tuple[LinkScore, ...] = ()
    reference: Optional[str] = None
    sensors: Optional[Mapping[str, SensorScore]] = None


class Measured(NamedTuple):
    """What all methods are measured on.

    Attributes:
        train: the calibrated dataset.
        test: to measure on.
        evaluation: of the calibration.
        truth: true edges of a simulation.
        annotations: hand-drawn borders.
    """

    train: Dataset
    test: Dataset
    evaluation: Evaluation
    truth: Optional[Truth] = None
    annotations: Optional[Borders] = None


def compare_rigs(
    rigs: Sequence[LinkedRig], measured: Measured, sensors: Optional[Sequence[str]] = None
) -> List[RigComparison]:
    """Evaluate the methods' answers link by link, and as a whole.

    Args:
        rigs: the answers, found from the train file's labels.
        measured: the calibration, and what it is measured on.
        sensors: only these; None: all.

    Raises:
        DatasetError: the files do not belong together.
    """
    mixed = mixed_dataset(measured.train, measured.test, sensors)
    observed = Observed(mixed, measured.annotations)
    return [_compared(rig, measured, mixed, observed) for rig in rigs]


def _compared(
    rig: LinkedRig, measured: Measured, mixed: Dataset, observed: Observed
) -> RigComparison:
    if rig.dataset is None:
        return RigComparison(rig, None)
    placed = [name for name in mixed.sensors if name in rig.placed]
    own = mixed_dataset(rig.dataset, measured.test, list(mixed.sensors))
    if any(own.sensors[n].camera is not mixed.sensors[n].camera for n in placed):
        observed = Observed(own, measured.annotations)  # it has intrinsics of its own
    else:
        own = mixed
    links = tuple(_link_score(link, measured, mixed, own, observed) for link in rig.links)
    found = evaluate(
        rig.dataset,
        measured.test,
        truth=measured.truth,
        sensors=placed,
        annotations=measured.annotations,
    )
    reference = reference_sensor(mixed.selected(sensors=placed))
    return RigComparison(
        rig, found, links, reference, _sensor_scores(found, measured.truth, mixed, placed)
    )


def _link_score(
    link: Link, measured: Measured, mixed: Dataset, own: Dataset, observed: Observed
) -> LinkScore:
    """Return the score of a link; ``own`` is the test set with the method's intrinsics."""
    both = {link.source, link.target}
    pairs = [p for p in pairs_of(mixed.sensors) if {p.source, p.target} == both and not p.reverse]
    known = {result.pair: result for result in measured.evaluation.pairs}
    scores = []
    for pair in pairs:
        forth = pair.source == link.source
        matrix = link.target_T_source if forth else se3.inverse(link.target_T_source)
        errors, _ = pair_errors(pair, observed, own, matrix)
        result = known.get(pair)
        ours = None if result is None or result.measured is None else result.measured.rms
        floor = None if result is None or result.at_truth is None else result.at_truth.rms
        rms = summarised(errors).rms if errors else None
        scores.append(PairScore(pair, rms, ours, floor))
    if measured.truth is None:
        return LinkScore(link, tuple(scores))
    true = _between(with_truth(mixed, measured.truth), link)
    return LinkScore(
        link,
        tuple(scores),
        _error(true, link.target_T_source),
        _error(true, _between(mixed, link)),
    )


def _between(dataset: Dataset, link: Link) -> np.ndarray:
    first = next(iter(dataset.collections.values()))
    frames = (dataset.sensors[name].frame for name in (link.target, link.source))
    return pose(first, dataset.graph, *frames)


def _error(true: np.ndarray, found: np.ndarray) -> PoseError:
    metres, radians = pose_difference(true, found)
    return PoseError(metres, float(np.degrees(radians)))


def _sensor_scores(
    found: Evaluation, truth: Optional[Truth], mixed: Dataset, placed: Sequence[str]
) -> Dict[str, SensorScore]:
    if truth is None or found.ground_truth is None:
        return {}
    selected = mixed.selected(sensors=placed)
    reference = reference_sensor(selected)
    ours = ground_truth_errors(selected, truth).sensors
    return {
        name: SensorScore(
            PoseError(error.translation_m, error.rotation_deg),
            PoseError(ours[name].translation_m, ours[name].rotation_deg),
        )
        for name, error in found.ground_truth.sensors.items()
        if name != reference
    }
