"""Evaluate a calibration: every pair of sensors on a test set, and every sensor against a truth."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Collection, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.between_collections import spreads
from atom_core.evaluation.board_displacement import Displacement, board_displacement
from atom_core.evaluation.ground_truth import GroundTruth, ground_truth_errors
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.evaluation.observed import Borders, NotMeasurableError, Observed
from atom_core.evaluation.own_edges import own_edge_between, own_edges, why_own
from atom_core.evaluation.pairs import Pair, pairs_of
from atom_core.evaluation.results import PairFigures, PairResult, summarised
from atom_core.evaluation.rig_differences import rig_differences
from atom_core.evaluation.single_camera import SingleCamera, single_cameras
from atom_core.evaluation.statistics import Errors, mean_of
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth, with_truth


@dataclass(frozen=True)
class Average:
    """Mean over the pairs of a kind that were measured, reverse ones left out."""

    unit: str
    pairs: int
    values: Mapping[str, float]
    at_truth: Optional[float]


@dataclass(frozen=True)
class Evaluation:
    """What is known of a calibration.

    Attributes:
        train, test: the files.
        pairs: in the order of kinds and configuration.
        averages: by kind.
        ground_truth: errors of the sensors; None without a truth.
        single: each camera by itself.
        spread: each camera with itself in other collections, over boards that stay.
        px_per_rad: by sensor, how many pixels of its image a radian has in the middle; None of
            what has no image.
        caveats: what puts sensors in doubt whatever is measured, of either dataset or where the
            two differ.
    """

    train: str
    test: str
    pairs: Tuple[PairResult, ...]
    averages: Mapping[str, Average]
    ground_truth: Optional[GroundTruth] = None
    single: Tuple[SingleCamera, ...] = ()
    spread: Tuple[PairResult, ...] = ()
    px_per_rad: Mapping[str, Optional[float]] = field(default_factory=dict)
    caveats: Tuple[Caveat, ...] = ()

    @property
    def measured(self) -> bool:
        """Tell whether anything was measured that depends on the calibration."""
        return any(result.measured for result in (*self.pairs, *self.spread))


def evaluate(
    train: Dataset,
    test: Dataset,
    *,
    truth: Optional[Truth] = None,
    sensors: Optional[Sequence[str]] = None,
    pairs: Optional[Sequence[str]] = None,
    annotations: Optional[Borders] = None,
) -> Evaluation:
    """Measure every pair of sensors on a test set.

    Args:
        train: the calibrated dataset.
        test: the dataset to measure on; the same file is allowed.
        truth: true edges of a simulation, for the floor of the metrics and the sensors' errors.
        sensors: names of the sensors to compare; None: all.
        pairs: only these pairs, see `pairs_of`, and no camera by itself.
        annotations: hand-drawn borders of the test set, by collection, sensor and pattern.

    Raises:
        DatasetError: the files do not belong together, or a label does not fit its data.
        SelectionError: ``pairs`` names no pair.
    """
    mixed, own = mixed_dataset(train, test, sensors), own_edges(train, test)
    true = None if truth is None else with_truth(mixed, truth)
    observed = Observed(mixed, annotations)
    results = tuple(
        _evaluate_pair(pair, observed, mixed, true, own) for pair in pairs_of(mixed.sensors, pairs)
    )
    return Evaluation(
        train=str(train.source),
        test=str(test.source),
        pairs=results,
        averages=averages_of(results),
        ground_truth=None if truth is None else ground_truth_errors(mixed, truth),
        single=tuple(single_cameras(mixed, observed, true, own=own)) if pairs is None else (),
        spread=tuple(spreads(mixed, observed, true, own)) if pairs is None else (),
        px_per_rad={
            name: None if sensor.camera is None else float(sensor.camera.K[0, 0])
            for name, sensor in mixed.sensors.items()
        },
        caveats=tuple(
            dict.fromkeys((*train.caveats, *test.caveats, *rig_differences(train, test)))
        ),
    )


def averages_of(results: Sequence[PairResult]) -> Dict[str, Average]:
    """Return the mean over the measured pairs of each kind, reverse ones left out."""
    by_kind: Dict[str, List[PairResult]] = {}
    for result in results:
        if result.measured is not None and not result.pair.reverse:
            by_kind.setdefault(result.pair.kind.name, []).append(result)
    return {kind: _average(found) for kind, found in by_kind.items()}


def _average(results: Sequence[PairResult]) -> Average:
    measured = [result.measured for result in results]
    names = ("rms", "x_mean_abs", "y_mean_abs", "translation_mm", "rotation_deg")
    values = {name: mean_of([getattr(m, name) for m in measured]) for name in names}
    return Average(
        unit=results[0].pair.kind.unit,
        pairs=len(results),
        values={name: value for name, value in values.items() if value is not None},
        at_truth=mean_of([r.at_truth.rms for r in results if r.at_truth is not None]),
    )


def _evaluate_pair(
    pair: Pair,
    observed: Observed,
    mixed: Dataset,
    true: Optional[Dataset],
    own: Collection[Edge],
) -> PairResult:
    frames = [mixed.sensors[name].frame for name in (pair.target, pair.source)]
    across = own_edge_between(mixed, own, *frames)
    if across is not None:
        return PairResult(pair, None, skipped=why_own(across))
    errors, reasons = pair_errors(pair, observed, mixed)
    if not errors:
        return PairResult(pair, None, skipped=_why_skipped(pair, reasons), unmeasured=reasons)
    return PairResult(
        pair,
        summarised(errors),
        at_truth=None if true is None else _floor(pair, observed, true),
        unmeasured=reasons,
        unseen=sum(e.unseen for e in errors.values()),
        displacement=_displacement(pair, observed, mixed),
    )


def _displacement(pair: Pair, observed: Observed, mixed: Dataset) -> Optional[Displacement]:
    """Return how far the planes of the boards have the source elsewhere, where they are asked."""
    if not pair.kind.by_planes or pair.reverse:
        return None
    return board_displacement(observed, list(_seen_by_both(pair, mixed)))


def _floor(pair: Pair, observed: Observed, true: Dataset) -> Optional[PairFigures]:
    errors, _ = pair_errors(pair, observed, true)
    return summarised(errors) if errors else None


def pair_errors(
    pair: Pair, observed: Observed, dataset: Dataset, given: Optional[np.ndarray] = None
) -> Tuple[Dict[Tuple[str, str], Errors], Dict[str, str]]:
    """Return errors by (collection, pattern), and by collection why others have none.

    Args:
        pair: of sensors.
        observed: the labels.
        dataset: with the calibrated edges.
        given: ``target_T_source`` (4, 4) in their place; None: as the dataset has it.
    """
    errors: Dict[Tuple[str, str], Errors] = {}
    reasons: Dict[str, str] = {}
    for source, target, target_T_source in _seen_by_both(pair, dataset, given):
        try:
            errors[(source.collection, source.pattern)] = pair.kind.measure(
                observed, source, target, target_T_source
            )
        except NotMeasurableError as reason:
            reasons[source.collection] = str(reason)
    return errors, {key: why for key, why in reasons.items() if not _has(errors, key)}


def _seen_by_both(
    pair: Pair, dataset: Dataset, given: Optional[np.ndarray] = None
) -> Iterator[Tuple[DetectionKey, DetectionKey, np.ndarray]]:
    """Yield the source's and the target's detections of a board, and ``target_T_source`` (4, 4)."""
    source, target = dataset.sensors[pair.source], dataset.sensors[pair.target]
    for key, collection in dataset.collections.items():
        shared = [
            pattern
            for pattern in dataset.patterns
            if all((name, pattern) in collection.labels for name in (pair.source, pair.target))
        ]
        if not shared:
            continue
        target_T_source = given
        if target_T_source is None:
            target_T_source = pose(collection, dataset.graph, target.frame, source.frame)
        for pattern in shared:
            yield (
                DetectionKey(key, pair.source, pattern),
                DetectionKey(key, pair.target, pattern),
                target_T_source,
            )


def _has(errors: Mapping[Tuple[str, str], Errors], collection: str) -> bool:
    return any(key == collection for key, _ in errors)


def _why_skipped(pair: Pair, reasons: Mapping[str, str]) -> str:
    if not reasons:
        return f"no collection in which '{pair.source}' and '{pair.target}' detect the same pattern"
    counted = Counter(reasons.values()).most_common()
    return "; ".join(f"{why} ({count} collections)" for why, count in counted)
