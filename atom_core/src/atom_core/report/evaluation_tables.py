"""The tables that ``evaluate`` prints."""

from __future__ import annotations

from typing import Any, Dict, List, Optional

from atom_core.evaluation.evaluate import Evaluation, PairResult
from atom_core.evaluation.ground_truth import MEAN
from atom_core.evaluation.pairs import Pair
from atom_core.report.tables import text_table

MM_PER_M = 1000.0


def evaluation_report(
    evaluation: Evaluation, compared: Optional[Evaluation] = None, verbose: bool = False
) -> str:
    """Return all tables as one text.

    Args:
        evaluation: of the calibration under test.
        compared: of another calibration on the same test set; stands beside it.
        verbose: also the reverse pairs, and a line for each collection.
    """
    parts = [pair_table(evaluation, compared, reverse=verbose)]
    if verbose:
        parts += [collection_table(result) for result in evaluation.pairs if result.measured]
    parts += [averages_table(evaluation, compared), skipped_table(evaluation)]
    if evaluation.ground_truth is not None:
        parts.append(ground_truth_table(evaluation.ground_truth, _truth_of(compared)))
    return "\n\n".join(part for part in parts if part)


def pair_table(
    evaluation: Evaluation, compared: Optional[Evaluation] = None, reverse: bool = False
) -> str:
    """Return one line for each measured pair; empty if there is none."""
    other = {} if compared is None else {r.pair: r for r in compared.pairs}
    headers = ["kind", "source", "target", "unit", "coll.", "points", "RMS", "mean", "median"]
    headers += ["trans. [mm]", "rot. [deg]", "RMS at truth"]
    rows = []
    for result in evaluation.pairs:
        if result.measured is None or (result.pair.reverse and not reverse):
            continue
        line = _pair_line(result)
        if compared is not None:
            line.append(_rms(other.get(result.pair)))
        rows.append(line)
    if compared is not None:
        headers.append("RMS of the other")
    return text_table(headers, rows, "Pairs of sensors") if rows else ""


def _pair_line(result: PairResult) -> List[Any]:
    pair, m = result.pair, result.measured
    assert m is not None
    figures = [m.rms, m.pooled.mean, m.pooled.median, m.translation_mm, m.rotation_deg]
    floor = None if result.at_truth is None else result.at_truth.rms
    counts = [len(m.per_collection), m.pooled.points]
    return [pair.kind.name, pair.source, pair.target, pair.kind.unit, *counts, *figures, floor]


def _rms(result: Optional[PairResult]) -> Optional[float]:
    return None if result is None or result.measured is None else result.measured.rms


def collection_table(result: PairResult) -> str:
    """Return one line for each collection and pattern of a measured pair."""
    assert result.measured is not None
    headers = ["collection", "pattern", "points", "RMS", "mean", "median", "X", "Y"]
    headers += ["trans. [mm]", "rot. [deg]"]
    rows = []
    for row in result.measured.rows:
        f = row.figures
        figures = [f.rms, f.mean, f.median, f.x_mean_abs, f.y_mean_abs]
        pose = [f.translation_mm, f.rotation_deg]
        rows.append([row.collection, row.pattern, f.points, *figures, *pose])
    title = f"{result.pair.kind.name} [{result.pair.kind.unit}]: {_name(result.pair)}"
    return text_table(headers, rows, title)


def averages_table(evaluation: Evaluation, compared: Optional[Evaluation] = None) -> str:
    """Return the averages over the pairs of each kind, the floor at the truth beside them."""
    headers = ["kind", "unit", "pairs", "RMS", "RMS at truth", "above truth"]
    rows: List[List[Any]] = []
    for kind, average in evaluation.averages.items():
        rms, floor = average.values["rms"], average.at_truth
        above = None if floor is None else rms - floor
        row = [kind, average.unit, average.pairs, rms, floor, above]
        if compared is not None:
            other = compared.averages.get(kind)
            row.append(None if other is None else other.values["rms"])
        rows.append(row)
    if compared is not None:
        headers.append("RMS of the other")
    return text_table(headers, rows, "Averages") if rows else ""


def skipped_table(evaluation: Evaluation) -> str:
    """Return the pairs that were not measured, and why; empty if there is none."""
    rows: Dict[str, List[str]] = {}
    for result in evaluation.pairs:
        if result.skipped and not result.pair.reverse:
            line = [result.pair.kind.name, _name(result.pair), result.skipped]
            rows["|".join(line)] = line
    return text_table(["kind", "pair", "why"], list(rows.values()), "Skipped") if rows else ""


def ground_truth_table(ground_truth: Any, compared: Any = None) -> str:
    """Return the sensors' errors against the truth.

    Args:
        ground_truth: as `ground_truth_errors` returns it.
        compared: the same of another calibration, or None.
    """
    headers = ["sensor", "translation [mm]", "rotation [deg]", "in the world [mm]"]
    if compared is not None:
        headers += ["other: translation [mm]", "other: rotation [deg]"]
    names = [name for name in ground_truth if name != MEAN] + [MEAN]
    rows = []
    for name in names:
        row = [
            name,
            *_errors(ground_truth[name]),
            _mm(ground_truth[name], "world_translation_error_m"),
        ]
        rows.append(row if compared is None else row + _errors(compared[name]))
    return text_table(headers, rows, "Errors against the truth")


def _errors(entry: Any) -> List[Optional[float]]:
    return [_mm(entry, "translation_error_m"), entry["rotation_error_deg"]]


def _mm(entry: Any, figure: str) -> Optional[float]:
    return MM_PER_M * entry[figure] if figure in entry else None


def _truth_of(evaluation: Optional[Evaluation]) -> Any:
    return None if evaluation is None else evaluation.ground_truth


def _name(pair: Pair) -> str:
    return f"{pair.source} -> {pair.target}"
