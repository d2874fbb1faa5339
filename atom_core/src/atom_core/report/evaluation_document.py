"""The document ``evaluation.json``; its keys are a stable interface."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Dict, Optional, Sequence

from atom_core.evaluation.baselines.comparison import RigComparison
from atom_core.evaluation.board_displacement import Displacement
from atom_core.evaluation.evaluate import Average, Evaluation
from atom_core.evaluation.hand_eye_comparison import CALIBRATION, HandEyeComparison
from atom_core.evaluation.results import PairFigures, PairResult
from atom_core.evaluation.single_camera import SingleCamera
from atom_core.evaluation.statistics import Figures
from atom_core.report.baseline_report import baseline_document
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.ground_truth_document import ground_truth_document
from atom_core.report.verdict import verdict_document

VERSION = "1.0"


def evaluation_document(
    evaluation: Evaluation,
    compared: Optional[Evaluation] = None,
    hand_eye: Optional[HandEyeComparison] = None,
    baselines: Sequence[RigComparison] = (),
) -> Dict[str, Any]:
    """Return the document; all numbers finite, lengths in the unit that stands beside them.

    Args:
        evaluation: of the calibration under test.
        compared: of another calibration on the same test set.
        hand_eye: baselines of cameras on an arm.
        baselines: methods that take two sensors at a time.
    """
    document = {
        "version": VERSION,
        "train": evaluation.train,
        "test": evaluation.test,
        "verdict": verdict_document(evaluation_verdict(evaluation)),
        **_results(evaluation),
        "baselines": {
            **({} if hand_eye is None else _hand_eye(hand_eye)),
            **{comparison.rig.method: _baseline(comparison) for comparison in baselines},
        },
    }
    if compared is not None:
        document["compared_with"] = {"train": compared.train, **_results(compared)}
    return document


def _results(evaluation: Evaluation) -> Dict[str, Any]:
    return {
        "pairs": [pair_document(result) for result in evaluation.pairs],
        "averages": {kind: _average(value) for kind, value in evaluation.averages.items()},
        "single_cameras": [_single(result) for result in evaluation.single],
        "between_collections": [pair_document(result) for result in evaluation.spread],
        "ground_truth": ground_truth_document(evaluation.ground_truth),
    }


def _single(result: SingleCamera) -> Dict[str, Any]:
    measured = result.measured
    per_collection = {} if measured is None else measured.per_collection
    return {
        "sensor": result.sensor,
        "pattern": result.pattern,
        "unit": "px",
        "one_pose": result.one_pose,
        "tells_of_calibration": result.tells_of_calibration,
        "collections": len(per_collection),
        "points": 0 if measured is None else measured.pooled.points,
        **({} if measured is None else _figures(measured)),
        "at_truth": None if result.at_truth is None else _figures(result.at_truth),
        "per_collection": {key: _present(value) for key, value in per_collection.items()},
        "skipped": result.skipped,
    }


def _hand_eye(comparison: HandEyeComparison) -> Dict[str, Any]:
    """Return the entry of each method, and the figures of the calibration in their terms."""

    def scores(method: str) -> Dict[str, Any]:
        of_method = comparison.scores.items()
        return {camera: score._asdict() for (name, camera), score in of_method if name == method}

    entries: Dict[str, Any] = {"hand_eye": {"cameras": scores(CALIBRATION)}}
    for baseline in comparison.baselines:
        found = comparison.evaluations.get(baseline.method)
        empty: Dict[str, Any] = {"pairs": [], "ground_truth": None}
        entries[f"hand_eye_{baseline.method}"] = {
            **(empty if found is None else _results(found)),
            "cameras": scores(baseline.method),
            "boards": dict(baseline.boards),
            "skipped": baseline.skipped,
        }
    return entries


def _baseline(comparison: RigComparison) -> Dict[str, Any]:
    """Return the entry of a method: its rig evaluated as a whole, then link by link."""
    empty: Dict[str, Any] = {"pairs": [], "ground_truth": None}
    whole = empty if comparison.evaluation is None else _results(comparison.evaluation)
    return {**whole, **baseline_document(comparison)}


def pair_document(result: PairResult) -> Dict[str, Any]:
    """Return the entry of one pair; figures are null where it was skipped."""
    pair, measured = result.pair, result.measured
    names = ("rms", "pooled_rms", "mean", "median")
    found = dict.fromkeys(names) if measured is None else _figures(measured)
    per_collection = {} if measured is None else measured.per_collection
    return {
        "source": pair.source,
        "target": pair.target,
        "kind": pair.kind.name,
        "metric": pair.kind.metric,
        "unit": pair.kind.unit,
        "reverse": pair.reverse,
        "collections": len(per_collection),
        "points": 0 if measured is None else measured.pooled.points,
        "points_out_of_image": result.unseen,
        **found,
        "at_truth": None if result.at_truth is None else _figures(result.at_truth),
        "per_collection": {key: _present(value) for key, value in per_collection.items()},
        "not_measured": dict(result.unmeasured),
        "skipped": result.skipped,
        **({} if result.displacement is None else {"displacement": _moved(result.displacement)}),
    }


def _moved(found: Displacement) -> Dict[str, Any]:
    return {
        "shift_m": found.shift_m.tolist(),
        "turn_rad": found.turn_rad.tolist(),
        "sigma_m": found.sigma_m,
        "sigma_rad": found.sigma_rad,
        "told": found.told,
    }


def _figures(measured: PairFigures) -> Dict[str, float]:
    names = ("x_mean_abs", "y_mean_abs", "x_std_abs", "y_std_abs", "translation_mm", "rotation_deg")
    optional = {name: getattr(measured, name) for name in names}
    return {
        "rms": measured.rms,
        "pooled_rms": measured.pooled.rms,
        "mean": measured.pooled.mean,
        "median": measured.pooled.median,
        **{name: value for name, value in optional.items() if value is not None},
    }


def _present(values: Figures) -> Dict[str, float]:
    """Return the figures that are there, by name."""
    return {name: value for name, value in asdict(values).items() if value is not None}


def _average(average: Average) -> Dict[str, Any]:
    return {
        "unit": average.unit,
        **average.values,
        "at_truth": average.at_truth,
        "pairs": average.pairs,
    }
