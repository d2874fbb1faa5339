"""Whether a dataset can be calibrated: one sentence, and one for each sensor."""

from __future__ import annotations

from typing import List, Mapping, Optional

from atom_core.calibration.preflight import Preflight
from atom_core.labeling.board_size import OTHER_SIZE
from atom_core.model.config import GREATEST_SQUARE_M
from atom_core.model.dataset import Dataset
from atom_core.problem.corner_measurement import NO_PLACE, NO_POSE
from atom_core.report.verdict import (
    FEWEST_BOARDS,
    GOOD,
    WEAK,
    WRONG,
    Finding,
    SensorVerdict,
    Verdict,
    caveats_first,
    counted,
    is_named,
    names_in_words,
    sensor_verdict,
    worst,
)

_MANY_REMARKS, _MOST = 0.1, 0.5  # warnings about a sensor, as a part of its detections
_BOARD = (
    "correct the board in the configuration (dimension: columns and rows exchanged? size), then "
    "collect again"
)


def check_verdict(
    dataset: Dataset, result: Preflight, moved: Optional[Mapping[str, str]] = None
) -> Verdict:
    """Return the verdict on a dataset before it is calibrated.

    Args:
        dataset: as selected.
        result: what was found in it.
        moved: how far a sensor is from where a description has it, where that is too far.
    """
    moved = moved or {}
    sensors = {name: _sensor(result, name, moved.get(name)) for name in dataset.sensors}
    if result.problems:
        more = len(result.problems) - 1
        others = f" (and {more} more problem{'s' * (more > 1)} above)" if more else ""
        return Verdict(WRONG, f"it cannot be calibrated: {result.problems[0]}{others}", sensors)
    large = [name for name, p in dataset.patterns.items() if p.square_m > GREATEST_SQUARE_M]
    if large:
        what = f"the squares of board {names_in_words(large)} are more than a metre wide"
        return Verdict(WRONG, f"{what}: give its sizes in metres, and collect again", sensors)
    if moved:
        what = f"the rig is not as described: {names_in_words(list(moved))} stand elsewhere"
        return Verdict(WRONG, what, sensors)
    grade = worst(sensor.grade for sensor in sensors.values())
    if result.open_motion and grade != WRONG:
        return Verdict(WEAK, f"it will not be determined: {result.open_motion}", sensors)
    if grade == GOOD:
        collections = counted(len(dataset.collections), "collection")
        what = f"ready to calibrate: {counted(len(sensors), 'sensor')} in {collections}"
        count = len(result.warnings)
        told = f"but read what is said above ({counted(count, 'warning')})"
        return Verdict(GOOD, f"{what}, {told if count else 'nothing looks wrong'}", sensors)
    names = [name for name, sensor in sensors.items() if sensor.grade == grade]
    what = "leave out or repair" if grade == WRONG else "it can be calibrated, but look at"
    first = sensors[names[0]]
    why = "; ".join(text for text in (first.sentence.split(";")[0], first.advice) if text)
    whose = f"; {names[0]}" if len(names) > 1 else ""
    return Verdict(grade, f"{what} {names_in_words(names)} first{whose}: {why}", sensors)


def _sensor(result: Preflight, name: str, moved: Optional[str]) -> SensorVerdict:
    boards = len({key for key in result.detections if key.sensor == name})
    findings: List[Finding] = [
        Finding(WRONG, problem) for problem in result.problems if is_named(name, problem)
    ][:1]
    if moved is not None:
        findings.append(Finding(WRONG, moved, "calibrate again, or put the sensor back"))
    if boards == 0:
        advice = f"collect boards that it sees, or leave it out: -ssf '!{name}'"
        findings.append(Finding(WRONG, "it has detected no board", advice))
    elif boards < FEWEST_BOARDS:
        told = f"it sees too few boards to be known well ({FEWEST_BOARDS} at least)"
        findings.append(Finding(WEAK, told, "collect more of them"))
    told_already = {caveat.sentence for caveat in result.caveats}
    remarks = [w for w in result.warnings if is_named(name, w) and w not in told_already]
    unfit = sum(NO_POSE in remark or NO_PLACE in remark for remark in remarks)
    if unfit > _MOST * boards:
        told = f"in {unfit} of its collections the corners fit no board"
        findings.append(Finding(WRONG, told, _BOARD))
    elif len(remarks) > _MANY_REMARKS * boards and boards >= FEWEST_BOARDS:
        told = f"warnings above that are about it: {len(remarks)}"
        findings.append(Finding(WEAK, told, "read them before you trust its labels"))
    findings += [
        Finding(WEAK, remark.partition(":")[0], "measure the board before you trust this sensor")
        for remark in remarks
        if OTHER_SIZE in remark
    ]
    findings = caveats_first(findings, name, result.caveats)
    return sensor_verdict(findings, f"detected {counted(boards, 'board')}")
