"""Documents as JSON, piece by piece: what `json.dumps` returns, without all of it in memory."""

from __future__ import annotations

from json.encoder import encode_basestring_ascii
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Set

_PIECES, _LONG = 1024, 16384  # pieces, or characters of one, that are written at once
_NUMBERS = {int, float}
_WORDS = {None: "null", True: "true", False: "false"}
_NOT_FINITE = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}


def write_json(
    document: Any,
    write: Callable[[str], Any],
    *,
    sort_keys: bool = True,
    allow_nan: bool = True,
    default: Optional[Callable[[Any], Any]] = None,
) -> None:
    """Write a document with two spaces per level, as ``json.dumps(document, indent=2)`` has it.

    json.dumps makes a text of each number and keeps them all until the last one is there: of
    labels with many points five times what the file holds, which is made once more of them.

    Args:
        document: mappings, lists, numbers, texts.
        write: takes the pieces, one after the other.
        sort_keys: write keys in alphabetical order.
        allow_nan: write numbers that are not finite.
        default: makes what JSON knows of what it does not know.

    Raises:
        ValueError: a number is not finite.
        TypeError: a value or a key is nothing that JSON knows.
    """
    writer = _Writer(write, sort_keys, allow_nan, default)
    writer.add(document, "\n")
    writer.flush()


class _Writer:
    """Gathers pieces; ``line`` begins a line of the list or mapping that a value stands in."""

    def __init__(
        self,
        write: Callable[[str], Any],
        sort_keys: bool,
        allow_nan: bool,
        default: Optional[Callable[[Any], Any]],
    ):
        self._write, self._default = write, default
        self._sort_keys, self._allow_nan = sort_keys, allow_nan
        self._pieces: List[str] = []
        self._texts: Dict[type, Callable[[Any], str]] = {
            str: encode_basestring_ascii,
            int: int.__repr__,
            float: self._float,
            bool: _WORDS.__getitem__,
            type(None): _WORDS.__getitem__,
        }
        self._adders: Dict[type, Callable[[Any, str], None]] = {
            **dict.fromkeys(self._texts, self._add_text),
            list: self._add_list,
            tuple: self._add_list,
            dict: self._add_map,
        }

    def flush(self) -> None:
        self._write("".join(self._pieces))
        self._pieces.clear()

    def add(self, value: Any, line: str) -> None:
        self._adders.get(type(value), self._add_other)(value, line)

    def _add_text(self, value: Any, _line: str) -> None:
        self._pieces.append(self._texts[type(value)](value))

    def _add_list(self, values: Sequence[Any], line: str) -> None:
        if not values:
            self._pieces.append("[]")
            return
        inside = line + "  "
        before, separator = "[" + inside, "," + inside
        kinds = set(map(type, values))
        if kinds <= self._texts.keys():
            self._pieces += [before, self._joined(values, kinds, separator)]
        else:
            for value in values:
                self._pieces.append(before)
                self._adders.get(type(value), self._add_other)(value, inside)
                before = separator
        self._end(line + "]")

    def _joined(self, values: Sequence[Any], kinds: Set[type], separator: str) -> str:
        """Return the texts of values that hold no others."""
        if kinds <= _NUMBERS:
            joined = separator.join(map(repr, values))
            if "n" not in joined:  # neither inf nor nan
                return joined
        return separator.join([self._texts[type(value)](value) for value in values])

    def _add_map(self, values: Mapping[Any, Any], line: str) -> None:
        if not values:
            self._pieces.append("{}")
            return
        inside = line + "  "
        before, separator = "{" + inside, "," + inside
        for key, value in sorted(values.items()) if self._sort_keys else values.items():
            self._pieces += [before, self._key(key), ": "]
            self._adders.get(type(value), self._add_other)(value, inside)
            before = separator
        self._end(line + "}")

    def _end(self, bracket: str) -> None:
        is_long = bool(self._pieces) and len(self._pieces[-1]) > _LONG
        self._pieces.append(bracket)
        if is_long or len(self._pieces) > _PIECES:
            self.flush()

    def _key(self, key: Any) -> str:
        if isinstance(key, str):
            return encode_basestring_ascii(key)
        for kind in (bool, type(None), int, float):
            if isinstance(key, kind):
                return f'"{self._texts[kind](key)}"'
        raise TypeError(f"{type(key).__name__} cannot be a key in JSON")

    def _add_other(self, value: Any, line: str) -> None:
        """Add what is derived from what JSON knows, or what becomes it."""
        for kind in (str, int, float):
            if isinstance(value, kind):
                self._pieces.append(self._texts[kind](value))
                return
        if isinstance(value, (list, tuple)):
            self._add_list(value, line)
        elif isinstance(value, dict):
            self._add_map(value, line)
        elif self._default is None:
            raise TypeError(f"{type(value).__name__} cannot be written as JSON")
        else:
            self.add(self._default(value), line)

    def _float(self, value: float) -> str:
        text = float.__repr__(value)
        if text not in _NOT_FINITE:
            return text
        if not self._allow_nan:
            raise ValueError(f"{text} is not finite")
        return _NOT_FINITE[text]
