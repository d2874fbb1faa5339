"""Options of ``calibrate`` about errors of the model: sensors and boards are not as described."""

from __future__ import annotations

import argparse
import math
from typing import Callable, Dict, List, Optional, Sequence, Tuple

from atom_core.calibration.options import AUTO, OFF, SUGGEST
from atom_core.calibration.prepare.moving_parts import moving_frames
from atom_core.commands import common
from atom_core.errors import CalibrationError
from atom_core.model.dataset import Dataset
from atom_core.model.modality import Modality, modalities
from atom_core.model.selection import select_names

_OF_SENSORS: Dict[str, Tuple[Callable[[Modality], bool], str]] = {
    "range_offset": (
        lambda kind: kind.can_estimate_range_offset,
        "what must be added to all distances of these LiDARs",
    ),
    "range_scale": (
        lambda kind: kind.can_estimate_range_offset,
        "by which part all distances of these LiDARs must grow",
    ),
    "depth_offset": (
        lambda kind: kind.measures_range and not kind.can_estimate_range_offset,
        "what must be added to all depths of these cameras",
    ),
    "depth_scale": (
        lambda kind: kind.measures_range and not kind.can_estimate_range_offset,
        "by which part all depths of these cameras must grow",
    ),
}
_MOVING, _PRIOR = "--moving_edge_sigma", "--prior"
_OF_BOARDS = {
    "board_size": "by which part these boards are larger than described",
    "board_border": "where the four sides of these boards are, seen from the print",
    "board_bend": "how far the edges of these boards lie above their middle, along x and along y",
    "board_thickness": "how far the backs of these boards, which range sensors see, lie behind "
    "their prints",
}


def add_model_error_options(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    for option, (_, what) in _OF_SENSORS.items():
        common.add_option(
            parser,
            option,
            nargs="*",
            metavar="S",
            help=f"estimate {what} (names, globs; all without a name)",
        )
    for option, what in _OF_BOARDS.items():
        common.add_option(
            parser,
            option,
            nargs="*",
            metavar="P",
            help=f"estimate {what} (names, globs; all without a name)",
        )
    common.add_option(
        parser,
        "moving_edge_sigma",
        nargs="*",
        action="append",
        metavar="F",
        help="the poses of these frames in their parents (an arm's flange, a pan-tilt, odometry; "
        "names, globs; all that move without a name) are off, in each collection by its own "
        "amount: give its standard deviation after the names, in mm and deg along and about each "
        "axis (flange 1 0.1), or nothing to have it estimated",
    )
    common.add_option(
        parser,
        "prior",
        nargs=3,
        action="append",
        metavar=("EDGE|JOINT", "SIGMA_M", "SIGMA_RAD"),
        help="a sensor's edge, an additional tf, a joint or a fixed board (its name, or "
        "parent-child) is where "
        "the dataset has it but for a Gaussian deviation, of so many metres in each length and "
        "radians in each angle; can stand several times",
    )
    common.add_option(
        parser,
        "model_errors",
        choices=[SUGGEST, AUTO, OFF],
        default=SUGGEST,
        help="errors of sensors and boards that the data show: name them, estimate them in turn "
        "until none is left, or do not look for them",
    )


def stated_priors(words: Optional[Sequence[Sequence[str]]]) -> Dict[str, Tuple[float, float]]:
    """Return the standard deviations [m, rad] of --prior, by name.

    Args:
        words: three for each time that the option stands.

    Raises:
        CalibrationError: the figures are not above zero, or a name stands twice.
    """
    stated: Dict[str, Tuple[float, float]] = {}
    for name, *figures in words or []:
        sigmas = [n for n in map(_number, figures) if n is not None and 0 < n < math.inf]
        if len(sigmas) != len(figures):
            raise CalibrationError(
                f"{_PRIOR} {name} {' '.join(figures)}: after the name it needs two figures > 0, "
                f"metres and radians ({_PRIOR} {name} 0.005 0.01)"
            )
        if name in stated:
            raise CalibrationError(f"{_PRIOR} {name} stands twice; leave one of the two out")
        stated[name] = (sigmas[0], sigmas[1])
    return stated


def selected_model_errors(args: argparse.Namespace, dataset: Dataset) -> Dict[str, Tuple[str, ...]]:
    """Return, by option, the sensors or boards that the arguments select.

    Raises:
        CalibrationError: there is none that an option suits.
    """
    selected = {
        option: sensors_of(dataset, f"--{option}", getattr(args, option), suits)
        for option, (suits, _) in _OF_SENSORS.items()
    }
    for option in _OF_BOARDS:
        names = getattr(args, option)
        chosen = () if names is None else tuple(select_names(dataset.patterns, names, "pattern"))
        selected[option] = chosen
    return selected


def selected_moving_edges(
    args: argparse.Namespace, dataset: Dataset
) -> Dict[str, Optional[Tuple[float, float]]]:
    """Return the standard deviations [m, rad] of moving frames, None where they are estimated.

    Raises:
        CalibrationError: nothing moves, or the figures are not two above zero.
    """
    selected: Dict[str, Optional[Tuple[float, float]]] = {}
    for words in args.moving_edge_sigma or []:
        frames, sigmas = _frames_and_sigmas(words)
        there = list(moving_frames(dataset))
        if not there and not frames:
            raise CalibrationError(f"{_MOVING}: nothing moves between a sensor and a board")
        named = [frame for frame in frames if not _is_expression(frame)]
        chosen = [frame for frame in frames if _is_expression(frame)]
        if chosen or not named:
            named += select_names(there, chosen, "moving frame")
        selected.update(dict.fromkeys(named, sigmas))
    return selected


def _is_expression(frame: str) -> bool:
    return any(sign in frame for sign in "*?[!") or frame.lstrip().startswith("lambda")


def _frames_and_sigmas(words: Sequence[str]) -> Tuple[List[str], Optional[Tuple[float, float]]]:
    numbers = [_number(word) for word in words]
    count = sum(number is not None for number in numbers)
    if count == 0:
        return list(words), None
    sigmas = [n for n in numbers[-2:] if n is not None and 0 < n < math.inf]
    if count == 2 and len(sigmas) == 2:
        return list(words[:-2]), (1e-3 * sigmas[0], math.radians(sigmas[1]))
    raise CalibrationError(
        f"{_MOVING} {' '.join(words)}: after the frames it needs two figures > 0, mm and deg "
        f"({_MOVING} flange 1 0.1), or none to have them estimated"
    )


def _number(word: str) -> Optional[float]:
    try:
        return float(word)
    except ValueError:
        return None


def sensors_of(
    dataset: Dataset,
    option: str,
    selection: Optional[Sequence[str]],
    suits: Callable[[Modality], bool],
) -> Tuple[str, ...]:
    """Return the sensors that an option selects of those that it suits; None: it is not given."""
    if selection is None:
        return ()
    nouns = " or ".join(kind.noun for kind in modalities() if suits(kind))
    names = [s.name for s in dataset.sensors.values() if suits(s.kind)]
    if not names:
        raise CalibrationError(f"{option}: there is no {nouns}")
    return tuple(select_names(names, selection, nouns))
