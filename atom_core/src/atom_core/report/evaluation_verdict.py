"""What an evaluation says of a calibration: one sentence, and one for each sensor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.evaluation.board_displacement import Displacement
from atom_core.evaluation.evaluate import Evaluation
from atom_core.evaluation.results import PairFigures, PairResult
from atom_core.report.verdict import (
    AT_M,
    BESIDE_M,
    BETWEEN_CAMERAS_M,
    BETWEEN_CAMERAS_PX,
    BOARD_APART_M,
    BOARD_TURNED_RAD,
    GOOD,
    GRADES,
    ODD,
    ODD_SHARE,
    OFF_PLANE_M,
    RANGE_IN_IMAGE_M,
    RANGE_IN_IMAGE_PX,
    TRUE_M,
    TRUE_RAD,
    WEAK,
    WRONG,
    Finding,
    SensorVerdict,
    Verdict,
    angle,
    caveats_first,
    length,
    names_in_words,
    pixels,
    sensor_verdict,
    worst,
)

_NOT_CALIBRATED = (
    "give the atom_calibration.json that `calibrate` wrote as --train, and see what it said of it"
)
_LITTLE = "which proves little: it may be as small with a wrong calibration"
_OTHER_SENSOR = "test it beside a camera, a depth camera or a 3D LiDAR, too"
_TILTED = "test with more boards that both see, tilted up, down and to both sides"
_AGAIN = "look at its labels in both sets, then calibrate it with more boards"


_Measure = Callable[[float], Tuple[str, str, float]]


class _Judged(NamedTuple):
    """A measured pair: its grade, how far off it is in words, and as a length [m].

    A good one that does not prove anything speaks for no sensor: what to do for a proof.
    """

    source: str
    target: str
    grade: str
    words: str
    size_m: float
    to_prove: Optional[str] = None


def evaluation_verdict(evaluation: Evaluation) -> Verdict:
    """Return the verdict on a calibration, as a test set sees it.

    Args:
        evaluation: of the calibration under test.
    """
    judged = [_judged(evaluation, r) for r in evaluation.pairs if not r.pair.reverse]
    judged += [_spread(result) for result in evaluation.spread]
    known = [pair for pair in judged if pair is not None]
    blamed = _blamed(known)
    sensors = {name: _sensor(evaluation, name, known, blamed) for name in _names(evaluation)}
    if _most_are_wrong(sensors):  # what is wrong with all of them is in the sentence
        sensors = {name: replace(sensor, advice=None) for name, sensor in sensors.items()}
    grade = worst([*(pair.grade for pair in known), *(s.grade for s in sensors.values())])
    return Verdict(grade, _sentence(grade, known, sensors), sensors)


def _names(evaluation: Evaluation) -> List[str]:
    """Return the sensors that were compared, in the order of the pairs."""
    every = (*evaluation.pairs, *evaluation.spread)
    names = dict.fromkeys(name for r in every for name in (r.pair.source, r.pair.target))
    names.update(dict.fromkeys(result.sensor for result in evaluation.single))
    return [name for name in evaluation.px_per_rad if name in names]


# ---- pairs


def _judged(evaluation: Evaluation, result: PairResult) -> Optional[_Judged]:
    """Return a pair with its grade; None where it was not measured, or tells nothing."""
    kind, pair = result.pair.kind, result.pair
    if result.measured is None or kind.floor:
        return None
    value = _beyond_the_floor(result)
    if value == 0.0 and result.at_truth is not None:
        return _Judged(pair.source, pair.target, GOOD, "no farther off than at the truth", 0.0)
    measure = _measure(evaluation, result)
    if measure is None:
        return None
    grade, words, size_m = measure(value)
    beyond = "" if result.at_truth is None else " more than at the truth"
    to_prove = None if kind.proves else _OTHER_SENSOR
    judged = _Judged(pair.source, pair.target, grade, f"{words}{beyond}", size_m, to_prove)
    if result.displacement is not None:
        judged = _by_planes(judged, result.displacement)
    return _with_odd_collections(judged, measure, _by_collection(result))


def _measure(evaluation: Evaluation, result: PairResult) -> Optional[_Measure]:
    """Return what makes a grade, words and a length [m] of a pair's RMS; None: nothing can."""
    if result.pair.kind.unit == "mm":
        return lambda mm: (
            OFF_PLANE_M.grade(mm / 1e3),
            f"{length(mm / 1e3)} off the plane",
            mm / 1e3,
        )
    focal_px = evaluation.px_per_rad.get(result.pair.target)
    if focal_px is None:
        return None
    metres, least = RANGE_IN_IMAGE_M, RANGE_IN_IMAGE_PX
    if result.measured is not None and result.measured.translation_mm is not None:  # two cameras
        metres, least = BETWEEN_CAMERAS_M, BETWEEN_CAMERAS_PX

    def in_image(px: float) -> Tuple[str, str, float]:
        size_m = AT_M * px / float(focal_px or np.nan)
        grade = min(metres.grade(size_m), least.grade(px), key=GRADES.index)
        return grade, f"{pixels(px)}, {length(size_m)} at {AT_M:g} m", size_m

    return in_image


def _by_collection(result: PairResult) -> List[float]:
    """Return the RMS of each collection, without the part that stays at the truth."""
    assert result.measured is not None
    floors = {} if result.at_truth is None else result.at_truth.per_collection
    found = result.measured.per_collection.items()
    least = {key: floors[key].rms if key in floors else 0.0 for key, _ in found}
    return [math.sqrt(max(value.rms**2 - least[key] ** 2, 0.0)) for key, value in found]


def _with_odd_collections(judged: _Judged, measure: _Measure, off: Sequence[float]) -> _Judged:
    """Return a pair that is weak where it is good as a rule, but not in many collections.

    One bad label is none of the calibration. Several are more: a sensor that was knocked meanwhile,
    an arm that is off in places, a clock that is late where the board still moved.
    """
    odd = [rms for rms in off if measure(rms)[0] == WRONG]
    if judged.grade != GOOD or len(odd) < ODD or len(odd) <= ODD_SHARE * len(off):
        return judged
    _, words, size_m = measure(float(np.median(odd)))
    told = f"{words} in {len(odd)} of {len(off)} collections, and {judged.words} as a rule"
    return judged._replace(grade=WEAK, words=told, size_m=size_m)


def _by_planes(judged: _Judged, found: Displacement) -> _Judged:
    """Return the worse of two: points off planes, and where these planes have the source."""
    beside_m = found.turned_rad * BESIDE_M
    size_m = max(found.apart_m, beside_m)
    grade = worst([judged.grade, OFF_PLANE_M.grade(size_m)])
    if OFF_PLANE_M.grade(size_m) != GOOD and size_m > judged.size_m:
        moved = f"{length(found.apart_m)} and {angle(found.turned_rad)}"
        words = f"the boards' planes have it {moved} elsewhere"
        return judged._replace(grade=grade, words=words, size_m=size_m)
    return judged if found.told else judged._replace(to_prove=_TILTED)


def _beyond_the_floor(result: PairResult) -> float:
    """Return the usual RMS, without the part that stays at the truth where that is known."""
    assert result.measured is not None
    floor = 0.0 if result.at_truth is None else _usual(result.at_truth)
    return math.sqrt(max(_usual(result.measured) ** 2 - floor**2, 0.0))


def _usual(figures: PairFigures) -> float:
    """Return the median of the collections' RMS.

    A wrong calibration is wrong in all of them, a bad label in one.
    """
    return float(np.median([value.rms for value in figures.per_collection.values()]))


def _spread(result: PairResult) -> Optional[_Judged]:
    """Return a camera beside itself in other collections, over a board that stays."""
    measured, camera = result.measured, result.pair.source
    if measured is None or measured.translation_mm is None:
        return None
    apart, turned = measured.translation_mm / 1e3, result.turned_rad or 0.0
    grade, of_turn = BOARD_APART_M.grade(apart), BOARD_TURNED_RAD.grade(turned)
    words = f"boards that stay are {length(apart)} apart"
    if of_turn != GOOD:
        words += f" and {angle(turned)} turned"
    return _Judged(camera, camera, worst([grade, of_turn]), words, apart)


def _blamed(pairs: Sequence[_Judged]) -> Dict[str, str]:
    """Return the sensors without which all pairs would be better, and how bad they are.

    The sensor whose pairs are bad most often goes first, until no bad pair is left; of equal ones
    all go, since nothing tells which of them is wrong.
    """
    pairs = [pair for pair in pairs if pair.to_prove is None or pair.grade != GOOD]
    blamed: Dict[str, str] = {}
    for grade in (WRONG, WEAK):
        while True:
            left = [p for p in pairs if p.source not in blamed and p.target not in blamed]
            bad = [p for p in left if p.grade == grade]
            if not bad:
                break
            share = {
                name: sum(name in p[:2] for p in bad) / sum(name in p[:2] for p in left)
                for p in bad
                for name in (p.source, p.target)
            }
            most = max(share.values())
            blamed.update({name: grade for name, value in share.items() if value == most})
        every = {name for pair in pairs for name in (pair.source, pair.target)}
        if grade == WRONG and len(blamed) > len(every) / 2.0:  # then those left prove nothing
            blamed.update({n: WRONG for p in pairs if p.grade == WRONG for n in p[:2]})
    return blamed


# ---- sensors


def _sensor(
    evaluation: Evaluation, name: str, pairs: Sequence[_Judged], blamed: Dict[str, str]
) -> SensorVerdict:
    mine = [pair for pair in pairs if name in (pair.source, pair.target)]
    findings: List[Finding] = []
    if not mine:
        told = "nothing was measured that depends on where it is"
        findings.append(Finding(WEAK, told, "collect boards that it sees together with others"))
    grade = blamed.get(name, GOOD)
    if grade != GOOD:
        bad = [pair for pair in mine if GRADES.index(pair.grade) >= GRADES.index(grade)]
        findings.append(Finding(grade, _told("does not agree with", name, bad), _AGAIN))
        return _with_truth(evaluation, name, findings, "")
    others = [pair for pair in mine if blamed.get(_other(pair, name), GOOD) == GOOD]
    if mine and not others:  # all that it could agree with is blamed
        told = _told("can be compared with no sensor that is right here, only with", name, mine)
        findings.append(Finding(WEAK, told, _AGAIN))
        return _with_truth(evaluation, name, findings, "")
    told = _told("agrees with", name, others)
    if others and all(pair.to_prove for pair in others):
        findings.append(Finding(WEAK, f"{told}, {_LITTLE}", others[0].to_prove))
        told = ""
    return _with_truth(evaluation, name, findings, told)


def _with_truth(
    evaluation: Evaluation, name: str, findings: List[Finding], told: str
) -> SensorVerdict:
    """Return the verdict with what is in doubt, and with the error against a truth."""
    findings = caveats_first(findings, name, evaluation.caveats)
    truth = evaluation.ground_truth
    error = None if truth is None else truth.sensors.get(name)
    if error is None:
        return sensor_verdict(findings, told)
    radians = math.radians(error.rotation_deg)
    off = f"{length(error.translation_m)} and {angle(radians)} from the truth"
    grade = worst([TRUE_M.grade(error.translation_m), TRUE_RAD.grade(radians)])
    if grade != GOOD:
        return sensor_verdict([*findings, Finding(grade, off, _AGAIN)], told)
    return sensor_verdict(findings, "; ".join(text for text in (told, off) if text))


def _told(verb: str, name: str, pairs: Sequence[_Judged]) -> str:
    """Return with whom, and the largest distance."""
    if not pairs:
        return ""
    largest = max(pairs, key=lambda pair: (GRADES.index(pair.grade), pair.size_m))
    if largest.source == largest.target:
        return largest.words
    names = list(dict.fromkeys(_other(pair, name) for pair in pairs if pair.source != pair.target))
    at = "" if len(names) == 1 else f" (with {_other(largest, name)})"
    return f"{verb} {names_in_words(names, 3)}: {largest.words}{at}"


def _other(pair: _Judged, name: str) -> str:
    return pair.target if pair.source == name else pair.source


def _sentence(grade: str, pairs: Sequence[_Judged], sensors: Dict[str, SensorVerdict]) -> str:
    names = [name for name, sensor in sensors.items() if sensor.grade == grade]
    if not pairs:
        return "nothing was measured that depends on the calibration"
    if grade == GOOD:
        return f"the calibration holds on this test set: {_what_agrees(pairs)}"
    if grade == WEAK:
        return f"use it with care: {_are(names)} weak on this test set"
    if _most_are_wrong(sensors):
        largest = max(pairs, key=lambda pair: (pair.grade == WRONG, pair.size_m))
        whose, size = f"{largest.source} and {largest.target}", length(largest.size_m)
        what = f"they disagree by up to {size} ({whose})"
        if largest.source == largest.target:
            up_to = largest.words.replace(" are ", " are up to ", 1)
            what = f"{up_to} ({largest.source})"
        return f"this is no calibration of these sensors: {what}; {_NOT_CALIBRATED}"
    return f"do not use it: {_are(names)} wrong on this test set"


def _what_agrees(pairs: Sequence[_Judged]) -> str:
    """Return what was found in one place: by several sensors, or by each in several collections."""
    if any(pair.source != pair.target for pair in pairs):
        return "the sensors agree with one another"
    compared = "" if len({pair.source for pair in pairs}) == 1 else "; no two sensors were compared"
    return f"boards that stay are found in one place{compared}"


def _most_are_wrong(sensors: Mapping[str, SensorVerdict]) -> bool:
    return sum(sensor.grade == WRONG for sensor in sensors.values()) > len(sensors) / 2.0


def _are(names: Sequence[str]) -> str:
    return f"{names_in_words(names)} {'is' if len(names) == 1 else 'are'}"
