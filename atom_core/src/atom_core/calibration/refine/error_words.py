"""What a model error means, in a sentence for the user."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Callable, Dict, NamedTuple, Tuple, Type

from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    BorderSize,
    PrintTurn,
)
from atom_core.problem.direction_errors import (
    AzimuthScale,
    AzimuthWave,
    DepthCentre,
    DepthFocalLength,
    ElevationOffset,
    ElevationScale,
)
from atom_core.problem.model_errors import (
    AXES,
    PHASES,
    WITH_ALL,
    CameraError,
    DepthOffset,
    DepthScale,
    EdgeOffset,
    ErrorPrior,
    JointOffset,
    JointScale,
    JointWave,
    ModelError,
    PrismaticEdgeOffset,
    PrismaticOffset,
    RangeOffset,
    RangeScale,
)
from atom_core.problem.range_fields import DepthWave, DepthWaves, LayerOffset, LayerOffsets

UNESTIMATED = (
    "no option estimates it: have the arm calibrated, and take only postures like those at work"
)


def described(error: ModelError, value: float, sigma: float) -> str:
    """Return what is wrong, by how much and how sure, as ``lidar_1 reads 29.8 +- 0.4 mm long``.

    Args:
        error: which.
        value: its value in its unit: what must be added, or by which part to grow.
        sigma: its standard deviation.
    """
    return _WORDS[type(error)](error, value, sigma)


def remedy(option: str) -> str:
    """Return what to do about an error that the data show.

    Args:
        option: what estimates it; empty: nothing does.
    """
    return f"{option} estimates it" if option else UNESTIMATED


def unusual(error: ModelError, value: float, sigma: float, prior: ErrorPrior) -> str:
    """Return the sentence for an error that is far from what was expected.

    Args:
        error: which.
        value: as estimated.
        sigma: its standard deviation.
        prior: what was expected: what is usual, or what was known.
    """
    found = described(error, value, sigma)
    if prior.mean != 0.0:
        return f"{found}; what was known before is: {described(error, prior.mean, prior.sigma)}"
    other = f", or estimate it without expecting anything ({error.option})"
    return (
        f"{found}; that is {abs(value) / prior.sigma:.2g} times what is usual, "
        f"and the data hardly tell it from other errors: measure it"
        f"{'' if error.option == WITH_ALL else other}"
    )


class _Scale(NamedTuple):
    """By what a value is multiplied to be in a unit that is told."""

    factor: float
    unit: str

    def size(self, value: float, sigma: float) -> str:
        """Return how large it is, as ``29.8 +- 0.4 mm``."""
        return f"{self.factor * abs(value):.3g} +- {self.factor * sigma:.2g} {self.unit}"


@dataclass(frozen=True)
class _Sentence:
    """What an error means, but for its size.

    Attributes:
        text: with `{size}`, `{word}`, `{axis}`, `{phase}`, and attributes of `{error}`.
        scale: of the size.
        words: which way it is off, at a positive value and at another one.
    """

    text: str
    scale: _Scale
    words: Tuple[str, str] = ("", "")

    def __call__(self, error: ModelError, value: float, sigma: float) -> str:
        """Return the sentence; arguments as of `described`."""
        return self.text.format(
            error=error,
            size=self.scale.size(value, sigma),
            word=self.words[0 if value > 0 else 1],
            axis=AXES[getattr(error, "axis", 0)],
            phase=PHASES[getattr(error, "phase", 0)],
        )


def _camera(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, CameraError)
    if error.label in ("focal_length", "aspect"):
        way = "long" if value < 0 else "short"
        by = f"{_PERCENT.size(math.expm1(-value), sigma)} too {way}"
        if error.label == "aspect":
            return f"fy of {error.target} is given {by} beside fx"
        return f"the focal length of {error.target} is given {by}"
    in_image = _Scale(float(error.camera.focal_px[0]), "px").size(value, sigma)
    if error.label.startswith("centre"):
        return f"the image centre of {error.target} is given {in_image} off in {error.label[-1]}"
    return (
        f"{error.label} of {error.target} is given {in_image} off, measured at the farthest corner "
        f"of the image"
    )


def _depth_centre(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, DepthCentre)
    in_image = _Scale(float(error.camera.focal_px[error.axis]), "px").size(value, sigma)
    return f"the image centre of {error.target} is given {in_image} off in {AXES[error.axis]}"


_MM, _PERCENT, _DEG = _Scale(1e3, "mm"), _Scale(100.0, "%"), _Scale(math.degrees(1.0), "deg")
_RANGE_OFFSET = _Sentence("{error.target} reads {size} {word}", _MM, ("short", "long"))
_RANGE_SCALE = _Sentence("{error.target} reads {size} too {word}", _PERCENT, ("near", "far"))
_JOINT = "the positions of joint {error.target} are {size} too {word}"
_JOINT_OF_EDGE = f"{_JOINT} (record /joint_states, too: -jsf estimates it then)"
_SMALL = ("small", "large")
_WORDS: Dict[Type[ModelError], Callable[[ModelError, float, float], str]] = {
    RangeOffset: _RANGE_OFFSET,
    RangeScale: _RANGE_SCALE,
    DepthOffset: _RANGE_OFFSET,
    DepthScale: _RANGE_SCALE,
    AzimuthScale: _Sentence(
        "the azimuths of {error.target} are {size} too {word} (its angular step, or it turned "
        "while it scanned)",
        _PERCENT,
        _SMALL,
    ),
    AzimuthWave: _Sentence(
        "the azimuths of {error.target} have a wave of {size} over a turn", _DEG
    ),
    ElevationOffset: _Sentence(
        "the elevations of {error.target} are {size} too {word}, all around",
        _DEG,
        ("low", "high"),
    ),
    ElevationScale: _Sentence(
        "the elevations of {error.target} are {size} too {word}", _PERCENT, _SMALL
    ),
    DepthFocalLength: _Sentence(
        "the focal length of {error.target} is given {size} too {word}",
        _PERCENT,
        ("short", "long"),
    ),
    DepthCentre: _depth_centre,
    BoardSize: _Sentence(
        "board {error.target} is {size} {word} than described", _PERCENT, ("larger", "smaller")
    ),
    BoardAspect: _Sentence(  # its value is what one axis gains and the other loses
        "the print of {error.target} is {size} longer in {word} than described: measure its "
        "squares along both",
        _Scale(2.0 * 100.0, "%"),
        ("x beside y", "y beside x"),
    ),
    PrintTurn: _Sentence(
        "the print of {error.target} is turned on its plate by {size} about {word}z, seen from "
        "the border: measure whether its lines run along the plate's edges",
        _DEG,
        ("+", "-"),
    ),
    BorderShift: _Sentence(
        "the border of {error.target} lies {size} in {word}{axis} of where it is described, seen "
        "from the print",
        _MM,
        ("+", "-"),
    ),
    BorderSize: _Sentence(  # its value is of half the border
        "the border of {error.target} is {size} {word} in {axis} than described",
        _Scale(2.0 * 1e3, "mm"),
        ("longer", "shorter"),
    ),
    Bend: _Sentence(
        "board {error.target} is bent by {size} along {axis}; put it on something stiff", _MM
    ),
    BoardTwist: _Sentence(
        "board {error.target} is twisted: its corners lie {size} above and below its middle; put "
        "it on something stiff",
        _MM,
    ),
    BoardThickness: _Sentence(
        "the back of board {error.target} lies {size} {word} its print, where range sensors see "
        "it: measure how thick the board is",
        _MM,
        ("behind", "before"),
    ),
    CameraError: _camera,
    JointOffset: _Sentence(_JOINT, _DEG, _SMALL),
    PrismaticOffset: _Sentence(_JOINT, _MM, _SMALL),
    EdgeOffset: _Sentence(_JOINT_OF_EDGE, _DEG, _SMALL),
    PrismaticEdgeOffset: _Sentence(_JOINT_OF_EDGE, _MM, _SMALL),
    JointScale: _Sentence(
        "joint {error.target} moves {size} {word} than its positions say (the ratio of its gear "
        "or encoder)",
        _PERCENT,
        ("more", "less"),
    ),
    JointWave: _Sentence(
        "the positions of joint {error.target} lack {size} times {word}the {phase} of its position "
        "(the arm bends under its weight, or the encoder is off its axis)",
        _DEG,
        ("", "minus "),
    ),
    LayerOffset: _Sentence(
        "the layer of {error.target} at {error.elevation_deg:.1f} deg reads {size} {word}, beside "
        "the others",
        _MM,
        ("short", "long"),
    ),
    DepthWave: _Sentence(
        "the depths of {error.target} have a wave of {size} across the image, "
        "{error.half_waves[0]} half waves in x and {error.half_waves[1]} in y",
        _PERCENT,
    ),
    DepthWaves: _Sentence(
        "the depths of {error.target} have waves of {size} across the image", _PERCENT
    ),
    LayerOffsets: _Sentence(
        "the layers of {error.target} read long and short by {size} (RMS) beside one another", _MM
    ),
}
