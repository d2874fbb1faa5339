"""Errors of the suite: each names what is wrong, where, and the remedy in one sentence.

Only a command's ``main`` turns them into an exit code (2, nothing written).
"""

from __future__ import annotations

from typing import Iterable


def quoted(names: Iterable[str]) -> str:
    """Return names as a message has them: ``'a', 'b'``."""
    return ", ".join(f"'{name}'" for name in names)


class AtomError(Exception):
    """Base of every error that a user can mend; ``str(error)`` is one line."""

    def __init__(self, message: str):
        super().__init__(" ".join(message.split()))


class DatasetError(AtomError):
    """A dataset (its JSON, its data files, its labels) cannot be used as asked."""


class NothingMeasuredError(DatasetError):
    """A sensor has measured nothing at all: nothing is within its reach, or it is covered."""


class ConfigError(AtomError):
    """A calibration configuration is malformed or inconsistent."""


class DescriptionError(AtomError):
    """A robot description (URDF, xacro) cannot be read or written."""


class SelectionError(AtomError):
    """A selection of sensors, collections or patterns names nothing or is malformed."""


class LabelingError(AtomError):
    """Data of a sensor cannot be labeled: their type, size or unit is not what was configured."""


class CalibrationError(AtomError):
    """The calibration problem cannot be posed: nothing to solve, or parts not connected."""


class NativeModuleError(AtomError):
    """A function needs the compiled module ``atom_core._core``, which is not built."""


class OutputError(AtomError):
    """Results cannot be written where they were asked for."""
