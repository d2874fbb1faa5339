"""Errors of edges, boards and joints against the truth: as tables and as a document."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from atom_core.evaluation.edge_errors import EdgeError, JointError, PoseError
from atom_core.report.tables import text_table

_MM = 1e3
_AXES = ("x", "y", "z")


def truth_tables(edges: Sequence[EdgeError], joints: Sequence[JointError]) -> List[str]:
    """Return the tables; edges with a value for each collection are one line, of their means."""
    tables = []
    rows = [_row(group) for group in _groups(edges)]
    if rows:
        headers = ["Edge", "Of", "Start [mm]", "Now [mm]", "Start [deg]", "Now [deg]"]
        headers += [f"{axis} [mm]" for axis in _AXES] + [f"about {axis} [deg]" for axis in _AXES]
        title = "Errors of edges against truth (axes of the parent)"
        tables.append(text_table(headers, rows, title, 3))
    if joints:
        cells = [[e.joint, e.parameter, *_shown(e)] for e in joints]
        headers = ["Joint", "Parameter", "Start", "Now", "[]"]
        tables.append(text_table(headers, cells, "Errors of joints against truth", 4))
    return tables


def _groups(edges: Sequence[EdgeError]) -> List[List[EdgeError]]:
    groups: Dict[Any, List[EdgeError]] = {}
    for error in edges:
        groups.setdefault((error.edge, error.name), []).append(error)
    return list(groups.values())


def _row(group: Sequence[EdgeError]) -> List[Any]:
    first = group[0]
    several = first.collection is not None
    name = f"{first.name} (mean of {len(group)})" if several else first.name
    known = [error.before for error in group if error.before is not None]
    after = [error.after for error in group]
    row: List[Any] = [str(first.edge), name]
    row += [_mean([_MM * e.translation_m for e in errors]) for errors in (known, after)]
    row += [_mean([math.degrees(e.rotation_rad) for e in errors]) for errors in (known, after)]
    shifts = np.mean([_MM * e.shift_m for e in after], axis=0)
    turns = np.mean([np.degrees(e.turn_rad) for e in after], axis=0)
    return [*row, *(float(v) for v in shifts), *(float(v) for v in turns)]


def _mean(values: Sequence[float]) -> Optional[float]:
    return float(np.mean(values)) if values else None


def _shown(error: JointError) -> List[Any]:
    """Return both errors in mm or deg, and which."""
    if error.unit == "m":
        return [_MM * error.before, _MM * error.after, "mm"]
    return [math.degrees(error.before), math.degrees(error.after), "deg"]


def truth_document(edges: Sequence[EdgeError], joints: Sequence[JointError]) -> Dict[str, Any]:
    """Return the errors, found minus true, in SI units, along and about the parents' axes."""
    document: Dict[str, Any] = {"edges": [_edge(error) for error in edges]}
    if joints:
        document["joints"] = [error._asdict() for error in joints]
    return document


def _edge(error: EdgeError) -> Dict[str, Any]:
    return {
        "parent": error.edge.parent,
        "child": error.edge.child,
        "name": error.name,
        "collection": error.collection,
        **({} if error.before is None else {"before": _pose(error.before)}),
        "after": _pose(error.after),
    }


def _pose(error: PoseError) -> Dict[str, Any]:
    return {
        "translation_m": error.shift_m.tolist(),
        "rotation_rad": error.turn_rad.tolist(),
        "translation_error_m": error.translation_m,
        "rotation_error_rad": error.rotation_rad,
    }
