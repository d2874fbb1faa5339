"""Values of a YAML file, checked, with their place for error messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Callable, Sequence, Tuple

import numpy as np
import yaml

from atom_core.io.paths import unread
from atom_core.io.yaml_text import load_yaml_1_1
from atom_examples.cell_simulator.errors import SimulatorError


def read_yaml(path: Path) -> Entry:
    """Read a file that holds a mapping.

    Raises:
        SimulatorError: it is absent or malformed.
    """
    try:
        document = load_yaml_1_1(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        reason = unread(path, error)
        raise SimulatorError(f"{path}: cannot be read ({reason}); give a file") from None
    except (yaml.YAMLError, ValueError) as error:
        raise SimulatorError(f"{path}: no YAML ({error}); mend it") from None
    return Entry(str(path), document)


class Entry:
    """A mapping of the file, with its place for error messages."""

    def __init__(self, place: str, values: Any):
        if not isinstance(values, dict):
            raise SimulatorError(f"{place}: a mapping of keys to values is needed")
        self.place, self.values = place, values

    def get(self, key: str, kind: Callable[[Any], Any]) -> Any:
        """Return a value made by ``kind``.

        Raises:
            SimulatorError: it is absent, or ``kind`` refuses it.
        """
        if key not in self.values:
            raise SimulatorError(f"{self.place}: '{key}' is missing; add it")
        try:
            return kind(self.values[key])
        except (TypeError, ValueError) as error:
            raise SimulatorError(f"{self.place}: '{key}' is malformed ({error}); mend it") from None

    def only(self, keys: Sequence[str]) -> None:
        """Refuse keys that are none of these.

        Raises:
            SimulatorError: naming the first.
        """
        for key in self.values:
            if key not in keys:
                raise SimulatorError(
                    f"{self.place}: '{key}' is unknown; use {', '.join(keys)}, or remove it"
                )

    def part(self, key: str) -> Entry:
        """Return the mapping under a key."""
        return Entry(f"{self.place}: {key}", self.get(key, lambda value: value))


def positive(value: Any) -> float:
    """Return a number above 0."""
    if not 0 < float(value) < float("inf"):
        raise ValueError(f"{value} is not positive")
    return float(value)


def not_negative(value: Any) -> float:
    """Return a number of at least 0."""
    if not 0 <= float(value) < float("inf"):
        raise ValueError(f"{value} is negative or no number")
    return float(value)


def share(value: Any) -> float:
    """Return a number of at least 0 and below 1."""
    if not 0 <= float(value) < 1:
        raise ValueError(f"{value} is not in [0, 1)")
    return float(value)


def count(value: Any) -> int:
    """Return an integer above 0."""
    if int(value) != value or value < 1:
        raise ValueError(f"{value} is no positive integer")
    return int(value)


def pair(value: Any) -> Tuple[float, float]:
    """Return two numbers."""
    first, second = value
    return float(first), float(second)


def triple(value: Any) -> np.ndarray:
    """Return three finite numbers (3,)."""
    numbers = np.array([float(number) for number in value])
    if numbers.shape != (3,) or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{value} is not three numbers")
    return numbers
