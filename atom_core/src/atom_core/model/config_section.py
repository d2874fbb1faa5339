"""Reading a configuration's maps key by key: where each value stands, what is wrong with it."""

from __future__ import annotations

import difflib
import math
import re
from copy import deepcopy
from typing import (
    Any,
    Dict,
    Iterator,
    List,
    Mapping,
    Optional,
    Sequence,
    Tuple,
    Type,
    TypeVar,
    Union,
)

from atom_core.errors import ConfigError

KeyPath = Tuple[str, ...]
Key = Union[str, KeyPath]  # a key, or the keys that lead to a value
_T = TypeVar("_T")
_LONGEST_NAME = 100  # characters; names of files hold it, and more
_NAME = re.compile(rf"[A-Za-z0-9_][A-Za-z0-9_.-]{{0,{_LONGEST_NAME - 1}}}")
_TOPIC = re.compile(r"[A-Za-z0-9_/~.-]+")
_MARKUP = frozenset("\"'<>&$`{}")  # of XML, xacro and launch files


class ConfigValueError(ConfigError):
    """A value that cannot be used.

    Attributes:
        problem: what is wrong and the remedy, to be read after the key.
        key_path: the keys that lead to the value.
    """

    def __init__(self, problem: str, key: Key = ()):
        self.problem = problem
        self.key_path: KeyPath = (key,) if isinstance(key, str) else tuple(key)
        super().__init__(f"{'.'.join(self.key_path)} {problem}" if key else problem)

    def within(self, path: KeyPath) -> ConfigValueError:
        """Return the same error, seen from further out."""
        return ConfigValueError(self.problem, (*path, *self.key_path))


class Section:
    """One map of a document. It gives values out by key and collects remarks.

    Text that is empty counts as absent, as ATOM's templates have it (``anchored_sensor: ""``).
    """

    def __init__(
        self,
        document: Any,
        known: Sequence[str],
        path: KeyPath = (),
        remarks: Optional[List[Tuple[KeyPath, str]]] = None,
    ):
        """Look at a map.

        Args:
            document: the map; anything else is refused.
            known: the keys that have a meaning here.
            path: keys that lead to it.
            remarks: list that collects (key path, text) to be shown as warnings.

        Raises:
            ConfigValueError: it is no map, or a key is no text.
        """
        self.path = path
        self.remarks = [] if remarks is None else remarks
        if not isinstance(document, Mapping):
            raise ConfigValueError(f"is {shown(document)}; write a map, 'key: value' lines", path)
        for key in document:
            if not isinstance(key, str):
                raise ConfigValueError(
                    f"has the key {shown(key)}, which YAML does not read as text; put it in quotes",
                    path,
                )
        self._document = document
        self._known = tuple(known)

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value, the default where it is absent or empty."""
        value = self._document.get(key)
        return default if value is None or value == "" else value

    def require(self, key: str, meaning: str) -> Any:
        """Return a value that must be there; `meaning` tells the user what to write."""
        value = self.get(key)
        if value is not None:
            return value
        state = "is empty" if key in self._document else "is absent"
        likely = difflib.get_close_matches(key, self.unknown(), n=1, cutoff=0.75)
        hint = f" (is '{likely[0]}' meant to be it?)" if likely else ""
        raise ConfigValueError(f"{state}{hint}; give {meaning}", (*self.path, key))

    def section(self, key: str, known: Sequence[str]) -> Section:
        """Return the map under a key."""
        return Section(self.get(key), known, (*self.path, key), self.remarks)

    def named(self, key: str, known: Sequence[str]) -> Iterator[Tuple[str, Section]]:
        """Yield (name, section) of a map of named things; none where it is absent or empty."""
        if self.get(key) is not None:
            names = self.section(key, ())
            for name in names._document:
                yield name, names.section(name, known)

    def extra(self) -> Dict[str, Any]:
        """Return a copy of what has no meaning here, and remark on each of its keys."""
        for key in self.unknown():
            absent = [k for k in self._known if k not in self._document]
            likely = difflib.get_close_matches(key, absent, n=1, cutoff=0.75)
            hint = f"; did you mean '{likely[0]}'?" if likely else ""
            self.remark(f"is not a known key, kept but not used{hint}", key)
        return {key: deepcopy(self._document[key]) for key in self.unknown()}

    def remark(self, text: str, *keys: str) -> None:
        """Add a warning about one of the keys."""
        self.remarks.append(((*self.path, *keys), text))

    def build(self, kind: Type[_T], **values: Any) -> _T:
        """Construct a dataclass; its errors are given this section's place."""
        try:
            return kind(**values)
        except ConfigValueError as error:
            raise error.within(self.path) from None

    def knows(self, key: str) -> bool:
        """Tell whether a key has a meaning here."""
        return key in self._known

    def unknown(self) -> List[str]:
        """Return the keys that have no meaning here."""
        return [key for key in self._document if key not in self._known]


def document_of(entry: Any, keys: Sequence[str]) -> Dict[str, Any]:
    """Return an entry's values by key, its unknown keys after them, as a map of its own."""
    document = {key: getattr(entry, key) for key in keys}
    document.update(deepcopy(dict(entry.extra)))
    return document


def shown(value: Any) -> str:
    """Return a value as a message shows it."""
    if value is None or value == "":
        return "empty"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a map"
    if isinstance(value, (list, tuple)):
        return "a list"
    if isinstance(value, str):
        return f"'{value[:60]}'"
    return str(value)[:60]


def choices(options: Sequence[str]) -> str:
    """Return 'a, b or c'."""
    return " or ".join(filter(None, [", ".join(options[:-1]), options[-1]]))


def check_text(value: Any, key: Key, meaning: str = "a text") -> None:
    """Refuse what is not a text with visible characters."""
    if not isinstance(value, str):
        raise ConfigValueError(f"is {shown(value)}; write {meaning} (in quotes if need be)", key)
    if not value.strip():
        raise ConfigValueError(f"is empty; write {meaning}", key)


def check_frame(value: Any, key: Key) -> None:
    """Refuse what cannot be the name of a frame."""
    check_text(value, key, "the name of a frame")
    if any(character.isspace() for character in value):
        raise ConfigValueError(f"is {shown(value)}; the name of a frame has no spaces", key)
    if not value.isprintable() or set(value) & _MARKUP:
        problem = f"is {shown(value)}; the name of a frame has none of {' '.join(sorted(_MARKUP))}"
        raise ConfigValueError(problem, key)


def check_topic(value: Any, key: Key) -> None:
    """Refuse what cannot be the name of a topic."""
    check_text(value, key, "the topic of the sensor's data")
    if not _TOPIC.fullmatch(value):
        problem = f"is {shown(value)}; a topic has letters (a-z), digits, '_' and '/'"
        raise ConfigValueError(problem, key)


def check_name(value: str, key: Key) -> None:
    """Refuse what cannot name a sensor or a pattern: names of files, nodes and displays hold it."""
    if not _NAME.fullmatch(value):
        problem = (
            f"is no name to be used; choose one of letters (a-z), digits, '_', '-' and '.', of "
            f"{_LONGEST_NAME} characters at most, which does not begin with '-' or '.'"
        )
        raise ConfigValueError(problem, key)


def check_optional_text(value: Any, key: Key) -> None:
    """Refuse what is neither None nor a text."""
    if value is not None:
        check_text(value, key)


def check_choice(value: Any, key: Key, options: Sequence[str]) -> None:
    """Refuse what is none of the options."""
    if value not in options:
        raise ConfigValueError(f"is {shown(value)}; use {choices(options)}", key)


def check_flag(value: Any, key: Key, meaning: str) -> None:
    """Refuse what is not true or false."""
    if not isinstance(value, bool):
        raise ConfigValueError(
            f"is {shown(value)}; write true or false without quotes: {meaning}", key
        )


def check_number(
    value: Any, key: Key, unit: str, *, above: Optional[float] = None, at_least: float = -math.inf
) -> None:
    """Refuse what is not a finite number in the range."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        quoted = " without quotes" if isinstance(value, str) else ""
        raise ConfigValueError(f"is {shown(value)}; write a number{quoted} ({unit})", key)
    if isinstance(value, int) and abs(value) > 10**300:
        raise ConfigValueError(f"has too many digits; write a number ({unit})", key)
    if not math.isfinite(value) or value < at_least or (above is not None and value <= above):
        bound = f"above {above:g}" if above is not None else f"of at least {at_least:g}"
        raise ConfigValueError(f"is {value}; write a number {bound} ({unit})", key)
