"""Baselines beside a calibration: tables, and entries of ``evaluation.json``."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence

from atom_core.evaluation.baselines.comparison import LinkScore, PairScore, PoseError, RigComparison
from atom_core.geometry.units import MM_PER_M
from atom_core.report.tables import text_table, three_digits


def baseline_document(comparison: RigComparison) -> Dict[str, Any]:
    """Return the entry of a method, without the results of the rig as a whole."""
    rig = comparison.rig
    return {
        "links": [_link(score) for score in comparison.links],
        "not_solved": [
            {"source": source, "target": target, "why": why}
            for (source, target), why in rig.unsolved.items()
        ],
        "reference": comparison.reference,
        "sensors": {
            name: {**_pose("", score.error), **_pose("calibration_", score.calibration)}
            for name, score in (comparison.sensors or {}).items()
        },
        "remarks": list(rig.remarks),
        "skipped": None if rig.links else skipped(comparison),
    }


def _link(score: LinkScore) -> Dict[str, Any]:
    return {
        "source": score.link.source,
        "target": score.link.target,
        "collections": score.link.collections,
        "pairs": [_pair(pair) for pair in score.pairs],
        **_pose("", score.error),
        **_pose("calibration_", score.calibration),
    }


def _pair(score: PairScore) -> Dict[str, Any]:
    return {
        "source": score.pair.source,
        "target": score.pair.target,
        "kind": score.pair.kind.name,
        "unit": score.pair.kind.unit,
        "rms": score.rms,
        "calibration_rms": score.calibration,
        "at_truth_rms": score.at_truth,
    }


def _pose(prefix: str, error: Optional[PoseError]) -> Dict[str, Optional[float]]:
    return {
        f"{prefix}translation_error_m": None if error is None else error.translation_m,
        f"{prefix}rotation_error_deg": None if error is None else error.rotation_deg,
    }


def skipped(comparison: RigComparison) -> str:
    """Return why a method has no answer at all."""
    reasons = list(dict.fromkeys(comparison.rig.unsolved.values()))
    return "; ".join(reasons) if reasons else "there are no two sensors of its kinds"


def baseline_tables(comparisons: Sequence[RigComparison], verbose: bool = False) -> str:
    """Return tables of pairs and of sensors, and what could not be solved; empty without any."""
    solved = [c for c in comparisons if c.links]
    parts = [_pair_table(solved, verbose), _sensor_table(solved), _left_open(comparisons)]
    return "\n\n".join(part for part in parts if part)


def _pair_table(comparisons: Sequence[RigComparison], verbose: bool) -> str:
    headers = ["method", "kind", "source", "target", "unit", "RMS", "RMS here"]
    known = any(score.error is not None for c in comparisons for score in c.links)
    headers += ["RMS at truth", "off [mm]", "[deg]", "here [mm]", "[deg]"] if known else []
    rows: List[List[Any]] = []
    for comparison in comparisons:
        for link in comparison.links:
            for pair in link.pairs:
                if pair.pair.kind.floor and not verbose:
                    continue
                names = [comparison.rig.method, pair.pair.kind.name]
                names += [pair.pair.source, pair.pair.target, pair.pair.kind.unit]
                figures = [pair.rms, pair.calibration]
                if known:
                    figures += [pair.at_truth, *_errors(link.error), *_errors(link.calibration)]
                rows.append([*names, *map(three_digits, figures)])
    title = "Baselines, two sensors at a time (here: this calibration)"
    return text_table(headers, rows, title) if rows else ""


def _sensor_table(comparisons: Sequence[RigComparison]) -> str:
    headers = ["method", "sensor", "in", "off [mm]", "[deg]", "here [mm]", "[deg]", "times"]
    rows: List[List[Any]] = []
    for comparison in comparisons:
        for name, score in (comparison.sensors or {}).items():
            ours = score.calibration.translation_m
            times = score.error.translation_m / ours if ours > 0.0 else None
            figures = [*_errors(score.error), *_errors(score.calibration), times]
            names = [comparison.rig.method, name, comparison.reference]
            rows.append([*names, *map(three_digits, figures)])
    title = "Baselines put together to a rig: errors against the truth (here: this calibration)"
    return text_table(headers, rows, title) if rows else ""


def _left_open(comparisons: Sequence[RigComparison]) -> str:
    """Return a line for each pair that a method could not solve, and for each remark."""
    lines = []
    for comparison in comparisons:
        rig = comparison.rig
        if not rig.links:
            lines.append(f"{rig.method}: no result: {skipped(comparison)}")
            continue
        lines += [f"{rig.method}: {a} and {b}: {why}" for (a, b), why in rig.unsolved.items()]
        lines += list(rig.remarks)
    return "\n".join(lines)


def _errors(error: Optional[PoseError]) -> List[Optional[float]]:
    if error is None:
        return [None, None]
    return [MM_PER_M * error.translation_m, error.rotation_deg]
