"""Expansion of xacro by ROS's own module ``xacro``, with errors that say file and line.

A xacro file is a program: it may read other files, and need not end. So it is expanded in a
process of its own, within limits of time and memory.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
from pathlib import Path
from types import ModuleType
from typing import Dict, Iterator, Mapping, Optional, Tuple
from xml.parsers import expat

from atom_core.errors import ConfigError, DescriptionError
from atom_core.io.limited import run_limited
from atom_core.io.paths import PackageResolver, package_folder

_XACRO_SYNTAX = re.compile(r"<xacro:|\$\{|\$\(")
_FIND = re.compile(r"\$\(\s*find\s+([^\s)]+)\s*\)")
_WITH_NAME = re.compile(r"expression '([^']+)'|macro name: (\S+)|\"([^\"]+)\"")
LONGEST_S, MOST_BYTES = 60.0, 2 << 30  # of an expansion; a robot with all its macros takes 1 s


def needs_xacro(text: str, path: Path) -> bool:
    """Tell whether a description must be expanded before it is a URDF.

    A URDF that xacro made names xacro still, and its comments may hold what they did before.
    """
    is_xacro = path.suffix == ".xacro" or "xmlns:xacro" in text
    return is_xacro and _XACRO_SYNTAX.search(_without_comments(text)) is not None


def _without_comments(text: str) -> str:
    before, *others = text.split("<!--")
    return before + "".join(part.partition("-->")[2] for part in others)


def expand_xacro(
    path: Path,
    arguments: Mapping[str, str],
    resolve_package: Optional[PackageResolver],
    shown_path: Optional[Path] = None,
) -> Tuple[str, Tuple[str, ...]]:
    """Return the URDF text that a xacro file makes, and the warnings of xacro.

    Args:
        path: the file.
        arguments: values of its ``xacro:arg`` by name.
        resolve_package: folder of a package by name, for ``$(find package)``; ROS's when None.
        shown_path: name of the file in messages, when another than path.

    Raises:
        DescriptionError: xacro is absent, refuses the file, or does not end within `LONGEST_S`
            and `MOST_BYTES`.
    """
    shown = shown_path or path
    xacro = _import_xacro(shown)

    def expanded() -> Dict[str, str]:
        console = io.StringIO()
        with _package_resolver(xacro, resolve_package), _console_into(console):
            try:
                document = xacro.process_file(str(path), mappings=dict(arguments))
                text = document.toprettyxml(indent="  ")
            except Exception as error:  # xacro passes on whatever evaluating a text may raise
                if isinstance(getattr(error, "exc", error), MemoryError):
                    raise MemoryError from error
                return {"refusal": _message(xacro, error, path, shown)}
        return {"text": text, "console": console.getvalue()}

    try:
        answer = run_limited(expanded, LONGEST_S, MOST_BYTES)
    except (TimeoutError, MemoryError, RuntimeError) as error:
        raise DescriptionError(f"{shown}: {_without_end(error)}") from error
    if "refusal" in answer:
        raise DescriptionError(answer["refusal"])
    return answer["text"], tuple(line for line in answer["console"].splitlines() if line.strip())


def _without_end(error: Exception) -> str:
    remedy = "look for a macro or an expression ${...} that does not end"
    if isinstance(error, TimeoutError):
        return f"xacro has not expanded this file within {LONGEST_S:.0f} s; {remedy}"
    if isinstance(error, MemoryError):
        return f"xacro wants more than {MOST_BYTES >> 30} GiB of memory for this file; {remedy}"
    return f"xacro ended without a result ({error}); {remedy}"


def _import_xacro(path: Path) -> ModuleType:
    try:
        return importlib.import_module("xacro")
    except ImportError as error:
        raise DescriptionError(
            f"{path}: this is a xacro file and the Python module xacro is absent; install it "
            f"(`make setup`, or pip install xacro==2.1.1) or give the expanded URDF"
        ) from error


@contextlib.contextmanager
def _console_into(stream: io.StringIO) -> Iterator[None]:
    with contextlib.redirect_stderr(stream), contextlib.redirect_stdout(stream):
        yield


@contextlib.contextmanager
def _package_resolver(xacro: ModuleType, resolve: Optional[PackageResolver]) -> Iterator[None]:
    """Make xacro find packages by our resolver; its own needs roslaunch or ament."""
    original = xacro.eval_extension

    def eval_extension(text: str) -> str:
        match = _FIND.fullmatch(text)
        return str(package_folder(match.group(1), resolve)) if match else original(text)

    xacro.eval_extension = eval_extension  # type: ignore[attr-defined]
    try:
        yield
    finally:
        xacro.eval_extension = original  # type: ignore[attr-defined]


def _message(xacro: ModuleType, error: Exception, path: Path, shown: Path) -> str:
    """Return one sentence: which file and line, what xacro says, what to do."""
    stack = [name for name in getattr(xacro, "filestack", None) or [] if name]
    culprit = Path(stack[-1]) if stack else path
    if isinstance(error, expat.ExpatError):
        line: Optional[int] = error.lineno
        reason, remedy = f"not well-formed XML ({error})", "mend the XML there"
    else:
        reason = _reason(error)
        line = _line_of(reason, culprit)
        remedy = "mend the xacro; `xacro FILE` shows the same error"
    where = str(shown)
    if os.path.abspath(culprit) != os.path.abspath(path):
        where += f": included file {culprit}"
    if line is not None:
        where += f", line {line}"
    return f"{where}: {reason}; {remedy}"


def _reason(error: Exception) -> str:
    inner = getattr(error, "exc", None)
    text = str(inner) if isinstance(inner, ConfigError) else str(error) or repr(error)
    macros = [macro.body.getAttribute("name") for macro in getattr(error, "macros", None) or []]
    return text + "".join(f", in macro '{name}'" for name in macros)


def _line_of(reason: str, path: Path) -> Optional[int]:
    """Return the first line that holds what xacro complains of: it gives no line itself."""
    match = _WITH_NAME.search(reason)
    if match is None or not path.is_file():
        return None
    name = next(group for group in match.groups() if group)
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return next((number for number, line in enumerate(lines, 1) if name in line), None)
