"""Selections of names: plain names, globs, exclusions, and ATOM's lambda strings without eval.

``front_*``, ``rgb_1``, ``!lidar_2`` (all but), or ``lambda name: name in ["a", "b"]``. A lambda is
parsed and walked over a whitelist of operations; nothing else can be expressed.
"""

from __future__ import annotations

import ast
import operator
import re
from fnmatch import fnmatchcase
from typing import Any, Callable, Dict, Iterable, List, Optional, Sequence

from atom_core.errors import SelectionError

_COMPARISONS: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
}
_ARITHMETIC: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mod: lambda a, b: operator.mod(a, b) if isinstance(a, (int, float)) else _refuse("%"),
}
_FUNCTIONS: Dict[str, Callable[..., Any]] = {"int": int, "float": float, "str": str, "len": len}
_METHODS = ("startswith", "endswith", "lower", "upper", "isdigit", "isalpha", "find", "count")
_DEEPEST = 50  # brackets, or operators that take what follows them


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
        found = {n for n in names if _evaluate_lambda(expression, n)}
    else:
        found = {n for n in names if n == expression or fnmatchcase(n, expression)}
    if not found and not (may_be_empty and is_lambda(expression)):
        raise SelectionError(f"no {what} matches '{expression}'; {_there_are(names)}")
    return found


def _there_are(names: Sequence[str]) -> str:
    return f"there are: {', '.join(names) or 'none'}"


def _evaluate_lambda(text: str, name: str) -> bool:
    try:
        if _is_nested_deeply(text):
            raise RecursionError
        tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        raise SelectionError(f"selection '{text}' is not a valid lambda: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError):  # a NUL byte; brackets within brackets
        raise SelectionError(f"selection '{text[:40]}...' cannot be read as a lambda") from None
    if not isinstance(tree, ast.Lambda) or len(tree.args.args) != 1:
        raise SelectionError(f"selection '{text}' must be a lambda of one name")
    try:
        return bool(_value(tree.body, tree.args.args[0].arg, name))
    except SelectionError as error:
        raise SelectionError(f"selection '{text}': {error}") from None
    except (TypeError, ValueError, LookupError, ArithmeticError, RecursionError) as error:
        raise SelectionError(f"selection '{text}' fails on '{name}': {error}") from None


def _is_nested_deeply(text: str) -> bool:
    """Tell whether Python's parser might not come back: that of 3.9 then ends the process."""
    depth = deepest = 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        deepest = max(deepest, depth)
    nesting = sum(len(re.findall(word, text)) for word in (r"\*\*", r"\b(?:not|lambda|if)\b"))
    prefixes = max(map(len, re.findall(r"[-+~\s]+", text)), default=0)
    return max(deepest, nesting, prefixes) > _DEEPEST


def _value(node: ast.AST, argument: str, name: str) -> Any:
    """Evaluate one node of the whitelist."""

    def inner(child: ast.AST) -> Any:
        return _value(child, argument, name)

    if isinstance(node, ast.Constant) and isinstance(node.value, (str, int, float, bool)):
        return node.value
    if isinstance(node, ast.Name) and node.id == argument:
        return name
    if isinstance(node, (ast.List, ast.Tuple, ast.Set)):
        return [inner(element) for element in node.elts]
    if isinstance(node, ast.BoolOp):
        combine = all if isinstance(node.op, ast.And) else any
        return combine(inner(v) for v in node.values)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        return (not inner(node.operand)) if isinstance(node.op, ast.Not) else -inner(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        return _ARITHMETIC[type(node.op)](inner(node.left), inner(node.right))
    if isinstance(node, ast.Compare):
        return _compare(node, inner)
    if isinstance(node, ast.Call) and not node.keywords:
        return _call(node, inner)
    return _refuse(type(node).__name__)


def _compare(node: ast.Compare, inner: Callable[[ast.AST], Any]) -> bool:
    left = inner(node.left)
    for operation, right_node in zip(node.ops, node.comparators):
        if type(operation) not in _COMPARISONS:
            return _refuse(type(operation).__name__)
        right = inner(right_node)
        if not _COMPARISONS[type(operation)](left, right):
            return False
        left = right
    return True


def _call(node: ast.Call, inner: Callable[[ast.AST], Any]) -> Any:
    arguments = [inner(a) for a in node.args]
    function = node.func
    if isinstance(function, ast.Name) and function.id in _FUNCTIONS and len(arguments) == 1:
        return _FUNCTIONS[function.id](*arguments)
    if isinstance(function, ast.Name) and function.id == "range" and len(arguments) in (1, 2):
        return range(*arguments)
    if isinstance(function, ast.Attribute) and function.attr in _METHODS:
        owner = inner(function.value)
        if isinstance(owner, str):
            return getattr(owner, function.attr)(*arguments)
    return _refuse("this call")


def _refuse(what: str) -> Any:
    raise SelectionError(
        f"{what} is not allowed; use comparisons, and/or/not, in, int(), len(), startswith(), "
        f"endswith(), or give names and globs"
    )
