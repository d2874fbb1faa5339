"""What a calibration says where it is asked without a truth: a line each, and a document."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence

from atom_core.evaluation.trust.checks import WORSE, Compared, Predicted, Trust
from atom_core.report.verdict import angle, distance, length, names_in_words

AGREE, DIFFER = "agree", "differ"


def trust_lines(trust: Trust) -> str:
    """Return a line for each of the three questions, and why one could not be asked."""
    lines = ["Checks without a truth"]
    if trust.halves:
        told = _told(trust.halves, trust.halves_limit)
        lines.append(f"  two halves of the collections: {told}")
    if trust.left_out:
        told = _told([found.compared for found in trust.left_out], trust.left_out_limit)
        worst = max(trust.left_out, key=lambda found: found.ratio)
        told += f"; {_residuals(worst)}"
        lines.append(f"  each sensor by the boards of the others: {told}")
    if trust.loops:
        told = _told(trust.loops, trust.loops_limit)
        lines.append(f"  {len(trust.loops)} loops of three sensors: {told}")
    lines += [f"  not asked: {why}" for why in trust.untold]
    return "\n".join(lines)


def _told(found: Sequence[Compared], limit: float) -> str:
    worst = max(found, key=lambda one: one.sigmas)
    verb = DIFFER if worst.sigmas > limit else AGREE
    off = f"{length(worst.translation_m)} and {angle(worst.rotation_rad)}"
    return (
        f"{verb}, at most by {worst.sigmas:.1f} sigmas ({', '.join(worst.names)}: {off}; beyond "
        f"{limit:.1f} in one of a hundred sound rigs)"
    )


def _residuals(found: Predicted) -> str:
    name = found.compared.names[0]
    there, here = (distance(found.kind, value) for value in (found.predicted, found.joint))
    return f"{name} {there} off in the mean, {here} in the solution"


def contradictions(trust: Optional[Trust]) -> List[str]:
    """Return what speaks against the calibration, worst of each question."""
    if trust is None:
        return []
    found = []
    halves = [one for one in trust.halves if one.sigmas > trust.halves_limit]
    if halves:
        names = names_in_words([one.names[0] for one in halves])
        found.append(f"two halves of the collections put {names} in different places")
    for one in trust.left_out:
        apart = one.compared.sigmas > trust.left_out_limit
        if apart or one.ratio > WORSE:
            name = one.compared.names[0]
            found.append(f"the boards of the others do not fit {name}: {_residuals(one)}")
    loops = [one for one in trust.loops if one.sigmas > trust.loops_limit]
    if loops:
        worst = max(loops, key=lambda one: one.sigmas)
        off = f"{length(worst.translation_m)} and {angle(worst.rotation_rad)}"
        names = names_in_words(list(worst.names))
        found.append(f"{len(loops)} of {len(trust.loops)} loops do not close ({names}: {off})")
    return found


def trust_document(trust: Trust) -> Dict[str, Any]:
    """Return the entry ``trust_checks`` of ``calibration.json``; SI units."""
    return {
        "agree": not contradictions(trust),
        "contradictions": contradictions(trust),
        "split_half": {
            "limit_sigmas": trust.halves_limit,
            "sensors": {one.names[0]: _compared(one) for one in trust.halves},
        },
        "leave_one_out": {
            "limit_sigmas": trust.left_out_limit,
            "limit_ratio": WORSE,
            "sensors": {
                one.compared.names[0]: {
                    **_compared(one.compared),
                    "kind": one.kind,
                    "joint_mean": one.joint,
                    "predicted_mean": one.predicted,
                }
                for one in trust.left_out
            },
        },
        "loops": {
            "limit_sigmas": trust.loops_limit,
            "triangles": [{"sensors": list(one.names), **_compared(one)} for one in trust.loops],
        },
        "not_asked": list(trust.untold),
    }


def _compared(one: Compared) -> Dict[str, float]:
    return {
        "sigmas": one.sigmas,
        "translation_m": one.translation_m,
        "rotation_rad": one.rotation_rad,
    }
