"""Which kind of value stands where in a JSON document, checked once, before anything reads it.

A structure is made of functions that take a value and its place and raise `MalformedError` where
it is of another kind: `TEXT`, `NUMBER`, ..., and what `keys`, `each` and `items` make of others.
JSON schemas would say the same, but their checkers take longer than all the rest of reading a
dataset.
"""

from __future__ import annotations

import json
import math
from typing import Any, Callable, Tuple

Place = Tuple[str, ...]
# What reading a document raises where a value of it is of another kind: a text for a number, a list
# that is too short, a number that is infinite.
OTHER_KIND = (KeyError, IndexError, ValueError, TypeError, AttributeError, ArithmeticError)
Check = Callable[[Any, Place], None]


class MalformedError(ValueError):
    """A value is of another kind than it must be.

    Attributes:
        place: the keys that lead to it.
        problem: which value stands there, and what should.
    """

    def __init__(self, value: Any, place: Place, wanted: str):
        """Take the value, where it stands, and what should stand there."""
        self.place, self.problem = place, f"is {shown(value)}, where {wanted} should stand"
        super().__init__(f"{'.'.join(place)} {self.problem}")


def shown(value: Any) -> str:
    """Return a value as JSON, no more of it than fits into a sentence."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**20:
        return "a number of very many digits"
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:40] + "..."


def keys(**known: Check) -> Check:
    """Return what accepts a map whose known keys, where they are there, have these values."""
    checks = list(known.items())

    def check(value: Any, place: Place) -> None:
        MAP(value, place)
        for key, inner in checks:
            if key in value:
                inner(value[key], (*place, key))

    return check


def each(inner: Check) -> Check:
    """Return what accepts a map whose values are all of one kind."""

    def check(value: Any, place: Place) -> None:
        MAP(value, place)
        for key, item in value.items():
            inner(item, (*place, key))

    return check


def items(inner: Check) -> Check:
    """Return what accepts a list whose items are all of one kind."""

    def check(value: Any, place: Place) -> None:
        LIST(value, place)
        for index, item in enumerate(value):
            inner(item, (*place, str(index)))

    return check


def or_null(inner: Check) -> Check:
    """Return what accepts null, too."""

    def check(value: Any, place: Place) -> None:
        if value is not None:
            inner(value, place)

    return check


def _kind(accepts: Callable[[Any], bool], wanted: str) -> Check:
    def check(value: Any, place: Place) -> None:
        if not accepts(value):
            raise MalformedError(value, place, wanted)

    return check


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300


def _is_whole(value: Any) -> bool:
    return _is_number(value) and math.isfinite(value) and value == int(value)


MAP = _kind(lambda v: isinstance(v, dict), "names with values")
LIST = _kind(lambda v: isinstance(v, list), "a list")
TEXT = _kind(lambda v: isinstance(v, str), "text")
NUMBER = _kind(_is_number, "a finite number")
WHOLE = _kind(_is_whole, "a whole number")
TEXT_OR_NUMBER = _kind(lambda v: isinstance(v, str) or _is_number(v), "text or a number")
FLAG = _kind(lambda v: isinstance(v, (bool, int)) and v in (0, 1), "true or false")
