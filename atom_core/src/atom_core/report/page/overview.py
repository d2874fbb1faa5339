"""The first screen: one sentence and one colour for the rig, one line for each sensor."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Tuple

from atom_core.labeling.guidance import Guidance
from atom_core.report.calibration_verdict import MORE_BOARDS
from atom_core.report.changes_report import MOVED, NOT_TOLD
from atom_core.report.page.blocks import SensorLine
from atom_core.report.page.given import Document, Given, verdict_of
from atom_core.report.verdict import GOOD, GRADES, WEAK, WRONG, angle, is_named, length

UNKNOWN = "unknown"
NOT_DETERMINED = "not determined"
_WHAT = {
    "calibration": "The calibration",
    "evaluation": "The test set",
    "changes": "Has it moved",
}
_NO_VERDICT = (
    "The result has no verdict: it was written by an older version; calibrate or evaluate again."
)


def sentences(given: Given) -> Tuple[str, str, str]:
    """Return the grade of the rig, its sentence, and those of the other results.

    Of several results the worst one speaks first.
    """
    found = [
        (verdict_of(document), word)
        for document, word in ((given.calibration, "calibration"), (given.evaluation, "evaluation"))
        if document is not None and verdict_of(document)
    ]
    found += [(_of_changes(document), "changes") for document in given.changes]
    if not found:
        return UNKNOWN, _NO_VERDICT, ""
    found.sort(key=lambda pair: -_rank(str(pair[0]["grade"])))
    first, *others = found
    told = [_sentence(verdict["sentence"]) for verdict, _ in found]
    also = [
        f"{_WHAT[word]}: {verdict['grade']}. {sentence}"
        for (verdict, word), sentence in zip(others, told[1:])
    ]
    return str(first[0]["grade"]), told[0], " ".join(also)


def _of_changes(document: Document) -> Mapping[str, Any]:
    told = [entry["verdict"] != NOT_TOLD for entry in document["edges"].values()]
    grade = WRONG if document["moved"] else GOOD if told and all(told) else WEAK
    return verdict_of(document) or {"grade": grade, "sentence": document["sentence"]}


def sensor_lines(given: Given, guidance: Mapping[str, Guidance]) -> List[SensorLine]:
    """Return a line for each sensor: the worse verdict of the results, why, and what to do.

    Args:
        given: the results.
        guidance: what boards each sensor lacks, where that is known.
    """
    return [_line(given, name, guidance) for name in given.sensors]


def _line(given: Given, name: str, guidance: Mapping[str, Guidance]) -> SensorLine:
    modality = _modality(given, name)
    measured = [
        verdict_of(document).get("sensors", {}).get(name)
        for document in (given.calibration, given.evaluation)
    ]
    verdicts = [entry for entry in measured if entry is not None]
    as_measured = max((str(entry["grade"]) for entry in verdicts), key=_rank, default=GOOD)
    verdicts += [entry for d in given.changes for entry in _changes_of(d, name)]
    if not verdicts:
        return SensorLine(name, modality, UNKNOWN, "no verdict", "nothing is said of it")
    verdicts.sort(key=lambda entry: -_rank(str(entry["grade"])))
    if str(verdicts[0]["grade"]) == GOOD:  # the other says where it was measured, further below
        del verdicts[1:]
    grade = str(verdicts[0]["grade"])
    word = NOT_DETERMINED if grade == WEAK and _is_open(given.calibration, name) else grade
    why = _sentence("; ".join(dict.fromkeys(str(entry["sentence"]) for entry in verdicts)))
    advice = [entry["advice"] for entry in verdicts if entry.get("advice")]
    lacks = guidance.get(name)
    if as_measured != GOOD and lacks is not None and not lacks.enough:
        advice = [lacks.advice, *(text for text in advice if text != MORE_BOARDS)]
    return SensorLine(name, modality, grade, word, why, _sentence("; ".join(advice)))


def _changes_of(document: Document, name: str) -> List[Mapping[str, Any]]:
    """Return what is said of a sensor where it was asked whether the rig moved."""
    by_new_boards = verdict_of(document).get("sensors", {}).get(name)
    if by_new_boards is not None:
        return [by_new_boards]
    moved = [
        e for e in document["edges"].values() if e["verdict"] == MOVED and name in e["sensors"]
    ]
    return [
        {
            "grade": WRONG,
            "sentence": f"the two calibrations differ by {length(edge['translation_m'])} and "
            f"{angle(edge['rotation_rad'])}",
            "advice": "find out which of them holds",
        }
        for edge in moved
    ]


def _is_open(calibration: Any, name: str) -> bool:
    """Tell whether the data leave the place of a sensor open."""
    weak = [] if calibration is None else calibration.get("weak_directions", [])
    return any(is_named(name, " ".join(entry["parameters"])) for entry in weak)


def _modality(given: Given, name: str) -> str:
    if given.calibration is not None and name in given.calibration["sensors"]:
        return str(given.calibration["sensors"][name]["modality"])
    if given.dataset is not None and name in given.dataset.sensors:
        return given.dataset.sensors[name].modality
    return ""


def _rank(grade: str) -> int:
    return GRADES.index(grade) if grade in GRADES else -1


def _sentence(text: str) -> str:
    """Return a text as a sentence, with a capital and a full stop."""
    text = text.strip().rstrip(".")
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def facts(given: Given) -> List[Tuple[str, str]]:
    """Return name and value of what stands under the first sentence."""
    found: Dict[str, str] = {}
    calibration: Document = given.calibration or {}
    if calibration:
        used = [c for c in calibration["collections"].values() if c["used"]]
        found["calibrated from"] = str(calibration["dataset"])
        found["status"] = f"{calibration['status']}: {calibration['message']}"
        found["collections"] = f"{len(used)} of {len(calibration['collections'])} used"
    if given.evaluation is not None:
        found["tested on"] = str(given.evaluation["test"])
    return list(found.items())
