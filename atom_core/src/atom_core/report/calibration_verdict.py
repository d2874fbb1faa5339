"""What a calibration is worth: one sentence, and one for each sensor."""

from __future__ import annotations

from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.judgement import INCONSISTENT, RANK_DEFICIENT
from atom_core.calibration.refine.error_words import UNESTIMATED, remedy
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.report.calibration_results import (
    CalibrationResults,
    ModelErrorResult,
    SensorResult,
)
from atom_core.report.edge_results import EdgeResult
from atom_core.report.trust_report import contradictions
from atom_core.report.verdict import (
    FEWEST_BOARDS,
    GOOD,
    KNOWN_M,
    KNOWN_RAD,
    OUTLIER_SHARE,
    RESIDUAL,
    WEAK,
    WRONG,
    Finding,
    SensorVerdict,
    Verdict,
    angle,
    caveats_first,
    counted,
    distance,
    is_named,
    is_open,
    known_to,
    length,
    names_in_words,
    sensor_verdict,
    worst,
)
from atom_core.solvers.base import CONVERGED, FAILED, NOT_CONVERGED

MORE_BOARDS = "collect boards for it near and far, tilted, and all over its view"
_NOTICEABLE = 2.0  # standard deviations of an error that is estimated
_FAR_FROM_PRIOR = 4.0  # standard deviations of a prior
_LABELS = "look at its labels (dataset_playback), then at its intrinsics and the board's measures"
_WORDS = {REPROJECTION: "corners", ORTHOGONAL: "points", BORDER: "border points"}
_FROM = {
    REPROJECTION: "from where they should be",
    ORTHOGONAL: "off the board",
    BORDER: "off its border",
}


def calibration_verdict(results: CalibrationResults) -> Verdict:
    """Return the verdict on a calibration; good only where it is converged and determined.

    Args:
        results: the figures.
    """
    edges = {name: edge for edge in results.edges for name in edge.sensors}
    sensors = {
        name: _sensor(results, sensor, edges.get(name)) for name, sensor in results.sensors.items()
    }
    findings = _general(results)
    grade = worst([*(f.grade for f in findings), *(s.grade for s in sensors.values())])
    return Verdict(grade, _sentence(results, grade, findings, sensors), sensors)


# ---- the whole


def _general(results: CalibrationResults) -> List[Finding]:
    """Return what speaks against the calibration as a whole."""
    calibration = results.calibration
    message = calibration.message
    found: List[Finding] = []
    if calibration.status in (FAILED, NOT_CONVERGED):
        found.append(Finding(WRONG, f"do not use it, the solver found no answer: {message}"))
    elif calibration.status == INCONSISTENT:
        found.append(Finding(WRONG, f"do not rely on it, the data contradict it: {message}"))
    elif calibration.status == RANK_DEFICIENT:
        found.append(_open(calibration))
    elif calibration.status != CONVERGED:
        found.append(Finding(WRONG, f"do not use it: {message}"))
    if calibration.status == CONVERGED and not results.has_combined_sigmas:
        found.append(Finding(WEAK, "without standard deviations as weights nothing tells how sure"))
    for error in results.model_errors:
        if not error.estimated and error.target not in results.sensors:
            found.append(Finding(WEAK, f"the data show that {_with_option(error)}"))
    found += [Finding(WEAK, f"the data show: {edge.why}") for edge in calibration.moving]
    found += [Finding(WEAK, f"{said}; {_cause(results)}") for said in contradictions(results.trust)]
    return found + _transforms(results) + _joints(results)


def _open(calibration: Calibration) -> Finding:
    """Return what the data leave open, after what they contradict of the rest."""
    weak = calibration.weak_directions
    opened = f"the data do not determine all of it: {weak[0].why if weak else calibration.message}"
    if not calibration.contradictions:
        return Finding(WEAK, opened)
    why = f"{calibration.contradictions[0]}{calibration.stated.likely_cause}"
    return Finding(WRONG, f"do not rely on it, the data contradict it: {why}; besides, {opened}")


def _cause(results: CalibrationResults) -> str:
    """Return what is the likely cause where a calibration does not agree with parts of itself."""
    shown = [error for error in results.model_errors if not error.estimated]
    if shown:
        return f"likely since {_with_option(shown[0])}"
    return (
        "what is the same in all collections may be wrong: the board's measures, intrinsics, or "
        "what a range sensor adds; let them be looked for (--model_errors auto)"
    )


def _with_option(error: ModelErrorResult) -> str:
    """Return what the data show, and what estimates it, or what to do where nothing does."""
    return (
        f"{error.sentence} ({error.option})" if error.option else f"{error.sentence}; {UNESTIMATED}"
    )


def _transforms(results: CalibrationResults) -> List[Finding]:
    """Return which additional tfs are poorly known; the places of sensors are the sensors'."""
    names = {edge: name for name, edge in results.calibration.free.additional_tfs.items()}
    found = []
    for edge in results.edges:
        if edge.sensors or not _is_poorly_known(results, edge):
            continue
        metres, radians = _sigmas(results, edge)
        known = known_to(metres, radians)
        verb = " is" if known.startswith("known") else ":"
        told = f"'{names[edge.edge]}' ({edge.edge}){verb} {known}"
        told += " in most collections" if edge.usual_sigma is not None else ""
        more = "the data leave a part of it to its prior (`held_by_prior`)"
        more = more if edge.held else "collect more boards that are seen across it"
        found.append(Finding(WEAK, f"{told}: {more}"))
    return found


def _is_poorly_known(results: CalibrationResults, edge: EdgeResult) -> bool:
    if edge.anchored or not results.has_combined_sigmas:
        return False
    metres, radians = _sigmas(results, edge)
    return worst([KNOWN_M.grade(metres), KNOWN_RAD.grade(radians)]) != GOOD


def _joints(results: CalibrationResults) -> List[Finding]:
    found = []
    for name, parameters in results.joints.items():
        for p in parameters:
            limits, words = (KNOWN_M, length) if p.unit == "m" else (KNOWN_RAD, angle)
            sigma = p.combined_sigma if results.has_combined_sigmas else p.sigma
            if limits.grade(sigma) != GOOD:
                open_ = is_open(sigma, p.unit)
                known = "not determined" if open_ else f"known to {words(sigma)} only"
                told = f"{p.name} of joint {name} is {known}"
                found.append(Finding(WEAK, f"{told}: move that joint more between collections"))
    return found


def _sentence(
    results: CalibrationResults,
    grade: str,
    findings: Sequence[Finding],
    sensors: Dict[str, SensorVerdict],
) -> str:
    of_grade = [finding.sentence for finding in findings if finding.grade == grade]
    if of_grade:
        return of_grade[0] + (_likely_why(results, sensors) if grade == WRONG else "")
    if grade == GOOD:
        return _good(results)
    names = [name for name, sensor in sensors.items() if sensor.grade == grade]
    what = "do not use it as it is" if grade == WRONG else "it can be used with care"
    reason = sensors[names[0]].sentence.partition("; ")[0]
    if len(names) == 1:
        return f"{what}: {names[0]} is {grade} ({reason})"
    return f"{what}: {names_in_words(names)} are {grade} ({names[0]}: {reason})"


def _likely_why(results: CalibrationResults, sensors: Mapping[str, SensorVerdict]) -> str:
    """Return which caveat of a sensor that is wrong the answer is likely wrong for."""
    for caveat in results.calibration.dataset.caveats:
        wrong = [n for n in caveat.sensors if n in sensors and sensors[n].grade == WRONG]
        if wrong:
            return f"; likely cause ({names_in_words(wrong)}): {caveat.what}"
    return ""


def _good(results: CalibrationResults) -> str:
    estimated = [e for e in results.edges if not e.anchored and e.usual_sigma is None]
    if not estimated:
        return "all that was estimated is determined, and nothing contradicts it"
    known = [_sigmas(results, edge) for edge in estimated]
    metres, radians = (max(values) for values in zip(*known))
    held = [name for edge in results.edges if edge.anchored for name in edge.sensors]
    to = f", in relation to {names_in_words(held)}" if held else ""
    kinds = [("sensor", any(edge.sensors for edge in estimated))]
    kinds += [("transform", not all(edge.sensors for edge in estimated))]
    what = " and ".join(kind for kind, is_there in kinds if is_there)
    return (
        f"every estimated {what} is known to {length(metres)} and {angle(radians)} or better{to} "
        f"(one standard deviation, with the usual errors of sensors and boards)"
    )


# ---- one sensor


def _sensor(
    results: CalibrationResults, sensor: SensorResult, edge: Optional[EdgeResult]
) -> SensorVerdict:
    findings = [
        *_of_the_status(results, sensor.name),
        *_contradictions(results, sensor.name),
        *_of_the_data(sensor),
        *_of_the_place(results, edge),
        *_of_a_stated_place(results, sensor),
        *_far_from_described(results, edge),
    ]
    findings = caveats_first(findings, sensor.name, results.calibration.dataset.caveats)
    return sensor_verdict(findings, "; ".join(_facts(results, sensor, edge)))


def _of_the_status(results: CalibrationResults, name: str) -> List[Finding]:
    calibration = results.calibration
    if calibration.summary.interrupted:
        return [Finding(WRONG, "the solver was on its way to its place", "let the solver end")]
    if calibration.status in (FAILED, NOT_CONVERGED):
        advice = "see what `check` says of its data, then begin nearer to the truth"
        return [Finding(WRONG, "the solver found no place for it", advice)]
    if calibration.status == RANK_DEFICIENT:
        opened = [w for w in calibration.weak_directions if is_named(name, " ".join(w.parameters))]
        if opened:
            weak = opened[0]
            size = length(weak.sigma) if weak.unit == "m" else angle(weak.sigma)
            by = "" if is_open(weak.sigma, weak.unit) else f", by some {size}"
            told = f"the data leave its place open{by}"
            return [Finding(WEAK, told, "collect what the first line misses, or hold it (-as)")]
    if _contradiction(calibration) and not _accused(results, name):
        advice = "settle the contradiction first, then calibrate again"
        return [Finding(WEAK, "it shares the answer with what the data contradict", advice)]
    if calibration.status == CONVERGED and not results.has_combined_sigmas:
        return [Finding(WEAK, "nothing tells how well it is known", "take --weights sigma")]
    return []


def _accused(results: CalibrationResults, name: str) -> bool:
    """Tell whether the contradiction is this sensor's."""
    calibration = results.calibration
    shown = {error.target for error in results.model_errors if not error.estimated}
    accused = {m.sensor for m in calibration.misfits} | {e.sensor for e in calibration.exclusions}
    return name in accused | shown or is_named(name, _contradiction(calibration))


def _contradiction(calibration: Calibration) -> str:
    """Return what the data contradict, the likeliest cause; '' where there is nothing."""
    if calibration.status == INCONSISTENT:
        return calibration.message
    return "".join(calibration.contradictions[:1])


def _contradictions(results: CalibrationResults, name: str) -> List[Finding]:
    """Return what of the sensor does not fit the others, and errors of it that the data show."""
    calibration = results.calibration
    contradiction = _contradiction(calibration)
    grade = WRONG if contradiction else WEAK
    found = [
        Finding(grade, f"the data show that {e.sentence}", remedy(e.option))
        for e in results.model_errors
        if e.target == name and not e.estimated
    ]
    for misfit in calibration.misfits:
        if misfit.sensor == name:
            told, alone = (distance(misfit.kind, v) for v in (misfit.joint, misfit.alone))
            sentence = (
                f"{_WORDS[misfit.kind]} are {told} off, and {alone} where this sensor stands alone"
            )
            found.append(Finding(WRONG, sentence, f"look at {', then at '.join(misfit.likely)}"))
    for out in calibration.exclusions:
        if out.sensor == name:
            sentence = f"{out.rejected} of its {out.detections} detections contradict the others"
            found.append(Finding(WRONG, sentence, f"look at {', then at '.join(out.likely)}"))
    if not found and is_named(name, contradiction):
        found.append(Finding(WRONG, "the contradiction is its own", "see the first line"))
    return found


def _of_the_data(sensor: SensorResult) -> List[Finding]:
    """Return what speaks against the detections themselves."""
    if sensor.detections == 0:
        told = "none of its detections was used: it stands where it stood before"
        return [Finding(WRONG, told, "see what `check` says of its data")]
    found = []
    if sensor.boards < FEWEST_BOARDS:
        told = "too few boards to tell by how much they disagree"
        found.append(Finding(WEAK, told, MORE_BOARDS))
    for kind, statistics in sensor.residuals.items():
        grade = RESIDUAL[kind].grade(statistics.mean)
        if grade != GOOD:
            off = f"{_WORDS[kind]} are {distance(kind, statistics.mean)} off in the mean"
            found.append(Finding(grade, off, _LABELS))
    items = sum(statistics.count for statistics in sensor.residuals.values())
    share = sensor.outliers / max(items, 1)
    if OUTLIER_SHARE.grade(share) != GOOD:
        told = f"{100.0 * share:.0f} % of its corners and points lie beyond four sigmas"
        found.append(Finding(OUTLIER_SHARE.grade(share), told, _LABELS))
    return found


def _of_the_place(results: CalibrationResults, edge: Optional[EdgeResult]) -> List[Finding]:
    if edge is None or not _is_poorly_known(results, edge):
        return []
    metres, radians = _sigmas(results, edge)
    return [Finding(WEAK, known_to(metres, radians), MORE_BOARDS)]


def _of_a_stated_place(results: CalibrationResults, sensor: SensorResult) -> List[Finding]:
    """Return what gives way if a place that the user states is wrong."""
    stated = results.calibration.stated
    if sensor.name not in stated.names:
        return []
    absorbed = [
        error.sentence
        for error in results.model_errors
        if error.target == sensor.name
        and error.estimated
        and abs(error.value) > _NOTICEABLE * error.sigma
    ]
    absorbed += [f"intrinsics of {sensor.name} were estimated"] if sensor.intrinsics else []
    found = []
    if absorbed:
        told = f"{stated.sentence(sensor.name)}, and {absorbed[0]}: that is also what it takes if "
        found.append(Finding(WEAK, f"{told}it does not stand there", stated.remedy(sensor.name)))
    far = [p for p in results.calibration.priors if p.prior.name == sensor.name]
    if far and far[0].deviation > _FAR_FROM_PRIOR:
        told = f"it ends {far[0].deviation:.1f} standard deviations from where its prior has it"
        found.append(Finding(WEAK, told, stated.remedy(sensor.name)))
    return found


def _far_from_described(results: CalibrationResults, edge: Optional[EdgeResult]) -> List[Finding]:
    """Return where a sensor ends far from the description: data of another one put it there."""
    if edge is None:
        return []
    return [
        Finding(
            WEAK,
            f"it ends {length(far.translation_m)} and {angle(far.rotation_rad)} from where the "
            f"description has it",
            "look whether it stands there; if not, its topic, frame or labels are another "
            "sensor's, and if so, let the description say that",
        )
        for far in results.calibration.displaced
        if far.edge == edge.edge
    ]


def _facts(
    results: CalibrationResults, sensor: SensorResult, edge: Optional[EdgeResult]
) -> List[str]:
    """Return where it stands, how many boards it saw, and how they fit."""
    facts = []
    if edge is not None and edge.anchored:
        facts.append("held where it was")
    elif edge is not None and results.has_combined_sigmas and not _of_the_place(results, edge):
        metres, radians = _sigmas(results, edge)
        facts.append(f"known to {length(metres)} and {angle(radians)}")
    facts.append(counted(sensor.boards, "board"))
    facts += [
        f"{_WORDS[kind]} {distance(kind, statistics.mean)} {_FROM[kind]}"
        for kind, statistics in sensor.residuals.items()
        if kind != BORDER and RESIDUAL[kind].grade(statistics.mean) == GOOD
    ]
    return facts


def _sigmas(results: CalibrationResults, edge: EdgeResult) -> Tuple[float, float]:
    """Return the largest of the three axes [m], [rad].

    Of what has a value in each collection, in the middle of these: a few are seen from afar.
    """
    sigma = edge.combined_sigma if results.has_combined_sigmas else edge.sigma
    sigma = sigma if edge.usual_sigma is None else edge.usual_sigma
    return float(np.max(sigma[TRANSLATION])), float(np.max(sigma[ROTATION]))
