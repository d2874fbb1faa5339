"""``scenario.yaml``: where boards are, how joints move, and what has to be seen at a stop."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from atom_core.geometry import se3
from atom_core.synthetic.rig import Room
from atom_examples.cell_simulator.yaml_entry import (
    Entry,
    count,
    not_negative,
    read_yaml,
    share,
    triple,
)

STOPS = ("train", "test")
_KEYS = ("room", "boards", "absent", "joints", "stops", "seen", "calibrate")


@dataclass(frozen=True)
class Fixed:
    """A board that stays where it is in the frame of its parent_link: ``parent_T_pattern``."""

    parent_T_pattern: np.ndarray


@dataclass(frozen=True)
class Carried:
    """A board that is carried about by hand.

    Attributes:
        low, high: (3,) corners of the box in which its middle is, in the world [m].
        faces: (n, 3) points in the world that its print looks at, one of them at each stop [m].
        tilt_rad: standard deviation of its tilt about each axis.
    """

    low: np.ndarray
    high: np.ndarray
    faces: np.ndarray
    tilt_rad: float


@dataclass(frozen=True)
class Joints:
    """How the joints move.

    Attributes:
        postures: positions by joint [rad, m]; each stop is near one of them.
        spread: how far a stop is from a posture at most, by joint [rad, m].
        position_bias: how much at most must be added to what the robot reports, by joint [rad, m].
    """

    postures: Tuple[Mapping[str, float], ...] = ({},)
    spread: Mapping[str, float] = None  # type: ignore[assignment]
    position_bias: Mapping[str, float] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in ("spread", "position_bias"):
            object.__setattr__(self, name, dict(getattr(self, name) or {}))

    @property
    def names(self) -> List[str]:
        """Those that move, in the order of the first posture."""
        return list(dict.fromkeys(name for posture in self.postures for name in posture))


@dataclass(frozen=True)
class Seen:
    """What has to be seen at a stop.

    Attributes:
        detections: pairs of a sensor and a board, at least.
        part: of a board's corners, or of its points before a range sensor, for a detection.
        by: the boards that count, by sensor; None: all of them with every sensor.
    """

    detections: int = 1
    part: float = 0.7
    by: Optional[Mapping[str, Tuple[str, ...]]] = None


@dataclass(frozen=True)
class Scenario:
    """All of the file.

    Attributes:
        room: walls, floor and ceiling.
        boards: by the pattern's name.
        absent: patterns that this recording does not show.
        joints: how they move.
        stops: how many there are in each recording.
        seen: at each stop.
        calibrate: further words of the command that calibrates the example.
    """

    room: Room
    boards: Mapping[str, Union[Fixed, Carried]]
    joints: Joints
    stops: Mapping[str, int]
    seen: Seen
    calibrate: Tuple[str, ...] = ()
    absent: Tuple[str, ...] = ()


def read_scenario(path: Path) -> Scenario:
    """Read the file.

    Raises:
        SimulatorError: it is absent or malformed; names the key and the remedy.
    """
    entry = read_yaml(path)
    entry.only(_KEYS)
    room, stops = entry.part("room"), entry.part("stops")
    boards = entry.part("boards")
    return Scenario(
        Room(_corner(room, "low"), _corner(room, "high")),
        {str(name): _board(boards.part(name)) for name in boards.values},
        _joints(entry.part("joints")) if "joints" in entry.values else Joints(),
        {name: stops.get(name, count) for name in STOPS},
        _seen(entry.part("seen")) if "seen" in entry.values else Seen(),
        entry.get("calibrate", _words) if "calibrate" in entry.values else (),
        entry.get("absent", _words) if "absent" in entry.values else (),
    )


def _corner(entry: Entry, key: str) -> Tuple[float, float, float]:
    x, y, z = (float(number) for number in entry.get(key, triple))
    return x, y, z


def _board(entry: Entry) -> Union[Fixed, Carried]:
    if "carried" not in entry.values:
        entry.only(("xyz", "rpy"))
        return Fixed(se3.from_rpy(entry.get("xyz", triple), entry.get("rpy", triple)))
    entry.only(("carried",))
    carried = entry.part("carried")
    carried.only(("low", "high", "faces", "tilt_deg"))
    faces = carried.get("faces", lambda value: np.array([triple(point) for point in value]))
    tilt_deg = carried.get("tilt_deg", not_negative)
    low, high = carried.get("low", triple), carried.get("high", triple)
    return Carried(low, high, faces, float(np.radians(tilt_deg)))


def _joints(entry: Entry) -> Joints:
    entry.only(("postures", "spread", "position_bias"))
    return Joints(
        entry.get("postures", lambda value: tuple(_numbers(posture) for posture in value)),
        entry.get("spread", _numbers),
        entry.get("position_bias", _numbers) if "position_bias" in entry.values else {},
    )


def _seen(entry: Entry) -> Seen:
    entry.only(("detections", "part", "by"))
    given: Dict[str, Any] = {}
    if "detections" in entry.values:
        given["detections"] = entry.get("detections", count)
    if "part" in entry.values:
        given["part"] = entry.get("part", share)
    if "by" in entry.values:
        by = entry.part("by")
        given["by"] = {str(sensor): by.get(sensor, _words) for sensor in by.values}
    return Seen(**given)


def _numbers(value: Optional[Mapping[str, Any]]) -> Dict[str, float]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{value} is no mapping of joints to numbers")
    numbers = {str(name): float(number) for name, number in value.items()}
    if not all(np.isfinite(number) for number in numbers.values()):
        raise ValueError("a number is not finite")
    return numbers


def _words(value: Any) -> Tuple[str, ...]:
    if not isinstance(value, list):
        raise ValueError(f"{value} is no list of words")
    return tuple(str(word) for word in value)
