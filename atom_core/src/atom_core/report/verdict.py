"""Good, weak or wrong: what a result is worth, in words, and the limits that decide it.

Everybody who shows a result takes its grade from here: the commands, `calibration.json`, RViz. The
limits are explained in docs/certainty.md, "The verdict".
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence

from atom_core.model.caveats import Caveat
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers.robust_covariance import FEWEST

GOOD, WEAK, WRONG = "good", "weak", "wrong"
GRADES = (GOOD, WEAK, WRONG)  # the worst last


class Limits(NamedTuple):
    """Where a figure stops being good, and where it begins to be wrong; between them it is weak."""

    good: float
    wrong: float = math.inf

    def grade(self, value: float) -> str:
        """Return the grade of a figure; what is no number is wrong."""
        if not value <= self.wrong:
            return WRONG
        return GOOD if value <= self.good else WEAK


# Of a calibration. Combined standard deviation of a sensor's place [m] and direction [rad]:
KNOWN_M, KNOWN_RAD = Limits(0.01), Limits(math.radians(0.25))
RESIDUAL = {  # mean distance at the solution [px, m, m]
    REPROJECTION: Limits(1.0, 5.0),
    ORTHOGONAL: Limits(0.02, 0.05),
    BORDER: Limits(0.03, 0.1),
}
# Known no better [m], [rad], it is not known at all: larger figures tell of rounding alone.
OPEN_M, OPEN_RAD = 10.0, math.radians(90.0)
OUTLIER_SHARE = Limits(0.1, 0.3)  # of a sensor's corners and points, beyond four sigmas
FEWEST_BOARDS = FEWEST  # with fewer detections of a sensor it is weak

# Of an evaluation. Sensors against one another, at `AT_M` from the camera [m], and never less than
# so many pixels; points off the plane of another range sensor's points [m]; how far apart, and
# turned beyond noise, collections put a board that stays [m], [rad]; errors against the truth.
AT_M = 2.0
BETWEEN_CAMERAS_M, BETWEEN_CAMERAS_PX = Limits(0.004, 0.02), Limits(2.0, 6.0)
RANGE_IN_IMAGE_M, RANGE_IN_IMAGE_PX = Limits(0.02, 0.06), Limits(4.0, 10.0)
OFF_PLANE_M = Limits(0.025, 0.06)
BESIDE_M = 1.0  # a turn counts as the way of what is so far beside the boards' middle [m]
BOARD_APART_M = Limits(0.01, 0.05)
BOARD_TURNED_RAD = Limits(math.radians(0.5), math.radians(2.0))
ODD, ODD_SHARE = 2, 0.15  # collections beyond a second limit that are too many, and as a share
TRUE_M, TRUE_RAD = Limits(0.01, 0.03), Limits(math.radians(0.25), math.radians(1.0))


_NOTHING = 1e-6  # of a millimetre, degree or pixel


@dataclass(frozen=True)
class SensorVerdict:
    """What a result is worth for one sensor.

    Attributes:
        grade: good, weak or wrong.
        sentence: why, with the figures.
        advice: what to do; None where nothing is to be done.
    """

    grade: str
    sentence: str
    advice: Optional[str] = None


@dataclass(frozen=True)
class Verdict:
    """What a result is worth.

    Attributes:
        grade: good, weak or wrong.
        sentence: what that means, and what to do.
        sensors: the same for each sensor, by name.
    """

    grade: str
    sentence: str
    sensors: Mapping[str, SensorVerdict]


class Finding(NamedTuple):
    """Something that speaks against a sensor, or against the whole."""

    grade: str
    sentence: str
    advice: Optional[str] = None


def worst(grades: Iterable[str]) -> str:
    """Return the worst of some grades; good where there are none."""
    return max(grades, key=GRADES.index, default=GOOD)


def sensor_verdict(findings: Sequence[Finding], facts: str) -> SensorVerdict:
    """Return the verdict on a sensor: the worst of what speaks against it, and the figures.

    Args:
        findings: what speaks against it; of equal ones the first counts.
        facts: figures that are told in any case; may be empty.
    """
    if not findings:
        return SensorVerdict(GOOD, facts)
    finding = max(findings, key=lambda found: GRADES.index(found.grade))
    others = [found.sentence for found in findings if found.grade == finding.grade][1:]
    told = "; ".join(text for text in (finding.sentence, *others, facts) if text)
    return SensorVerdict(finding.grade, told, finding.advice)


def caveats_first(
    findings: Sequence[Finding], name: str, caveats: Iterable[Caveat]
) -> List[Finding]:
    """Return what speaks against a sensor, what the caveats of its dataset say first.

    With a caveat it is weak, whatever it fits; where it is wrong, that is likely why.
    """
    grade = worst([WEAK, *(finding.grade for finding in findings)])
    said = [Finding(grade, c.what, c.remedy) for c in caveats if name in c.sensors]
    return [*said, *findings]


def verdict_lines(verdict: Verdict) -> str:
    """Return one sentence, and one line for each sensor."""
    sentence = verdict.sentence[:1].upper() + verdict.sentence[1:].rstrip(".")
    lines = [f"verdict: {verdict.grade.upper()}. {sentence}."]
    width = max((len(name) for name in verdict.sensors), default=0)
    for name, sensor in verdict.sensors.items():
        advice = f" -> {sensor.advice}" if sensor.advice else ""
        lines.append(f"  {name:<{width}}  {sensor.grade:<5}  {sensor.sentence}{advice}")
    return "\n".join(lines)


def verdict_document(verdict: Verdict) -> Dict[str, Any]:
    """Return the entry ``verdict`` of a document."""
    return {
        "grade": verdict.grade,
        "sentence": verdict.sentence,
        "sensors": {
            name: {"grade": s.grade, "sentence": s.sentence, "advice": s.advice}
            for name, s in verdict.sensors.items()
        },
    }


def is_named(name: str, text: str) -> bool:
    """Tell whether a text names a sensor, and not only one whose name begins or ends alike."""
    return re.search(rf"(?<![\w/.-]){re.escape(name)}(?![\w/-])", text) is not None


def length(metres: float) -> str:
    """Return a length in millimetres, to two digits, or in metres from one metre on."""
    return f"{_short(metres)} m" if metres >= 1.0 else f"{_short(1e3 * metres)} mm"


def angle(radians: float) -> str:
    """Return an angle in degrees, to two digits."""
    return f"{_short(math.degrees(radians))} deg"


def known_to(metres: float, radians: float) -> str:
    """Return how well a place [m] and a direction [rad] are known, where they are."""
    if metres >= OPEN_M and radians >= OPEN_RAD:
        return "neither its place nor its direction is determined"
    if metres >= OPEN_M:
        return f"its place is not determined, its direction known to {angle(radians)}"
    if radians >= OPEN_RAD:
        return f"its direction is not determined, its place known to {length(metres)}"
    return f"known to {length(metres)} and {angle(radians)} only"


def is_open(sigma: float, unit: str) -> bool:
    """Tell whether a standard deviation [m], [rad] says no more than that nothing is known."""
    return sigma >= {"m": OPEN_M, "rad": OPEN_RAD}.get(unit, math.inf)


def sigma_in_words(sigma: float, unit: str) -> str:
    """Return "sigma 0.21 m", or, of what is open, only beyond what it is."""
    if is_open(sigma, unit):
        return f"sigma beyond {OPEN_M:g} m" if unit == "m" else f"sigma beyond {OPEN_RAD:.1f} rad"
    return f"sigma {sigma:.3g} {unit}"


def distance(kind: str, value: float) -> str:
    """Return a residual of some kind, or a mean of them, in words."""
    return pixels(value) if kind == REPROJECTION else length(value)


def pixels(value: float) -> str:
    """Return a distance in an image, to two digits."""
    return f"{_short(value)} px"


def _short(value: float) -> str:
    """Return two digits, more of a large figure, without an exponent."""
    if value < 0.005:
        return "under 0.01" if value > _NOTHING else "0"
    if value >= 10.0:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 1.0 else f"{value:.2f}"


def counted(number: int, what: str) -> str:
    """Return "1 board", "2 boards"."""
    return f"{number} {what}{'s' * (number != 1)}"


def names_in_words(names: Sequence[str], most: int = 4) -> str:
    """Return "a", "a and b", "a, b and c", or "a, b, c and 4 others"."""
    told: List[str] = list(names)
    if len(told) > most:
        told = [*told[: most - 1], f"{len(told) - most + 1} others"]
    return told[0] if len(told) == 1 else f"{', '.join(told[:-1])} and {told[-1]}" if told else ""
