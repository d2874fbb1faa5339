"""A calibration package on the disk: where it is, and how launch files call its files."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import List, Optional, Sequence
from xml.etree import ElementTree

from atom_core.errors import ConfigError
from atom_core.io.paths import package_folder, resolve_path

CONFIG_FOLDERS = ("calibration", "config")  # ATOM's, and that of the suite's own examples
_VARIABLE = re.compile(r"\$\{?(\w+)\}?")


@dataclass(frozen=True)
class CalibrationPackage:
    """A package, or a folder of one that holds a calibration of its own.

    Attributes:
        name: of the ROS package.
        root: folder of the package.
        folder: folder of the calibration, `root` or below it.
        config_file: its configuration.
    """

    name: str
    root: Path
    folder: Path
    config_file: Path

    @property
    def find(self) -> str:
        """How launch files call `folder`."""
        inside = self.folder.relative_to(self.root).as_posix()
        return f"$(find {self.name})" + ("" if inside == "." else f"/{inside}")

    @property
    def calibration_folder(self) -> Path:
        """Where the configuration is."""
        return self.config_file.parent

    @property
    def summary_folder(self) -> Path:
        """Where summary and checksums go: beside the configuration, where that is in `folder`."""
        beside = self.calibration_folder
        if self.folder == beside or self.folder in beside.parents:
            return beside
        places = [self.folder / place for place in CONFIG_FOLDERS]
        return next((place for place in places if place.is_dir()), places[0])

    def launch_path(self, path: Path) -> str:
        """Return how launch files call a file: by the package where it is inside of it."""
        try:
            inside = path.resolve().relative_to(self.folder.resolve())
        except ValueError:
            return str(path)
        return f"{self.find}/{inside.as_posix()}"


def find_package(name: str, config_name: Optional[str] = None) -> CalibrationPackage:
    """Return a calibration package.

    Args:
        name: of the ROS package, or a folder: that of a package, or one below it.
        config_name: the configuration's name in the package, or its path; config.yml when None.

    Raises:
        ConfigError: there is no such package or configuration.
    """
    folder = Path(name)
    if not folder.is_dir():
        folder = package_folder(name)
    folder = folder.resolve()
    root = next((f for f in (folder, *folder.parents) if (f / "package.xml").is_file()), None)
    if root is None:
        raise ConfigError(
            f"{folder}: neither this folder nor one above it has a package.xml; give a calibration "
            f"package, or make one with `rosrun atom_calibration create_calibration_pkg -n NAME`"
        )
    return CalibrationPackage(_name_of(root), root, folder, _config_file(folder, config_name))


def missing_dependencies(package: CalibrationPackage, names: Sequence[str]) -> List[str]:
    """Return those of the packages that the manifest does not name."""
    root = ElementTree.parse(str(package.root / "package.xml")).getroot()
    named = {element.text for element in root if element.tag.endswith("depend")}
    return [name for name in names if name not in named]


def launch_text(path: str, package: CalibrationPackage) -> str:
    """Return a path of a configuration as launch files write it; variables stay variables.

    A variable that is not set when the file is launched leaves its name in the path, so that what
    fails then says why.
    """
    text = path.strip()
    for scheme in ("package://", "file://"):
        if text.startswith(scheme):
            text = text[len(scheme) :]
            if scheme == "package://":
                name, _, inside = text.partition("/")
                text = f"$(find {name})/{inside}"
            break
    else:
        text = _VARIABLE.sub(lambda match: _optional_variable(match.group(1)), text)
    if text.startswith("~/"):
        return f"$(env HOME)/{text[2:]}"
    if text.startswith(("/", "$(")):
        return text
    return package.launch_path(package.calibration_folder / text)


def config_path(path: str, package: CalibrationPackage) -> Path:
    """Return a path of a configuration; relative ones begin at the configuration's folder.

    Raises:
        ConfigError: an unknown package or variable.
    """
    return resolve_path(path, base_folder=package.calibration_folder)


def _optional_variable(name: str) -> str:
    return f"$(optenv {name} /{name}-is-not-set)"


def _name_of(root: Path) -> str:
    manifest = root / "package.xml"
    try:
        name = ElementTree.parse(str(manifest)).findtext("name")
    except (ElementTree.ParseError, OSError) as error:
        raise ConfigError(f"{manifest}: cannot be read ({error}); mend the manifest") from None
    if not name:
        raise ConfigError(f"{manifest}: has no <name>; mend the manifest")
    return name.strip()


def _config_file(folder: Path, config_name: Optional[str]) -> Path:
    """Return the configuration; where the one that was named is absent, no other is taken."""
    name = config_name or "config.yml"
    candidates = [folder / place / name for place in CONFIG_FOLDERS]
    if config_name is not None and os.sep in config_name:
        candidates = [Path(config_name)]
    found = next((path for path in candidates if path.is_file()), None)
    if found is None:
        tried = ", ".join(str(path) for path in candidates)
        raise ConfigError(
            f"no configuration: tried {tried}; write one, or name it with --config_file"
        )
    return found.resolve()
