"""What all distances of a result rest on, where the data cannot tell whether it is right."""

from __future__ import annotations

from dataclasses import replace
from typing import Mapping, Tuple, Type

from atom_core.calibration.judge.usual_errors import RANGE_SCALES, LeftOpen, left_open
from atom_core.problem.board_errors import BoardSize
from atom_core.problem.model_errors import ErrorPriors, ModelError
from atom_core.solvers.shared_equations import SharedEquations

_TOLD = 0.005  # what is told less exactly, as a part of it, is not told


def untold_scale(
    equations: SharedEquations,
    usual: Mapping[ModelError, float],
    priors: ErrorPriors,
    with_cameras: bool,
) -> Tuple[str, ...]:
    """Return a sentence where the boards' size, or the ranges, are all that tells the scale.

    Args:
        equations: at the solution, with all errors that sensors and boards may have.
        usual: standard deviations of those that the solution has not estimated, in their units.
        priors: of those that it has.
        with_cameras: corners are among what was measured.
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
    if _told_by_data(equations, usual, priors, (BoardSize,), False).told_board_size > _TOLD:
        return (
            "nothing in the data tells how large the boards are: all distances are as right as the "
            "configured `size`, and 1 % of it is 1 % of them; measure the print over many squares, "
            "since printers scale pages",
        )
    return ()


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
    for j, error in enumerate(equations.errors, equations.shared):
        prior = priors.get(error)
        if type(error) in kinds and prior is not None and prior.sigma >= error.usual:
            total[j, j] -= (error.step / prior.sigma) ** 2
            expected[error] = error.usual
    return left_open(replace(equations, total=total), expected, free_borders)
