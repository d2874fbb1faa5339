"""The statements of Python files, without what stands inside expressions: those are most nodes."""

import ast
from functools import lru_cache
from typing import Tuple

_PARTS = ("body", "orelse", "finalbody", "handlers", "cases")


@lru_cache(maxsize=None)
def statements(text: str) -> Tuple[ast.AST, ...]:
    """Return all statements of a source, those inside others, too."""
    found, left = [], [ast.parse(text)]
    while left:
        node = left.pop()
        found.append(node)
        for part in _PARTS:
            left += getattr(node, part, [])
    return tuple(found)
