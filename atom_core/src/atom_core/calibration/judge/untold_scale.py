"""What all distances of a result rest on, where the data cannot tell whether it is right."""

from __future__ import annotations

from dataclasses import replace
from typing import Mapping, Sequence, Tuple, Type

from atom_core.calibration.judge.usual_errors import RANGE_SCALES, LeftOpen, left_open
from atom_core.calibration.refine.error_words import described
from atom_core.calibration.refine.model_checks import Hint
from atom_core.problem.board_errors import BoardSize
from atom_core.problem.model_errors import ErrorPriors, ModelError
from atom_core.solvers.shared_equations import SharedEquations

_TOLD = 0.005  # what is told less exactly, as a part of it, is not told
_AT_ALL = 0.2  # a size that is told less exactly is not told at all


def untold_scale(
    equations: SharedEquations,
    usual: Mapping[ModelError, float],
    priors: ErrorPriors,
    with_cameras: bool,
    hints: Sequence[Hint] = (),
) -> Tuple[str, ...]:
    """Return a sentence where the boards' size, or the ranges, are all that tells the scale.

    Args:
        equations: at the solution, with all errors that sensors and boards may have.
        usual: standard deviations of those that the solution has not estimated, in their units.
        priors: of those that it has.
        with_cameras: corners are among what was measured.
        hints: boards that the data may have of another size.
    """
    # Where sensors see the edges of boards tells nothing of ranges: those that are too long make
    # boards look large, as wide beams do.
    if _told_by_data(equations, usual, priors, RANGE_SCALES, True).told_ranges > _TOLD:
        if with_cameras:
            return (
                "the data hardly tell whether all ranges are too long or too short alike: 1 % may "
                "go unnoticed; collect more boards that cameras and range sensors see together, "
                "near and far, or measure a distance between two sensors",
            )
        return (
            "nothing in the data tells whether all ranges are too long or too short alike: where "
            "they are 1 % too long, so are all distances; measure one between two sensors, or add "
            "a camera",
        )
    told = _told_by_data(equations, usual, priors, (BoardSize,), False).told_board_size
    return (_size_in_words(told, hints),) if told > _TOLD else ()


def _size_in_words(told: float, hints: Sequence[Hint]) -> str:
    """Return what all distances rest on where the boards' size is told this poorly, as a part."""
    measure = "measure the print over many squares, since printers scale pages"
    if told > _AT_ALL:
        return (
            "nothing in the data tells how large the boards are: all distances are as right as the "
            f"configured `size`, and 1 % of it is 1 % of them; {measure}"
        )
    sigma = max([told, *(hint.sigma for hint in hints)])
    found = [described(hint.error, hint.value, max(told, hint.sigma)) for hint in hints]
    seen = f"; as far as they do, {', '.join(found)}" if found else ""
    return (
        f"the data tell how large the boards are to {100.0 * sigma:.2g} % only, and 1 % of the "
        f"configured `size` is 1 % of all distances{seen}: {measure}"
    )


def _told_by_data(
    equations: SharedEquations,
    usual: Mapping[ModelError, float],
    priors: ErrorPriors,
    kinds: Tuple[Type[ModelError], ...],
    free_borders: bool,
) -> LeftOpen:
    """Return what the data leave open, errors of these kinds among what is not estimated.

    An estimate that is held near what is usual (`--model_errors auto`) tells nothing of the data.
    """
    total = equations.total.copy()
    expected = dict(usual)
    for error, j in equations.place.items():
        prior = priors.get(error)
        if type(error) in kinds and prior is not None and prior.sigma >= error.usual:
            total[j, j] -= (error.step / prior.sigma) ** 2
            expected[error] = error.usual
    return left_open(replace(equations, total=total), expected, free_borders)
