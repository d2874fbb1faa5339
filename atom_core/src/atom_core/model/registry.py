"""Values that are known by their names."""

from __future__ import annotations

from typing import Dict, Generic, Iterator, Protocol, TypeVar


class Named(Protocol):
    """What can be registered."""

    @property
    def name(self) -> str:
        """What it is known by."""


Value = TypeVar("Value", bound=Named)


class Registry(Generic[Value]):
    """Values by name, in the order in which they were registered; no name twice."""

    def __init__(self, noun: str):
        """Start empty; one such value is called so in messages."""
        self._noun = noun
        self._values: Dict[str, Value] = {}

    def register(self, value: Value) -> None:
        """Add a value to those that there are.

        Raises:
            ValueError: there is one of this name.
        """
        if value.name in self._values:
            raise ValueError(f"{self._noun} '{value.name}' is registered already")
        self._values[value.name] = value

    def unregister(self, name: str) -> None:
        """Take a value away again."""
        del self._values[name]

    def __contains__(self, name: object) -> bool:
        """Tell whether there is a value of this name."""
        return name in self._values

    def __iter__(self) -> Iterator[Value]:
        """Go through the values."""
        return iter(self._values.values())

    def __getitem__(self, name: object) -> Value:
        """Return the value of a name.

        Raises:
            ValueError: naming those that there are.
        """
        if name not in self._values:
            raise ValueError(f"{self._noun} '{name}' is unknown; use {', '.join(self._values)}")
        return self._values[str(name)]
