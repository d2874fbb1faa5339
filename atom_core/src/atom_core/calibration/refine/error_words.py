"""What a model error means, in a sentence for the user."""

from __future__ import annotations

import math
from typing import Callable, Dict, Type

from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
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
    METRE,
    PHASES,
    WITH_ALL,
    CameraError,
    DepthOffset,
    DepthScale,
    ErrorPrior,
    JointOffset,
    JointScale,
    JointWave,
    ModelError,
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


def _about(value: float, sigma: float, factor: float, unit: str) -> str:
    return f"{factor * abs(value):.3g} +- {factor * sigma:.2g} {unit}"


def _range_offset(error: ModelError, value: float, sigma: float) -> str:
    length = "short" if value > 0 else "long"
    return f"{error.target} reads {_about(value, sigma, 1e3, 'mm')} {length}"


def _range_scale(error: ModelError, value: float, sigma: float) -> str:
    where = "near" if value > 0 else "far"
    return f"{error.target} reads {_about(value, sigma, 100.0, '%')} too {where}"


def _board_size(error: ModelError, value: float, sigma: float) -> str:
    size = "larger" if value > 0 else "smaller"
    return f"board {error.target} is {_about(value, sigma, 100.0, '%')} {size} than described"


def _board_aspect(error: ModelError, value: float, sigma: float) -> str:
    longer, shorter = AXES if value > 0 else reversed(AXES)
    return (
        f"the print of {error.target} is {_about(2.0 * value, 2.0 * sigma, 100.0, '%')} longer in "
        f"{longer} beside {shorter} than described: measure its squares along both"
    )


def _print_turn(error: ModelError, value: float, sigma: float) -> str:
    sign = "+" if value > 0 else "-"
    return (
        f"the print of {error.target} is turned on its plate by "
        f"{_about(value, sigma, math.degrees(1.0), 'deg')} about {sign}z, seen from the border: "
        f"measure whether its lines run along the plate's edges"
    )


def _border_shift(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, BorderShift)
    sign = "+" if value > 0 else "-"
    return (
        f"the border of {error.target} lies {_about(value, sigma, 1e3, 'mm')} in "
        f"{sign}{AXES[error.axis]} of where it is described, seen from the print"
    )


def _border_size(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, BorderSize)
    size = "longer" if value > 0 else "shorter"
    return (
        f"the border of {error.target} is {_about(2.0 * value, 2.0 * sigma, 1e3, 'mm')} {size} "
        f"in {AXES[error.axis]} than described"
    )


def _bend(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, Bend)
    return (
        f"board {error.target} is bent by {_about(value, sigma, 1e3, 'mm')} along "
        f"{AXES[error.axis]}; put it on something stiff"
    )


def _camera(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, CameraError)
    focal_px = float(error.camera.focal_px[0])
    if error.label == "focal_length":
        length = "long" if value < 0 else "short"
        return (
            f"the focal length of {error.target} is given "
            f"{_about(math.expm1(-value), sigma, 100.0, '%')} too {length}"
        )
    if error.label == "aspect":
        length = "long" if value < 0 else "short"
        return (
            f"fy of {error.target} is given {_about(math.expm1(-value), sigma, 100.0, '%')} too "
            f"{length} beside fx"
        )
    if error.label.startswith("centre"):
        return (
            f"the image centre of {error.target} is given "
            f"{_about(value, sigma, focal_px, 'px')} off in {error.label[-1]}"
        )
    return (
        f"{error.label} of {error.target} is given {_about(value, sigma, focal_px, 'px')} off, "
        f"measured at the farthest corner of the image"
    )


def _azimuth_scale(error: ModelError, value: float, sigma: float) -> str:
    size = "small" if value > 0 else "large"
    return (
        f"the azimuths of {error.target} are {_about(value, sigma, 100.0, '%')} too {size} (its "
        f"angular step, or it turned while it scanned)"
    )


def _azimuth_wave(error: ModelError, value: float, sigma: float) -> str:
    factor = math.degrees(1.0)
    return (
        f"the azimuths of {error.target} have a wave of {_about(value, sigma, factor, 'deg')} over "
        f"a turn"
    )


def _elevation_offset(error: ModelError, value: float, sigma: float) -> str:
    size = "low" if value > 0 else "high"
    found = _about(value, sigma, math.degrees(1.0), "deg")
    return f"the elevations of {error.target} are {found} too {size}, all around"


def _elevation_scale(error: ModelError, value: float, sigma: float) -> str:
    size = "small" if value > 0 else "large"
    return f"the elevations of {error.target} are {_about(value, sigma, 100.0, '%')} too {size}"


def _depth_focal_length(error: ModelError, value: float, sigma: float) -> str:
    length = "long" if value < 0 else "short"
    return (
        f"the focal length of {error.target} is given {_about(value, sigma, 100.0, '%')} too "
        f"{length}"
    )


def _depth_centre(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, DepthCentre)
    focal_px = float(error.camera.focal_px[error.axis])
    return (
        f"the image centre of {error.target} is given {_about(value, sigma, focal_px, 'px')} off "
        f"in {AXES[error.axis]}"
    )


def _layer_offsets(error: ModelError, value: float, sigma: float) -> str:
    return (
        f"the layers of {error.target} read long and short by {_about(value, sigma, 1e3, 'mm')} "
        f"(RMS) beside one another"
    )


def _joint(error: ModelError, value: float, sigma: float) -> str:
    factor, unit = (1e3, "mm") if error.unit == METRE else (math.degrees(1.0), "deg")
    size = "small" if value > 0 else "large"
    return (
        f"the positions of joint {error.target} are {_about(value, sigma, factor, unit)} too {size}"
    )


def _joint_scale(error: ModelError, value: float, sigma: float) -> str:
    more = "more" if value > 0 else "less"
    return (
        f"joint {error.target} moves {_about(value, sigma, 100.0, '%')} {more} than its positions "
        f"say (the ratio of its gear or encoder)"
    )


def _joint_wave(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, JointWave)
    lacking = _about(value, sigma, math.degrees(1.0), "deg")
    sign = "" if value > 0 else "minus "
    return (
        f"the positions of joint {error.target} lack {lacking} times {sign}the "
        f"{PHASES[error.phase]} of its position (the arm bends under its weight, or the encoder is "
        f"off its axis)"
    )


def _layer_offset(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, LayerOffset)
    length = "short" if value > 0 else "long"
    return (
        f"the layer of {error.target} at {error.elevation_deg:.1f} deg reads "
        f"{_about(value, sigma, 1e3, 'mm')} {length}, beside the others"
    )


def _depth_wave(error: ModelError, value: float, sigma: float) -> str:
    assert isinstance(error, DepthWave)
    x, y = error.half_waves
    return (
        f"the depths of {error.target} have a wave of {_about(value, sigma, 100.0, '%')} across "
        f"the image, {x} half waves in x and {y} in y"
    )


def _depth_waves(error: ModelError, value: float, sigma: float) -> str:
    return (
        f"the depths of {error.target} have waves of {_about(value, sigma, 100.0, '%')} across the "
        f"image"
    )


_WORDS: Dict[Type[ModelError], Callable[[ModelError, float, float], str]] = {
    RangeOffset: _range_offset,
    RangeScale: _range_scale,
    DepthOffset: _range_offset,
    DepthScale: _range_scale,
    AzimuthScale: _azimuth_scale,
    AzimuthWave: _azimuth_wave,
    ElevationOffset: _elevation_offset,
    ElevationScale: _elevation_scale,
    DepthFocalLength: _depth_focal_length,
    DepthCentre: _depth_centre,
    BoardSize: _board_size,
    BoardAspect: _board_aspect,
    PrintTurn: _print_turn,
    BorderShift: _border_shift,
    BorderSize: _border_size,
    Bend: _bend,
    CameraError: _camera,
    JointOffset: _joint,
    PrismaticOffset: _joint,
    JointScale: _joint_scale,
    JointWave: _joint_wave,
    LayerOffset: _layer_offset,
    DepthWave: _depth_wave,
    DepthWaves: _depth_waves,
    LayerOffsets: _layer_offsets,
}
