"""config.yml to `CalibrationConfig` and back; every message names file, line and key."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, Callable, Dict, List, Mapping, Tuple

import ruamel.yaml
import yaml
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.constructor import ConstructorError, RoundTripConstructor, SafeConstructor
from ruamel.yaml.error import MantissaNoDotYAML1_1Warning, YAMLError
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.resolver import VersionedResolver
from ruamel.yaml.scalarbool import ScalarBoolean

from atom_core.errors import ConfigError
from atom_core.io.atomic import PathLike, write_text_atomically
from atom_core.io.paths import unread
from atom_core.io.yaml_text import check_yaml_size
from atom_core.model.config import CalibrationConfig, key_path_as_written
from atom_core.model.config_section import KeyPath


class _Constructor(RoundTripConstructor):
    """Knows the lines of all keys; of a key that stands twice the last value counts."""

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        self.repeated: List[Tuple[str, int, int]] = []  # key, its line, the line before

    def check_mapping_key(
        self, node: Any, key_node: Any, mapping: Any, key: Any, value: Any
    ) -> bool:
        """Note a key that stands twice, and let its value take the place of the one before.

        Raises:
            ConstructorError: the key is a list or a map.
        """
        if isinstance(key, (tuple, Mapping)):
            what = "found a list or a map as a key"
            raise ConstructorError(
                "while reading a map", node.start_mark, what, key_node.start_mark
            )
        if key in mapping:
            here, before = key_node.start_mark.line + 1, mapping.lc.key(key)[0] + 1
            self.repeated.append((str(key), here, before))
        return True


_Constructor.add_constructor(None, SafeConstructor.construct_undefined)  # plain values only


class _Dumper(yaml.SafeDumper):
    """Puts in quotes the texts that a reader would take for numbers."""


# YAML 1.1, as PyYAML has it, takes 1e-3 and 5.e3 for texts. Everyone who writes them means numbers.
_Dumper.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+"
        r"|\.[0-9][0-9_]*(?:[eE][-+]?[0-9]+)?)$"
    ),
    list("-+.0123456789"),
)


class _Resolver(VersionedResolver):
    """Takes for numbers and booleans what PyYAML, and with it ATOM, does: yes and no, but not y."""

    @property
    def versioned_resolver(self) -> Dict[str, List[Any]]:
        """Return tags and patterns of plain texts by their first character."""
        return _Dumper.yaml_implicit_resolvers


def read_config(path: PathLike) -> CalibrationConfig:
    """Read a configuration.

    Args:
        path: the YAML file.

    Returns:
        The configuration; show its ``warnings`` to the user.

    Raises:
        ConfigError: one line, ``file:line: key problem; remedy``.
    """
    return read_config_with_places(path)[0]


def read_config_with_places(path: PathLike) -> Tuple[CalibrationConfig, Callable[[KeyPath], str]]:
    """Read a configuration; return it and a function that tells where a key stands.

    The function takes a key path such as ``("sensors", "rgb_1", "link")`` and returns
    ``file:line``, for messages about values that only their use shows to be wrong.

    Raises:
        ConfigError: as `read_config`.
    """
    root, repeated = _parse(path, _read_text(path))
    if root is None:
        raise ConfigError(f"{path}: the file is empty; a configuration is expected")

    def locate(key_path: KeyPath) -> str:
        return f"{path}:{_line_of(root, key_path_as_written(root, key_path))}"

    config = CalibrationConfig.from_document(_plain(root), str(path), locate)
    return replace(config, warnings=(*repeated, *config.warnings)), locate


def write_config(path: PathLike, config: CalibrationConfig) -> None:
    """Write a configuration; comments of a file that is replaced are lost.

    Args:
        path: the YAML file.
        config: what to write, its unknown keys included.

    Raises:
        OutputError: the file cannot be written.
    """
    text = yaml.dump(
        config.to_document(), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100
    )
    write_text_atomically(path, text)


def _read_text(path: PathLike) -> str:
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        reason = unread(path, error)
        raise ConfigError(f"{path}: the configuration cannot be read ({reason})") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ConfigError(f"{path}:{line}: a byte that is not UTF-8; save it as UTF-8") from error


def _parse(path: PathLike, text: str) -> Tuple[Any, Tuple[str, ...]]:
    """Return the document, whose maps know their lines, and warnings of keys that stand twice."""
    parser: Any = ruamel.yaml.YAML(typ="rt", pure=True)
    parser.version = (1, 1)  # of PyYAML
    parser.Resolver = _Resolver
    parser.Constructor = _Constructor
    try:
        check_yaml_size(text)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}") from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MantissaNoDotYAML1_1Warning)
            root = parser.load(text)
    except (YAMLError, ValueError) as error:
        raise _syntax_error(path, text, error) from error
    repeated = tuple(
        f"{path}:{here}: {key} stands here a second time (first in line {before}); this one "
        f"counts, remove the other"
        for key, here, before in parser.constructor.repeated
    )
    return root, repeated


def _plain(value: Any) -> Any:
    """Return a value of the parser without what it knows of its place and its spelling."""
    if isinstance(value, Mapping):
        return {_plain(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (bool, ScalarBoolean)):
        return bool(value)
    for kind in (int, float, str):
        if isinstance(value, kind):
            return kind(value)
    return value


def _syntax_error(path: PathLike, text: str, error: Exception) -> ConfigError:
    """Put a parser's error, which takes many lines, into one."""
    if isinstance(error, ReaderError):
        line = text[: error.position].count("\n") + 1
        return ConfigError(f"{path}:{line}: a character that YAML does not allow; remove it")
    start, mark = getattr(error, "context_mark", None), getattr(error, "problem_mark", None)
    if mark is None or (start is not None and mark.index >= len(text.rstrip())):
        mark = start  # what began there was not closed until the end of the file
    if mark is None:
        return ConfigError(f"{path}: this is not valid YAML: {error}")
    place = f"{path}:{mark.line + 1}:{mark.column + 1}"
    if mark.index < len(text) and text[mark.index] == "\t":
        return ConfigError(f"{place}: a tab; YAML is indented with spaces")
    problem = getattr(error, "problem", None) or "syntax error"
    context = getattr(error, "context", None)
    while_doing = f" {context}" if context else ""
    return ConfigError(
        f"{place}: this is not valid YAML{while_doing}: {problem}; check indentation and brackets"
    )


def _line_of(root: Any, key_path: KeyPath) -> int:
    """Return the line of a key, or of the innermost map on the way to it that is there."""
    node = root
    line = node.lc.line if hasattr(node, "lc") else 0
    for name in key_path:
        lines = node.lc.data if isinstance(node, CommentedMap) else None
        if not lines or name not in lines:
            break
        line, node = lines[name][0], node[name]
    return line + 1
