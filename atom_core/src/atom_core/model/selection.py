"""Selections of names: plain names, globs, exclusions, and ATOM's lambda strings without eval.

``front_*``, ``rgb_1``, ``!lidar_2`` (all but), or ``lambda name: name in ["a", "b"]``.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Iterable, List, Optional, Sequence

from atom_core.errors import SelectionError
from atom_core.model.selection_lambda import holds


def select_names(
    names: Iterable[str],
    expressions: Optional[Sequence[str]],
    what: str = "name",
    may_be_empty: bool = False,
) -> List[str]:
    """Return the names that any expression selects, in their order; None selects all.

    Args:
        names: what there is.
        expressions: names, globs, exclusions, lambdas.
        what: what they are names of, for messages.
        may_be_empty: a lambda that holds for none, and exclusions of all that there is, select
            nothing instead of being refused. A name or glob that matches nothing is a slip of the
            pen and refused either way.

    Raises:
        SelectionError: an expression is malformed or selects nothing.
    """
    names = list(names)
    if not expressions:
        return names
    excluded = [e[1:] for e in expressions if e.startswith("!")]
    included = [e for e in expressions if not e.startswith("!")]
    chosen = set() if included else set(names)
    for expression in included:
        chosen |= _matches(names, expression, what, may_be_empty)
    for expression in excluded:
        chosen -= _matches(names, expression, what, may_be_empty)
    if not chosen and not may_be_empty:
        raise SelectionError(f"the selection leaves no {what}; {_there_are(names)}")
    return [n for n in names if n in chosen]


def is_lambda(expression: str) -> bool:
    """Tell whether a selection is a condition, which may hold for nothing, and no name."""
    return expression.lstrip("! ").startswith("lambda")


def _matches(names: Sequence[str], expression: str, what: str, may_be_empty: bool) -> set:
    if is_lambda(expression):
        found = {n for n in names if holds(expression, n)}
    else:
        found = {n for n in names if n == expression or fnmatchcase(n, expression)}
    if not found and not (may_be_empty and is_lambda(expression)):
        raise SelectionError(f"no {what} matches '{expression}'; {_there_are(names)}")
    return found


def _there_are(names: Sequence[str]) -> str:
    return f"there are: {', '.join(names) or 'none'}"
