"""Conditions on names that look like Python's lambdas, evaluated without eval.

A lambda is parsed and walked over a whitelist: text, numbers, lists and comparisons of them.
Nothing else can be expressed, and what it can has bounds: of depth, of steps, of the length of a
text or list and of the size of a number, so that no text takes the memory or the day.
"""

from __future__ import annotations

import ast
import operator
import re
from functools import lru_cache
from typing import Any, Callable, Dict, Iterator, List, Mapping, Sequence, Type

from atom_core.errors import SelectionError

_DEEPEST = 50  # brackets, or operators that take what follows them
_MOST_BRACKETS = 1000
_MOST_STEPS = 100_000  # for one name: operations, elements walked, a part of what is handled
_LONGEST = 10_000  # a text
_LARGEST_LIST = 100_000  # all elements and letters in it
_LARGEST = 10**18  # a whole number
_PER_STEP = 20  # elements and letters that are handled in a step
_MOST_DIGITS = 400  # of a text that becomes a number

_NUMBERS = (int, float)  # and bool
_COMPARISONS: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda a, b: _is_in(a, b),
    ast.NotIn: lambda a, b: not _is_in(a, b),
}
_OF_NUMBERS: Dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_OF_SETS: Dict[type, Callable[[Any, Any], Any]] = {
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.Sub: operator.sub,
}
_ANY = (str, *_NUMBERS, type(None))
_FUNCTIONS: Dict[str, Callable[..., Any]] = {
    **{"int": int, "float": float, "str": str, "bool": bool, "len": len, "abs": abs},
    **{"min": min, "max": max, "sum": sum, "any": any, "all": all, "sorted": sorted},
    **{"list": list, "tuple": tuple, "set": set, "range": range},
}
_WALKERS = ("min", "max", "sum", "any", "all", "sorted", "list", "tuple", "set")
_TESTS = ("isdigit", "isdecimal", "isnumeric", "isalpha", "isalnum", "islower", "isupper")
_METHODS = (
    *("startswith", "endswith", "find", "count", *_TESTS, "lower", "upper"),
    *("strip", "lstrip", "rstrip", "split", "rsplit", "partition", "replace", "zfill", "join"),
)


def holds(text: str, name: str) -> bool:
    """Tell whether a condition holds for a name.

    Args:
        text: such as ``lambda x: int(x) in range(0, 12, 2)``.
        name: what its argument is.

    Raises:
        SelectionError: the text is no such condition, or fails on the name.
    """
    condition = _parsed(text)
    try:
        return bool(_Evaluation().value(condition.body, {condition.args.args[0].arg: name}))
    except SelectionError as error:
        raise SelectionError(f"selection '{text}': {error}") from None
    except (TypeError, ValueError, LookupError, ArithmeticError, RecursionError) as error:
        raise SelectionError(f"selection '{text}' fails on '{name}': {error}") from None


@lru_cache(maxsize=8)
def _parsed(text: str) -> ast.Lambda:
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
    return tree


def _is_nested_deeply(text: str) -> bool:
    """Tell whether Python's parser might not come back: that of 3.9 then ends the process."""
    depth = deepest = 0
    brackets = sum(map(text.count, "([{"))
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        deepest = max(deepest, depth)
    nesting = sum(len(re.findall(word, text)) for word in (r"\*\*", r"\b(?:not|lambda|if|for)\b"))
    prefixes = max(map(len, re.findall(r"[-+~\s]+", text)), default=0)
    return brackets > _MOST_BRACKETS or max(deepest, nesting, prefixes) > _DEEPEST


class _Evaluation:
    """Evaluates one condition for one name; counts its steps."""

    def __init__(self) -> None:
        self._steps = 0

    def value(self, node: ast.AST, known: Mapping[str, Any]) -> Any:
        """Return the value of a node of the whitelist.

        Args:
            node: of the condition.
            known: values of the names in it.
        """
        self._count(1)
        for kind, evaluate in _NODES.items():
            if isinstance(node, kind):
                return self._bounded(evaluate(self, node, known))
        return _refuse(type(node).__name__)

    def _count(self, steps: int) -> None:
        self._steps += steps
        if self._steps > _MOST_STEPS:
            raise SelectionError("it takes too many steps; give names or globs")

    def _bounded(self, value: Any) -> Any:
        if isinstance(value, int) and abs(value) > _LARGEST:
            raise SelectionError("a number in it grows too large")
        size = _size(value)
        if size > (_LONGEST if isinstance(value, str) else _LARGEST_LIST):
            raise SelectionError("a text or list in it grows too long")
        self._count(size // _PER_STEP)
        return value

    def walk(self, values: Any) -> Iterator[Any]:
        """Yield the elements of a value, each a step."""
        for value in values:
            self._count(1)
            yield value

    def constant(self, node: ast.Constant, _: Mapping[str, Any]) -> Any:
        return node.value if isinstance(node.value, _ANY) else _refuse("this constant")

    def named(self, node: ast.Name, known: Mapping[str, Any]) -> Any:
        return known[node.id] if node.id in known else _refuse(f"'{node.id}'")

    def listed(self, node: Any, known: Mapping[str, Any]) -> Any:
        elements: List[Any] = []
        for element in node.elts:
            if isinstance(element, ast.Starred):
                elements += self.walk(self.value(element.value, known))
            else:
                elements.append(self.value(element, known))
        kinds: Dict[type, Type[Any]] = {ast.List: list, ast.Tuple: tuple, ast.Set: set}
        return kinds[type(node)](elements)

    def both(self, node: ast.BoolOp, known: Mapping[str, Any]) -> Any:
        ends = isinstance(node.op, ast.Or)
        value: Any = None
        for child in node.values:
            value = self.value(child, known)
            if bool(value) is ends:
                break
        return value

    def unary(self, node: ast.UnaryOp, known: Mapping[str, Any]) -> Any:
        value = self.value(node.operand, known)
        if isinstance(node.op, ast.Not):
            return not value
        return -value if isinstance(node.op, ast.USub) else _refuse(type(node.op).__name__)

    def binary(self, node: ast.BinOp, known: Mapping[str, Any]) -> Any:
        one, other = self.value(node.left, known), self.value(node.right, known)
        kind = type(node.op)
        if isinstance(one, _NUMBERS) and isinstance(other, _NUMBERS) and kind in _OF_NUMBERS:
            return _OF_NUMBERS[kind](one, other)
        if kind in _OF_SETS and isinstance(one, (set, int)) and isinstance(other, (set, int)):
            return _OF_SETS[kind](one, other)
        if kind is ast.Add or kind is ast.Sub:  # texts and lists join; all else fails by itself
            return _OF_NUMBERS[kind](one, other)
        return _refuse(f"{_SIGNS.get(kind, kind.__name__)} between these")

    def compare(self, node: ast.Compare, known: Mapping[str, Any]) -> Any:
        left = self.value(node.left, known)
        for operation, right_node in zip(node.ops, node.comparators):
            right = self.value(right_node, known)
            if not _COMPARISONS[type(operation)](left, right):
                return False
            left = right
        return True

    def chosen(self, node: ast.IfExp, known: Mapping[str, Any]) -> Any:
        return self.value(node.body if self.value(node.test, known) else node.orelse, known)

    def element(self, node: ast.Subscript, known: Mapping[str, Any]) -> Any:
        owner, place = self.value(node.value, known), node.slice
        if not isinstance(owner, (str, list, tuple, range)):
            return _refuse("this [...]")
        if isinstance(place, ast.Slice):
            parts = (place.lower, place.upper, place.step)
            return owner[slice(*(None if p is None else self.value(p, known) for p in parts))]
        if type(place).__name__ == "Index":  # Python 3.8 has it around the place
            place = place.value  # type: ignore[attr-defined]
        return owner[self.value(place, known)]

    def comprehension(self, node: Any, known: Mapping[str, Any]) -> Any:
        found = self._generated(node, list(node.generators), known)
        if isinstance(node, ast.GeneratorExp):
            return found
        return list(found) if isinstance(node, ast.ListComp) else set(found)

    def _generated(
        self, node: Any, generators: Sequence[ast.comprehension], known: Mapping[str, Any]
    ) -> Iterator[Any]:
        if not generators:
            yield self.value(node.elt, known)
            return
        first, *others = generators
        if not isinstance(first.target, ast.Name) or first.is_async:
            _refuse("this 'for'")
        name = first.target.id  # type: ignore[attr-defined]
        for value in self.walk(self.value(first.iter, known)):
            inside = {**known, name: value}
            if all(self.value(condition, inside) for condition in first.ifs):
                yield from self._generated(node, others, inside)

    def call(self, node: ast.Call, known: Mapping[str, Any]) -> Any:
        function = node.func
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            return _refuse("this call")
        if isinstance(function, ast.Name) and function.id in _FUNCTIONS:
            arguments = [self.value(a, known) for a in node.args]
            return self._function(function.id, arguments)
        if isinstance(function, ast.Attribute) and function.attr in _METHODS:
            owner = self.value(function.value, known)
            arguments = [self.value(a, known) for a in node.args]
            if isinstance(owner, str):
                return self._method(owner, function.attr, arguments)
        return _refuse("this call")

    def _function(self, name: str, arguments: List[Any]) -> Any:
        first = arguments[0] if arguments else None
        if name in ("int", "float", "str"):
            if len(arguments) > 1 or not isinstance(first, _ANY):
                return _refuse(f"this {name}()")
            if name != "str" and isinstance(first, str) and len(first) > _MOST_DIGITS:
                raise SelectionError("a number in it has too many digits")
        if name == "sum" and (len(arguments) != 1 or isinstance(first, str)):
            return _refuse("this sum()")
        if name in _WALKERS and len(arguments) == 1:
            arguments = [self._summed(first) if name == "sum" else self.walk(first)]
        return _FUNCTIONS[name](*arguments)

    def _summed(self, values: Any) -> Iterator[Any]:
        for value in self.walk(values):
            yield value if isinstance(value, _NUMBERS) else _refuse("this sum()")

    def _method(self, owner: str, name: str, arguments: List[Any]) -> Any:
        if name == "join" and len(arguments) == 1:
            arguments = [list(self.walk(arguments[0]))]
            self._check_length(len(owner) * len(arguments[0]) + _length(arguments[0]))
        if name == "replace":
            self._check_length((len(owner) + 1) * (1 + _length(arguments[1:2])))
        if name == "zfill":
            self._check_length(max([0, *(a for a in arguments if isinstance(a, int))]))
        return getattr(owner, name)(*arguments)

    def _check_length(self, length: int) -> None:
        if length > _LONGEST:
            raise SelectionError("a text in it grows too long")


def _size(value: Any) -> int:
    """Return the letters of a text, or the elements of a list with what is in them; 1 else."""
    if isinstance(value, str):
        return len(value)
    if isinstance(value, (list, tuple, set)):
        return len(value) + sum(map(_size, value))
    return 1


def _length(texts: Sequence[Any]) -> int:
    return sum(len(text) for text in texts if isinstance(text, str))


def _is_in(value: Any, values: Any) -> bool:
    if isinstance(values, range) and not isinstance(value, int):  # else Python walks all of it
        whole = isinstance(value, float) and value.is_integer()
        return whole and int(value) in values
    return value in values


def _refuse(what: str) -> Any:
    raise SelectionError(
        f"{what} is not allowed; use text, numbers, lists, comparisons, and/or/not, in, [..:..], "
        f"int(), len(), range(), any(), startswith(), split() and the like, or give names and globs"
    )


_SIGNS = {ast.Mult: "*", ast.Mod: "%", ast.Div: "/", ast.FloorDiv: "//", ast.Pow: "**"}
_NODES: Dict[Any, Callable[..., Any]] = {
    ast.Constant: _Evaluation.constant,
    ast.Name: _Evaluation.named,
    (ast.List, ast.Tuple, ast.Set): _Evaluation.listed,
    ast.BoolOp: _Evaluation.both,
    ast.UnaryOp: _Evaluation.unary,
    ast.BinOp: _Evaluation.binary,
    ast.Compare: _Evaluation.compare,
    ast.IfExp: _Evaluation.chosen,
    ast.Subscript: _Evaluation.element,
    (ast.GeneratorExp, ast.ListComp, ast.SetComp): _Evaluation.comprehension,
    ast.Call: _Evaluation.call,
}
