"""Whether a rig stands as it was calibrated: verdict, table and document."""

from __future__ import annotations

from typing import Any, Dict, List

import numpy as np

from atom_core.calibration.refine.rejection import Rejected
from atom_core.evaluation.changes import FALSE_ALARMS
from atom_core.evaluation.drift import Drift, EdgeDrift
from atom_core.evaluation.edge_errors import PoseError
from atom_core.geometry.units import MM_PER_M
from atom_core.report.changes_report import (
    MOVED,
    NOT_TOLD,
    SAME,
    VERSION,
    pose_document,
    sizes,
)
from atom_core.report.tables import text_table, three_digits
from atom_core.report.verdict import (
    GOOD,
    WEAK,
    WRONG,
    Finding,
    SensorVerdict,
    Verdict,
    angle,
    caveats_first,
    counted,
    length,
    names_in_words,
    sensor_verdict,
    verdict_document,
    worst,
)

_MOST_BOARDS = 4  # in a sentence


def drift_verdict(found: Drift) -> Verdict:
    """Return the verdict on a rig that new boards were asked about."""
    if found.contested:
        return _not_told(found)
    sensors: Dict[str, SensorVerdict] = {}
    for edge in found.edges:
        sensors.update(dict.fromkeys(edge.sensors, _of_edge(edge)))
    for name in found.untold:
        sensors.setdefault(name, _untold("the new boards do not tie it to the others"))
    for name in found.reference:
        sensors.setdefault(name, SensorVerdict(GOOD, "the others are told in relation to it"))
    told = worst(sensor.grade for sensor in sensors.values())
    sensors = {name: _in_doubt(found, name, sensor) for name, sensor in sensors.items()}
    grade = worst(sensor.grade for sensor in sensors.values())
    sentence = drift_sentence(found)
    if told == GOOD:
        sentence += f", as {counted(found.boards, 'new board')} tell"
    doubtful = [name for c in found.caveats for name in c.sensors if name in sensors]
    if doubtful:
        whose = names_in_words(list(dict.fromkeys(doubtful)))
        sentence += f"; but the new recording leaves {whose} in doubt"
    return Verdict(grade, sentence, sensors)


def _in_doubt(found: Drift, name: str, sensor: SensorVerdict) -> SensorVerdict:
    """Return the verdict on a sensor with what puts its new data in doubt, first."""
    known = [] if sensor.grade == GOOD else [Finding(sensor.grade, sensor.sentence, sensor.advice)]
    facts = sensor.sentence if sensor.grade == GOOD else ""
    return sensor_verdict(caveats_first(known, name, found.caveats), facts)


def _not_told(found: Drift) -> Verdict:
    """Return the verdict where new boards say different things, which is no good answer."""
    why = "the new boards say different things"
    names = [name for edge in found.edges for name in edge.sensors]
    names += [name for name in found.reference if name not in names]
    return Verdict(WRONG, drift_sentence(found), {name: _untold(why) for name in names})


def _of_edge(edge: EdgeDrift) -> SensorVerdict:
    least = f"{length(edge.found_m)} or {angle(edge.found_rad)}"
    if edge.moved:
        moved = f"it has moved by {length(edge.change.translation_m)}"
        told = f"{moved} and {angle(edge.change.rotation_rad)}"
        return sensor_verdict([_wrong(edge, told)], "")
    if not edge.told:
        return _untold(f"only a move by {least} would be noticed")
    return SensorVerdict(GOOD, f"stands; a move by {least} would be noticed")


def _wrong(edge: EdgeDrift, told: str) -> Finding:
    doubts: List[str] = []
    if not edge.beyond_detections:
        doubts.append("unless the new labels are off")
    elif not edge.beyond_usual:
        doubts.append("unless it is for boards that stand elsewhere than before")
    return Finding(WRONG, ", ".join([told, *doubts]), "calibrate again, or put the sensor back")


def _untold(why: str) -> SensorVerdict:
    advice = "collect more new boards that it and others see"
    return sensor_verdict([Finding(WEAK, f"nothing is told of it: {why}", advice)], "")


def drift_table(found: Drift) -> str:
    """Return one line for each edge that was asked for."""
    headers = ["sensor", "shift [mm]", "turn [deg]", "chi-square", "found from [mm]", "[deg]", ""]
    rows: List[List[Any]] = []
    for edge in found.edges:
        figures = [*sizes(edge.change), edge.chi_square]
        figures += [MM_PER_M * edge.found_m, np.degrees(edge.found_rad)]
        what = "stands" if edge.told and not found.contested else "not told"
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
        f"direction that is measured worst, is noticed 95 times in a hundred"
        + "".join(f"\nleft out: {_named(rejected)}" for rejected in found.left_out)
    )


def _named(rejected: Rejected) -> str:
    key = rejected.key
    return f"{key.sensor} in collection {key.collection}, since {rejected.reason}"


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
        by = by if len(names) == 1 else ""
        return f"the rig has moved: {names_in_words(names)}{by}{rivals}{_only_by(found)}"
    if found.disagreement is not None:
        return f"whether the rig has moved is not told: {_disagreement(found)}"
    if found.contested:
        return (
            f"whether the rig has moved is not told: the new boards contradict themselves: "
            f"{found.contradiction}"
        )
    if found.untold:
        return (
            f"nothing is seen to have moved, but of {names_in_words(found.untold)} nothing is told"
        )
    return "the rig stands as described"


def _only_by(found: Drift) -> str:
    if found.contradiction is not None:
        return f"; but the new boards contradict themselves: {found.contradiction}"
    if found.rests_on is None:
        return ""
    return (
        f"; or the labels of collection {found.rests_on} are off, without which nothing is seen to "
        f"have moved: look at them first"
    )


def _disagreement(found: Drift) -> str:
    assert found.disagreement is not None
    edge, odd, others = found.disagreement
    name = next((", ".join(e.sensors) for e in found.edges if e.edge == edge), str(edge))
    told = [_by_board(odd.collection, odd.change)]
    told += [_by_board(other.collection, other.change) for other in others]
    hint = "look at their labels"
    if len(others) > 1:
        hint = f"look at the labels of {odd.collection} first, or leave it out (-csf)"
    where = "; ".join(told[:_MOST_BOARDS])
    return (
        f"the new boards disagree on {name}, which stands elsewhere {where}: {hint}; did a board "
        f"move while the sensors looked at it? Collect others"
    )


def _by_board(collection: str, change: PoseError) -> str:
    size = f"{length(change.translation_m)} and {angle(change.rotation_rad)}"
    return f"by {size} in collection {collection}"


def drift_document(found: Drift, dataset: str, against: str) -> Dict[str, Any]:
    """Return the document ``drift.json``; SI units."""
    return {
        "version": VERSION,
        "dataset": dataset,
        "against": against,
        "moved": bool(found.moved),
        "verdict": verdict_document(drift_verdict(found)),
        "sentence": drift_sentence(found),
        "false_alarm_rate": FALSE_ALARMS,
        "reference": list(found.reference),
        "boards": found.boards,
        "limit_chi_square": found.limit,
        "edges": {str(edge.edge): _edge(edge, found) for edge in found.edges},
        "not_told": list(found.untold),
        "contradiction": found.contradiction,
        "disagree": found.disagreement and found.disagreement.odd.collection,
        "rests_on": found.rests_on,
        "left_out": [{**r.key._asdict(), "reason": r.reason} for r in found.left_out],
    }


def _edge(edge: EdgeDrift, found: Drift) -> Dict[str, Any]:
    verdict = MOVED if edge.moved else SAME if edge.told else NOT_TOLD
    return {
        "sensors": list(edge.sensors),
        **pose_document(edge.change),
        "chi_square": edge.chi_square,
        "verdict": NOT_TOLD if found.contested else verdict,
        "beyond_detection_errors": edge.beyond_detections,
        "beyond_usual_errors": edge.beyond_usual,
        "found_from_m": edge.found_m,
        "found_from_rad": edge.found_rad,
    }
