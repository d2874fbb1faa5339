"""The tables that ``evaluate`` prints."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence, Union

from atom_core.evaluation.baselines.comparison import RigComparison
from atom_core.evaluation.evaluate import Evaluation
from atom_core.evaluation.ground_truth import GroundTruth, MeanError, SensorError
from atom_core.evaluation.hand_eye_comparison import CALIBRATION, HandEyeComparison
from atom_core.evaluation.pairs import Pair
from atom_core.evaluation.results import PairFigures, PairResult
from atom_core.evaluation.single_camera import SingleCamera
from atom_core.evaluation.statistics import mean_of
from atom_core.geometry.units import MM_PER_M
from atom_core.report.baseline_report import baseline_tables
from atom_core.report.tables import text_table, three_digits

_AVERAGED = "each figure is the mean of those of the collections"
_BOARD_POSES = (
    "board trans. and rot.: between the board's pose as the source's image alone has it and as the "
    "target's has it: mostly how poorly one image tells a pose, and no error of the cameras."
)


def evaluation_report(
    evaluation: Evaluation,
    compared: Optional[Evaluation] = None,
    verbose: bool = False,
    hand_eye: Optional[HandEyeComparison] = None,
    baselines: Sequence[RigComparison] = (),
) -> str:
    """Return all tables as one text.

    Args:
        evaluation: of the calibration under test.
        compared: of another calibration on the same test set; stands beside it.
        verbose: also the reverse pairs, and a line for each collection.
        hand_eye: baselines of cameras on an arm.
        baselines: methods that take two sensors at a time.
    """
    shown = [r for r in evaluation.pairs if verbose or not r.pair.reverse]
    measured = [r for r in shown if r.measured is not None]
    parts = [
        camera_pair_table([r for r in measured if _has_poses(r)], compared),
        range_pair_table([r for r in measured if not _has_poses(r)], compared),
        *[collection_table(r) for r in measured if verbose],
        averages_table(evaluation, compared),
        single_camera_table(evaluation.single, () if compared is None else compared.single),
        spread_table(evaluation.spread, () if compared is None else compared.spread),
        skipped_table([*shown, *evaluation.spread]),
    ]
    if evaluation.ground_truth is not None:
        other = None if compared is None else compared.ground_truth
        parts.append(ground_truth_table(evaluation.ground_truth, other))
    if hand_eye is not None:
        parts.append(hand_eye_table(hand_eye))
    parts.append(baseline_tables(baselines, verbose))
    return "\n\n".join(part for part in parts if part)


def camera_pair_table(results: Sequence[PairResult], compared: Optional[Evaluation] = None) -> str:
    """Return ATOM's columns for pairs of cameras; empty if there is none."""
    headers = ["source", "target", "coll.", "points", "RMS [px]", "X [px]", "Y [px]"]
    headers += ["board trans. [mm]", "board rot. [deg]"]
    rows: List[List[Any]] = []
    for result in results:
        m = result.measured
        assert m is not None
        figures = [m.rms, m.x_mean_abs, m.y_mean_abs, m.translation_mm, m.rotation_deg]
        names = [result.pair.source, result.pair.target]
        rows.append([*names, *_counts(result), *map(three_digits, figures)])
    table = _with_references(f"Pairs of cameras ({_AVERAGED})", headers, rows, results, compared)
    return f"{table}\n{_BOARD_POSES}" if table else ""


def range_pair_table(results: Sequence[PairResult], compared: Optional[Evaluation] = None) -> str:
    """Return one line for each pair with a range sensor; empty if there is none."""
    headers = ["kind", "source", "target", "unit", "coll.", "points", "RMS", "mean", "median"]
    rows: List[List[Any]] = []
    for result in results:
        pair, m = result.pair, result.measured
        assert m is not None
        values = m.per_collection.values()
        figures = [m.rms, mean_of([v.mean for v in values]), mean_of([v.median for v in values])]
        names = [pair.kind.name, pair.source, pair.target, pair.kind.unit]
        rows.append([*names, *_counts(result), *map(three_digits, figures)])
    title = f"Pairs with a range sensor ({_AVERAGED})"
    table = _with_references(title, headers, rows, results, compared)
    floors: Dict[str, List[str]] = {}
    for result in results:
        if result.pair.kind.floor:
            kinds = floors.setdefault(result.pair.kind.floor, [])
            kinds += [result.pair.kind.name] if result.pair.kind.name not in kinds else []
    return "\n".join([table, *(f"{', '.join(k)}: {floor}." for floor, k in floors.items())])


def collection_table(result: PairResult) -> str:
    """Return one line for each collection and pattern of a measured pair."""
    assert result.measured is not None
    headers = ["collection", "pattern", "points", "RMS", "mean", "median", "X", "Y"]
    headers += ["board trans. [mm]", "board rot. [deg]"]
    rows: List[List[Any]] = []
    for row in result.measured.rows:
        f = row.figures
        figures = [f.rms, f.mean, f.median, f.x_mean_abs, f.y_mean_abs]
        poses = [f.translation_mm, f.rotation_deg]
        names = [row.collection, row.pattern, f.points]
        rows.append([*names, *map(three_digits, [*figures, *poses])])
    title = f"{result.pair.kind.name} [{result.pair.kind.unit}]: {_name(result.pair)}"
    return text_table(headers, rows, title)


def averages_table(evaluation: Evaluation, compared: Optional[Evaluation] = None) -> str:
    """Return the averages over the pairs of each kind, the floor at the truth beside them."""
    headers = ["kind", "unit", "pairs", "RMS"]
    with_truth = any(average.at_truth is not None for average in evaluation.averages.values())
    headers += ["RMS at truth", "above truth"] if with_truth else []
    rows: List[List[Any]] = []
    for kind, average in evaluation.averages.items():
        rms, floor = average.values["rms"], average.at_truth
        row: List[Any] = [kind, average.unit, average.pairs, three_digits(rms)]
        if with_truth:
            row += map(three_digits, [floor, None if floor is None else rms - floor])
        if compared is not None:
            other = compared.averages.get(kind)
            row.append(None if other is None else three_digits(other.values["rms"]))
        rows.append(row)
    headers += [] if compared is None else ["RMS of the other"]
    return text_table(headers, rows, "Averages over the pairs") if rows else ""


def skipped_table(results: Sequence[PairResult]) -> str:
    """Return the pairs that were not measured, and why; empty if there is none."""
    rows = [[r.pair.kind.name, _name(r.pair), r.skipped] for r in results if r.skipped]
    return text_table(["kind", "pair", "why"], rows, "Skipped") if rows else ""


def ground_truth_table(ground_truth: GroundTruth, compared: Optional[GroundTruth] = None) -> str:
    """Return the sensors' errors against the truth.

    Args:
        ground_truth: the errors.
        compared: the same of another calibration, or None.
    """
    headers = ["sensor", "translation [mm]", "rotation [deg]", "in the world [mm]"]
    headers += [] if compared is None else ["other: translation [mm]", "other: rotation [deg]"]
    rows: List[List[Any]] = []
    for name, error in ground_truth.sensors.items():
        other = [] if compared is None else _errors(compared.sensors[name])
        figures = [*_errors(error), MM_PER_M * error.world_translation_m, *other]
        rows.append([name, *map(three_digits, figures)])
    other = [] if compared is None else _errors(compared.mean)
    rows.append(["mean", *map(three_digits, [*_errors(ground_truth.mean), None, *other])])
    return text_table(headers, rows, "Errors against the truth")


def single_camera_table(
    results: Sequence[SingleCamera], compared: Sequence[SingleCamera] = ()
) -> str:
    """Return one line for each camera and pattern; empty if there is none.

    Args:
        results: of the calibration under test.
        compared: of another calibration; empty: there is none.
    """
    others = {(result.sensor, result.pattern): result.measured for result in compared}
    headers = ["camera", "pattern", "board", "coll.", "corners", "mean [px]", "RMS [px]"]
    with_truth = any(result.at_truth is not None for result in results)
    headers += ["mean at truth"] if with_truth else []
    headers += ["RMS of the other"] if compared else []
    rows: List[List[Any]] = []
    for result in results:
        if result.measured is None:
            continue
        m = result.measured
        kind = "one pose for all" if result.one_pose else "a pose for each"
        counts = [len(m.per_collection), m.pooled.points]
        figures = [_mean(m), m.rms]
        if with_truth:
            figures.append(None if result.at_truth is None else _mean(result.at_truth))
        if compared:
            other = others.get((result.sensor, result.pattern))
            figures.append(None if other is None else other.rms)
        names = [result.sensor, result.pattern, kind]
        rows.append([*names, *counts, *map(three_digits, figures)])
    title = f"Cameras by themselves: reprojection ({_AVERAGED})"
    return text_table(headers, rows, title) if rows else ""


def spread_table(results: Sequence[PairResult], compared: Sequence[PairResult] = ()) -> str:
    """Return how far apart each camera's collections put a board; empty if there is nothing.

    Args:
        results: of the calibration under test.
        compared: of another calibration; empty: there is none.
    """
    others = {result.pair: result.measured for result in compared}
    headers = ["camera", "pairs of coll.", "corners", "RMS [px]", "apart [mm]", "turned [deg]"]
    with_truth = any(result.at_truth is not None for result in results)
    headers += ["at truth [px]", "[mm]", "[deg]"] if with_truth else []
    headers += ["of the other [mm]"] if compared else []
    rows: List[List[Any]] = []
    for result in results:
        if result.measured is None:
            continue
        row: List[Any] = [result.pair.source, *_counts(result)]
        both = [result.measured, result.at_truth] if with_truth else [result.measured]
        for m in both:
            figures = (None,) * 3 if m is None else (m.rms, m.translation_mm, m.rotation_deg)
            row += map(three_digits, figures)
        if compared:
            other = others.get(result.pair)
            row.append(None if other is None else three_digits(other.translation_mm))
        rows.append(row)
    title = "Spread of fixed boards: from one collection to another"
    return text_table(headers, rows, title) if rows else ""


def hand_eye_table(comparison: HandEyeComparison) -> str:
    """Return the calibration and OpenCV's methods on the same test set, camera by camera."""
    headers = ["method", "camera", "reprojection [px]", "spread [px]", "[mm]", "[deg]"]
    known = any(score.error_m is not None for score in comparison.scores.values())
    headers += ["error [mm]", "[deg]"] if known else []
    rows: List[List[Any]] = []
    for (method, camera), score in comparison.scores.items():
        name = method if method == CALIBRATION else f"OpenCV {method}"
        row = [name, camera, *map(three_digits, score[:4])]
        error = None if score.error_m is None else MM_PER_M * score.error_m
        rows.append([*row, *map(three_digits, [error, score.error_deg])] if known else row)
    lines = [text_table(headers, rows, "Hand-eye methods on the same labels")]
    lines += [f"OpenCV {b.method}: {b.skipped}" for b in comparison.baselines if b.skipped]
    return "\n".join([*lines, *comparison.remarks])


def _with_references(
    title: str,
    headers: List[str],
    rows: List[List[Any]],
    results: Sequence[PairResult],
    compared: Optional[Evaluation],
) -> str:
    """Return the table with the floor at the truth, and the RMS of another calibration."""
    if not rows:
        return ""
    if any(result.at_truth is not None for result in results):
        headers = [*headers, "RMS at truth"]
        for row, result in zip(rows, results):
            row.append(None if result.at_truth is None else three_digits(result.at_truth.rms))
    if compared is not None:
        headers = [*headers, "RMS of the other"]
        others = {result.pair: result.measured for result in compared.pairs}
        for row, result in zip(rows, results):
            other = others.get(result.pair)
            row.append(None if other is None else three_digits(other.rms))
    return text_table(headers, rows, title)


def _mean(figures: PairFigures) -> Optional[float]:
    """Return the mean over the collections of what the mean in each is."""
    return mean_of([value.mean for value in figures.per_collection.values()])


def _has_poses(result: PairResult) -> bool:
    return result.measured is not None and result.measured.translation_mm is not None


def _counts(result: PairResult) -> List[int]:
    assert result.measured is not None
    return [len(result.measured.per_collection), result.measured.pooled.points]


def _errors(error: Union[MeanError, SensorError]) -> List[float]:
    return [MM_PER_M * error.translation_m, error.rotation_deg]


def _name(pair: Pair) -> str:
    return f"{pair.source} -> {pair.target}"
