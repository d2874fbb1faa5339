"""Paths as configurations write them: package://, file://, ~, variables, relative ones."""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path
from typing import Callable, Optional, Union
from urllib.parse import unquote

from atom_core.errors import ConfigError

PathLike = Union[str, "os.PathLike[str]"]
#: Folder of a package by its name; raises LookupError when there is none.
PackageResolver = Callable[[str], PathLike]

_VARIABLE = re.compile(r"\$(\w+)|\$\{([^}]*)\}")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")


def looked_for(path: PathLike) -> str:
    """Return where a relative path was looked for, to stand behind a reason; else nothing."""
    text = os.fspath(path)
    return "" if os.path.isabs(text) else f", looked for at {os.path.abspath(text)}"


def unread(path: PathLike, error: OSError) -> str:
    """Return why a file cannot be read, in words, and where it was looked for."""
    return (error.strerror or str(error)).lower() + looked_for(path)


def sibling(path: Path, name: str) -> Path:
    """Return where a file of this name is beside another; slashes of the name become _."""
    return path.parent / name.replace("/", "_")


def find_ros_package(name: str) -> Path:
    """Return the folder of a ROS package: the resolver that is used when none is passed.

    Raises:
        LookupError: there is no such package, or rospkg, which knows them, is not installed.
    """
    try:  # optional, and no part of what atom_core needs: hence not an import statement
        rospkg = importlib.import_module("rospkg")
    except ImportError:
        raise LookupError("the Python module rospkg, which finds packages, is absent") from None
    try:
        return Path(rospkg.RosPack().get_path(name))
    except rospkg.ResourceNotFound:
        raise LookupError(f"no package '{name}' in this environment") from None


def package_folder(name: str, resolve_package: Optional[PackageResolver] = None) -> Path:
    """Return the folder of a package, by the resolver passed or else by ROS.

    Raises:
        ConfigError: it is not found; one line with the remedy.
    """
    try:
        return Path((resolve_package or find_ros_package)(name))
    except LookupError as error:
        detail = str(error.args[0]) if error.args else f"no package '{name}'"
        raise ConfigError(
            f"package '{name}' is not found ({detail}); build and source its workspace, or give "
            f"the path without a package"
        ) from error


def resolve_path(
    text: PathLike,
    resolve_package: Optional[PackageResolver] = None,
    base_folder: Optional[PathLike] = None,
) -> Path:
    """Return the path that a text of a configuration means; it need not exist.

    Args:
        text: ``package://name/rest``, ``file:///rest``, or a path; ``~``, ``$VAR`` and ``${VAR}``
            are replaced.
        resolve_package: folder of a package by name, raising LookupError; ROS's when None.
        base_folder: where relative paths begin; the working folder when None.

    Raises:
        ConfigError: no text, an unknown package or variable, or another scheme.
    """
    expanded = _with_variables(os.fspath(text).strip())
    if not expanded:
        raise ConfigError("a path is empty; give a file")
    scheme = _SCHEME.match(expanded)
    if scheme is None:
        return Path(base_folder or ".") / os.path.expanduser(expanded)
    rest = expanded[scheme.end() :]
    if scheme.group(1) == "package":
        package, _, inside = rest.partition("/")
        return package_folder(package, resolve_package) / inside
    if scheme.group(1) == "file":
        return Path(base_folder or ".") / os.path.expanduser(unquote(rest))
    raise ConfigError(
        f"path '{text}': '{scheme.group(1)}://' is unknown; use package://, file:// or a plain path"
    )


def _with_variables(text: str) -> str:
    def value(match: re.Match[str]) -> str:
        name = match.group(1) or match.group(2) or ""
        if name not in os.environ:
            raise ConfigError(
                f"path '{text}': the environment variable '{name}' is not set; set it or write "
                f"the path out"
            )
        return os.environ[name]

    return _VARIABLE.sub(value, text)
