"""One CSV file for each kind of pair: a line for each collection, pattern and pair.

The columns of ATOM's tables, in long form: source, target and pattern stand in each line, so that
no pair or pattern writes over another one.
"""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Tuple, Union

from atom_core.evaluation.evaluate import Evaluation
from atom_core.evaluation.pairs import PairKind
from atom_core.evaluation.results import PairFigures, PairResult
from atom_core.evaluation.statistics import Figures
from atom_core.report.tables import AVERAGES, csv_table

DECIMALS = 4  # as ATOM rounds


def csv_texts(evaluation: Evaluation) -> Dict[str, str]:
    """Return the text of each file by its name, as ``rgb-rgb.csv``; skipped pairs have no lines."""
    by_kind: Dict[PairKind, List[PairResult]] = {}
    for result in evaluation.pairs:
        if result.measured is not None:
            by_kind.setdefault(result.pair.kind, []).append(result)
    return {csv_name(kind): _text(kind, results) for kind, results in by_kind.items()}


def csv_name(kind: PairKind) -> str:
    """Return the name of a kind's file."""
    return f"{kind.name}.csv"


def _text(kind: PairKind, results: List[PairResult]) -> str:
    columns = _columns(kind)
    extra = ["Points", "RMS at truth", "Reverse"]
    headers = ["source", "target", "pattern", "Collection #", *columns, *extra]
    lines = (line for result in results for line in _lines(result, list(columns.values())))
    return csv_table([headers, *lines])


def _columns(kind: PairKind) -> Dict[str, str]:
    """Return the figure of each column by its header."""
    unit = {"px": "pix"}.get(kind.unit, kind.unit)
    columns = {f"RMS ({unit})": "rms"}
    if kind.unit == "px":
        columns.update({"X err (pix)": "x_mean_abs", "Y err (pix)": "y_mean_abs"})
    if kind.name == "rgb-rgb":
        columns.update({"Trans (mm)": "translation_mm", "Rot (deg)": "rotation_deg"})
    return columns


def _lines(result: PairResult, names: List[str]) -> List[List[Any]]:
    pair, measured, truth = result.pair, result.measured, result.at_truth
    assert measured is not None
    floors = {} if truth is None else {(r.collection, r.pattern): r.figures for r in truth.rows}

    def line(
        place: Tuple[str, str],
        values: Union[Figures, PairFigures],
        points: int,
        floor: Union[Figures, PairFigures, None],
    ) -> List[Any]:
        collection, pattern = place
        numbers = [_rounded(getattr(values, name)) for name in names]
        floor_rms = None if floor is None else floor.rms
        reverse = "yes" if pair.reverse else "no"
        start = [pair.source, pair.target, pattern, collection]
        return [*start, *numbers, points, _rounded(floor_rms), reverse]

    lines = [
        line(
            (row.collection, row.pattern),
            row.figures,
            row.figures.points,
            floors.get((row.collection, row.pattern)),
        )
        for row in measured.rows
    ]
    return [*lines, line((AVERAGES, ""), measured, measured.pooled.points, truth)]


def _rounded(value: Optional[float]) -> str:
    return "" if value is None else f"{value:.{DECIMALS}f}"
