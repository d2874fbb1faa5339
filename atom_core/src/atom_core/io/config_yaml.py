"""config.yml to `CalibrationConfig` and back; every message names file, line and key."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Set, Tuple

import yaml

from atom_core.errors import ConfigError
from atom_core.io.atomic import PathLike, write_text_atomically
from atom_core.model.config import CalibrationConfig
from atom_core.model.config_section import KeyPath

# YAML 1.1, as PyYAML has it, takes 1e-3 and 5.e3 for texts. Everyone who writes them means numbers.
_FLOAT = re.compile(
    r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[0-9]+[eE][-+]?[0-9]+"
    r"|\.[0-9][0-9_]*(?:[eE][-+]?[0-9]+)?)$"
)


class _Loader(yaml.SafeLoader):
    """Plain values only, with numbers such as 1e-3."""


class _Dumper(yaml.SafeDumper):
    """Puts in quotes the texts that `_Loader` would take for numbers."""


for _class in (_Loader, _Dumper):
    _class.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


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
    text = _read_text(path)
    root = _compose(path, text)
    if root is None:
        raise ConfigError(f"{path}: the file is empty; a configuration is expected")
    _refuse_duplicates(path, root)

    def locate(key_path: KeyPath) -> str:
        return f"{path}:{_line_of(root, key_path)}"

    config = CalibrationConfig.from_document(_construct(path, text), str(path), locate)
    return config, locate


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
        reason = (error.strerror or str(error)).lower()
        raise ConfigError(f"{path}: the configuration cannot be read ({reason})") from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ConfigError(f"{path}:{line}: a byte that is not UTF-8; save it as UTF-8") from error


def _compose(path: PathLike, text: str) -> Optional[yaml.Node]:
    """Return the tree of nodes, which know their lines."""
    try:
        return yaml.compose(text, Loader=_Loader)
    except (yaml.YAMLError, RecursionError) as error:
        raise _syntax_error(path, text, error) from error


def _construct(path: PathLike, text: str) -> Any:
    # From the text again: constructing from the nodes would rearrange them where '<<' merges maps.
    try:
        return yaml.load(text, Loader=_Loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise _syntax_error(path, text, error) from error


def _syntax_error(path: PathLike, text: str, error: Exception) -> ConfigError:
    """Put a parser's error, which takes many lines, into one."""
    if isinstance(error, yaml.reader.ReaderError):
        line = text[: error.position].count("\n") + 1
        return ConfigError(f"{path}:{line}: a character that YAML does not allow; remove it")
    if isinstance(error, RecursionError):
        return ConfigError(f"{path}: lists or maps are nested too deeply")
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


def _refuse_duplicates(path: PathLike, root: yaml.Node) -> None:
    """YAML forbids a key to stand twice in a map; PyYAML silently takes the last."""
    seen: Set[int] = set()
    pending: List[Tuple[KeyPath, yaml.Node]] = [((), root)]
    while pending:
        place, node = pending.pop()
        if id(node) in seen:  # an alias
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            pending.extend(((*place, str(i)), child) for i, child in enumerate(node.value))
        elif isinstance(node, yaml.MappingNode):
            _refuse_duplicates_in(path, place, node)
            pending.extend(((*place, str(key.value)), child) for key, child in node.value)


def _refuse_duplicates_in(path: PathLike, place: KeyPath, node: yaml.MappingNode) -> None:
    first_line: Dict[str, int] = {}
    for key, _value in node.value:
        if not isinstance(key, yaml.ScalarNode):
            continue
        line = key.start_mark.line + 1
        if key.value in first_line:
            raise ConfigError(
                f"{path}:{line}: {'.'.join((*place, key.value))} stands here a second time (first "
                f"in line {first_line[key.value]}); remove or rename one"
            )
        first_line[key.value] = line


def _line_of(root: yaml.Node, key_path: KeyPath) -> int:
    """Return the line of a key, or of the innermost map on the way to it that is there."""
    node, line = root, root.start_mark.line + 1
    for name in key_path:
        if not isinstance(node, yaml.MappingNode):
            break
        hit = next((pair for pair in node.value if pair[0].value == name), None)
        if hit is None:
            break
        line, node = hit[0].start_mark.line + 1, hit[1]
    return line
