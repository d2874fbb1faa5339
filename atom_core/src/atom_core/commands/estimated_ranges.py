"""What a calibration estimated of ranges and backs of boards, and a test set still has in it."""

from __future__ import annotations

from pathlib import Path
from typing import Iterable, List, Mapping, Type

from atom_core.calibration.refine.error_words import described
from atom_core.errors import DatasetError
from atom_core.io.calibration_json import StoredError, calibration_file, read_calibration
from atom_core.problem.board_errors import BoardThickness
from atom_core.problem.model_errors import (
    DepthOffset,
    DepthScale,
    ModelError,
    RangeOffset,
    RangeScale,
)

_TOLD: Mapping[str, Type[ModelError]] = {  # what holds points off the board's plane
    kind.__name__: kind
    for kind in (RangeOffset, RangeScale, DepthOffset, DepthScale, BoardThickness)
}
_LEAST, _SIGMAS = 0.005, 3.0  # [m], or a share of the range
_FEW = 3


def estimated_range_remarks(train: Path, names: Iterable[str]) -> List[str]:
    """Return a sentence where the calibration found errors that are in the measured data all along.

    Args:
        train: the calibrated dataset; what was found stands in the ``calibration.json`` beside it.
        names: of the sensors and boards that are compared.
    """
    try:
        found = read_calibration(train).model_errors if calibration_file(train).is_file() else ()
    except DatasetError:  # of another program
        return []
    compared = set(names)
    large = sorted((e for e in found if e.target in compared and _is_large(e)), key=_size)[::-1]
    if not large:
        return []
    told = "; ".join(
        described(_TOLD[str(e.type)](e.target), e.value, e.sigma) for e in large[:_FEW]
    )
    return [
        f"the calibration estimated what the test set's data still have in them: {told}. With the "
        f"right calibration points are that far off the board here, too, and one that was made "
        f"without estimating it looks better"
    ]


def _is_large(error: StoredError) -> bool:
    return error.type in _TOLD and _size(error) > max(_LEAST, _SIGMAS * error.sigma)


def _size(error: StoredError) -> float:
    return abs(error.value)
