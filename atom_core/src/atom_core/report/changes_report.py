"""What has changed between two calibrations, or since one: tables and documents."""

from __future__ import annotations

from typing import Any, Dict, List

import numpy as np

from atom_core.evaluation.changes import FALSE_ALARMS, Changes, EdgeChange
from atom_core.evaluation.drift import Drift, EdgeDrift
from atom_core.evaluation.edge_errors import PoseError
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.report.tables import text_table, three_digits
from atom_core.report.verdict import angle, length, names_in_words

MM_PER_M = 1000.0
VERSION = "1.0"
SAME, MOVED, NOT_TOLD = "same", "moved", "not_told"


def changes_table(found: Changes) -> str:
    """Return one line for each edge, and what is not compared."""
    headers = ["edge", "sensors", "shift [mm]", "turn [deg]", "sigma [mm]", "[deg]", "chi-square"]
    rows: List[List[Any]] = []
    for change in found.edges:
        sigma = [MM_PER_M * np.max(change.sigma[TRANSLATION])]
        sigma.append(np.degrees(np.max(change.sigma[ROTATION])))
        figures = [*_sizes(change.change), *sigma, change.chi_square]
        names = [str(change.edge), ", ".join(change.sensors)]
        rows.append([*names, *map(three_digits, figures), _verdict(change)])
    lines = [text_table([*headers, ""], rows, "The second calibration against the first")]
    lines.append(
        f"moved: chi-square of the six numbers in their joint covariance beyond {found.limit:.1f}, "
        f"as of one rig in a hundred that did not move"
    )
    lines += [f"held in both, not compared: {edge}" for edge in found.held]
    lines += [f"in one of the two only: {edge}" for edge in found.only_in_one]
    return "\n".join(lines)


def _verdict(change: EdgeChange) -> str:
    if not change.moved:
        return SAME if change.told else "not told"
    return MOVED if change.beyond_usual else f"{MOVED}, or boards stood elsewhere"


def changes_sentence(found: Changes) -> str:
    """Return whether anything moved, in one sentence."""
    names = [", ".join(change.sensors) or str(change.edge) for change in found.moved]
    if not found.edges:
        return "nothing can be compared: no edge was estimated in both"
    untold = [", ".join(change.sensors) or str(change.edge) for change in found.untold]
    if not names and untold:
        return f"nothing is seen to differ, but of {names_in_words(untold)} nothing is told"
    if not names:
        return "the two calibrations are the same, as far as they can tell"
    return f"the two calibrations differ: {names_in_words(names)} moved"


def changes_document(found: Changes, before: str, after: str) -> Dict[str, Any]:
    """Return the document ``comparison.json``; SI units."""
    return {
        "version": VERSION,
        "before": before,
        "after": after,
        "moved": bool(found.moved),
        "sentence": changes_sentence(found),
        "false_alarm_rate": FALSE_ALARMS,
        "limit_chi_square": found.limit,
        "edges": {
            str(change.edge): {
                "sensors": list(change.sensors),
                **_pose(change.change),
                "sigma_translation_m": change.sigma[TRANSLATION].tolist(),
                "sigma_rotation_rad": change.sigma[ROTATION].tolist(),
                "chi_square": change.chi_square,
                "verdict": MOVED if change.moved else SAME if change.told else NOT_TOLD,
                "beyond_usual_errors": change.beyond_usual,
            }
            for change in found.edges
        },
        "held": [str(edge) for edge in found.held],
        "only_in_one": [str(edge) for edge in found.only_in_one],
    }


def drift_table(found: Drift) -> str:
    """Return one line for each edge that was asked for."""
    headers = ["sensor", "shift [mm]", "turn [deg]", "chi-square", "found from [mm]", "[deg]", ""]
    rows: List[List[Any]] = []
    for edge in found.edges:
        figures = [*_sizes(edge.change), edge.chi_square]
        figures += [MM_PER_M * edge.found_m, np.degrees(edge.found_rad)]
        what = "stands" if edge.told else "not told"
        if edge.moved:
            what = _moved(edge)
        rows.append([", ".join(edge.sensors) or edge.edge, *map(three_digits, figures), what])
    held = names_in_words(found.reference) if found.reference else "the fixed boards"
    held_too = ", all others held," if len(found.edges) > 1 else ""
    title = f"Against the description, by {found.boards} new boards, in relation to {held}"
    return (
        f"{text_table(headers, rows, title)}\n"
        f"moved: chi-square of the six numbers{held_too} beyond {found.limit:.1f}, as of one rig "
        f"in a hundred that did not move; found from: a shift or turn of this size, in the "
        f"direction that is told worst, is noticed 95 times in a hundred"
    )


def _moved(edge: EdgeDrift) -> str:
    if not edge.beyond_detections:
        return f"{MOVED}, or new labels are off"
    return MOVED if edge.beyond_usual else f"{MOVED}, or boards stand elsewhere"


def drift_sentence(found: Drift) -> str:
    """Return whether the rig stands, in one sentence."""
    if found.moved:
        names = [", ".join(edge.sensors) or str(edge.edge) for edge in found.moved]
        moved = found.moved[0].change
        by = f" by {length(moved.translation_m)} and {angle(moved.rotation_rad)}"
        rivals = ""
        if len(found.edges) == 1 and found.reference:
            rivals = f" (or {names_in_words(found.reference)}: two sensors do not tell which)"
        return f"the rig has moved: {names_in_words(names)}{by if len(names) == 1 else ''}{rivals}"
    if found.untold:
        return (
            f"nothing is seen to have moved, but of {names_in_words(found.untold)} nothing is told"
        )
    return "the rig stands as described"


def drift_document(found: Drift, dataset: str, against: str) -> Dict[str, Any]:
    """Return the document ``drift.json``; SI units."""
    return {
        "version": VERSION,
        "dataset": dataset,
        "against": against,
        "moved": bool(found.moved),
        "sentence": drift_sentence(found),
        "false_alarm_rate": FALSE_ALARMS,
        "reference": list(found.reference),
        "boards": found.boards,
        "limit_chi_square": found.limit,
        "edges": {str(edge.edge): _edge(edge) for edge in found.edges},
        "not_told": list(found.untold),
        "contradiction": found.contradiction,
    }


def _edge(edge: EdgeDrift) -> Dict[str, Any]:
    return {
        "sensors": list(edge.sensors),
        **_pose(edge.change),
        "chi_square": edge.chi_square,
        "verdict": MOVED if edge.moved else SAME if edge.told else NOT_TOLD,
        "beyond_detection_errors": edge.beyond_detections,
        "beyond_usual_errors": edge.beyond_usual,
        "found_from_m": edge.found_m,
        "found_from_rad": edge.found_rad,
    }


def _pose(change: PoseError) -> Dict[str, Any]:
    return {
        "shift_m": change.shift_m.tolist(),
        "turn_rad": change.turn_rad.tolist(),
        "translation_m": change.translation_m,
        "rotation_rad": change.rotation_rad,
    }


def _sizes(change: PoseError) -> List[float]:
    return [MM_PER_M * change.translation_m, float(np.degrees(change.rotation_rad))]
