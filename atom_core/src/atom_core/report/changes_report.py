"""What has changed between two calibrations: table and document."""

from __future__ import annotations

from typing import Any, Dict, List, Sequence, Union

import numpy as np

from atom_core.evaluation.changes import FALSE_ALARMS, Changes, EdgeChange, JointChange
from atom_core.evaluation.edge_errors import PoseError
from atom_core.geometry.units import MM_PER_M
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.report.tables import text_table, three_digits
from atom_core.report.verdict import (
    GOOD,
    WEAK,
    WRONG,
    Verdict,
    names_in_words,
    verdict_document,
)

VERSION = "1.0"
SAME, MOVED, NOT_TOLD = "same", "moved", "not_told"


def changes_table(found: Changes) -> str:
    """Return one line for each edge, and what is not compared."""
    headers = ["edge", "sensors", "shift [mm]", "turn [deg]", "sigma [mm]", "[deg]", "chi-square"]
    rows: List[List[Any]] = []
    for change in found.edges:
        sigma = [MM_PER_M * np.max(change.sigma[TRANSLATION])]
        sigma.append(np.degrees(np.max(change.sigma[ROTATION])))
        figures = [*sizes(change.change), *sigma, change.chi_square]
        names = [str(change.edge), ", ".join(change.sensors)]
        rows.append([*names, *map(three_digits, figures), _verdict(change)])
    rows += [_joint_row(joint) for joint in found.joints]
    lines = [text_table([*headers, ""], rows, "The second calibration against the first")]
    numbers = f"the six numbers in their joint covariance beyond {found.limit:.1f}"
    if found.joints:
        numbers += f", of a joint's one number beyond {found.joint_limit:.1f}"
    lines.append(f"moved: chi-square of {numbers}, as of one rig in a hundred that did not move")
    lines += [f"held in both, not compared: {edge}" for edge in found.held]
    lines += [
        f"has a value for each collection, not compared: {edge}" for edge in found.by_collection
    ]
    lines += [f"in one of the two only: {name}" for name in found.only_in_one]
    return "\n".join(lines)


def _joint_row(joint: JointChange) -> List[Any]:
    in_mm: List[Any] = ["", ""]
    in_deg: List[Any] = ["", ""]
    if joint.unit == "rad":
        in_deg = [three_digits(np.degrees(v)) for v in (joint.change, joint.sigma)]
    else:
        in_mm = [three_digits(MM_PER_M * v) for v in (joint.change, joint.sigma)]
    figures = [in_mm[0], in_deg[0], in_mm[1], in_deg[1], three_digits(joint.chi_square)]
    return [joint.name, "joint", *figures, _verdict(joint)]


def _verdict(change: Union[EdgeChange, JointChange]) -> str:
    if not change.moved:
        return SAME if change.told else "not told"
    return MOVED if change.beyond_usual else f"{MOVED}, or boards stood elsewhere"


def changes_sentence(found: Changes) -> str:
    """Return whether anything moved, in one sentence."""
    names = [change.name for change in found.moved]
    if not found.compared:
        return "nothing can be compared: no edge was estimated in both"
    untold = [change.name for change in found.untold]
    if not names and untold:
        return f"nothing is seen to differ, but of {names_in_words(untold)} nothing is told"
    if not names and found.lacking:
        return (
            f"nothing is seen to differ, but of {names_in_words(found.lacking)} nothing is told: "
            f"{'it is' if len(found.lacking) == 1 else 'they are'} in one of the two only"
        )
    if not names:
        return "the two calibrations are the same, as far as they can tell"
    rival = ""
    if found.reference and len(names) == len(found.compared):
        rival = f" (or {names_in_words(found.reference)}, against which the others are told)"
    return f"the two calibrations differ: {names_in_words(names)} moved{rival}"


def changes_verdict(found: Changes, warnings: Sequence[str] = ()) -> Verdict:
    """Return the verdict on a rig that was calibrated twice.

    Args:
        found: what differs.
        warnings: why that may not be all.
    """
    is_all = bool(found.compared) and not (found.untold or found.lacking or warnings)
    grade = WRONG if found.moved else GOOD if is_all else WEAK
    return Verdict(grade, changes_sentence(found), {})


def changes_document(
    found: Changes, before: str, after: str, warnings: Sequence[str] = ()
) -> Dict[str, Any]:
    """Return the document ``comparison.json``; SI units."""
    return {
        "version": VERSION,
        "before": before,
        "after": after,
        "moved": bool(found.moved),
        "sentence": changes_sentence(found),
        "verdict": verdict_document(changes_verdict(found, warnings)),
        "warnings": list(warnings),
        "false_alarm_rate": FALSE_ALARMS,
        "limit_chi_square": found.limit,
        "limit_chi_square_of_joints": found.joint_limit if found.joints else None,
        "edges": {
            str(change.edge): {
                "sensors": list(change.sensors),
                **pose_document(change.change),
                "sigma_translation_m": change.sigma[TRANSLATION].tolist(),
                "sigma_rotation_rad": change.sigma[ROTATION].tolist(),
                "chi_square": change.chi_square,
                **_answer(change),
            }
            for change in found.edges
        },
        "joints": {
            joint.name: {
                "unit": joint.unit,
                "change": joint.change,
                "sigma": joint.sigma,
                "chi_square": joint.chi_square,
                **_answer(joint),
            }
            for joint in found.joints
        },
        "held": [str(edge) for edge in found.held],
        "by_collection": [str(edge) for edge in found.by_collection],
        "only_in_one": list(found.only_in_one),
    }


def _answer(change: Union[EdgeChange, JointChange]) -> Dict[str, Any]:
    return {
        "verdict": MOVED if change.moved else SAME if change.told else NOT_TOLD,
        "beyond_usual_errors": change.beyond_usual,
    }


def pose_document(change: PoseError) -> Dict[str, Any]:
    """Return a change of an edge for a document."""
    return {
        "shift_m": change.shift_m.tolist(),
        "turn_rad": change.turn_rad.tolist(),
        "translation_m": change.translation_m,
        "rotation_rad": change.rotation_rad,
    }


def sizes(change: PoseError) -> List[float]:
    """Return how far an edge shifted [mm] and turned [deg]."""
    return [MM_PER_M * change.translation_m, float(np.degrees(change.rotation_rad))]
