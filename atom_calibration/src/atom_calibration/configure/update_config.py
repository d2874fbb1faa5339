"""Write a configuration of an older ATOM in the layout of version 3."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path
from typing import Optional, Sequence, Tuple

from atom_calibration.configure.package import find_package
from atom_core.cli import guarded
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import OutputError
from atom_core.io.config_yaml import read_config, write_config

EXAMPLE = "rosrun atom_calibration update_config_to_version_3 -pn my_robot_calibration"
_NAME = "update_config_to_version_3"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded(_NAME, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    path, target = update(args)
    before = f"; the old one is {_old(path)}" if target == path else ""
    sys.stdout.write(f"{target}: the configuration in version 3{before}\n")
    return 0


def update(args: argparse.Namespace) -> Tuple[Path, Path]:
    """Write it beside the old one, or in its place; return the old and the new file."""
    path = find_package(args.package_name, args.config_file).config_file
    config = read_config(path)
    for warning in config.warnings:
        sys.stderr.write(f"{_NAME}: {warning}\n")
    target = path if args.in_place else path.with_name(f"{path.stem}_version_3{path.suffix}")
    occupied = _old(path) if args.in_place else target
    if occupied.exists() and not args.overwrite:
        raise OutputError(f"{occupied}: exists already; add --overwrite to replace it")
    if args.in_place:
        shutil.copy2(path, occupied)
    write_config(target, config)
    return path, target


def _old(path: Path) -> Path:
    return path.with_name(path.name + ".old")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=_NAME, description=__doc__, epilog=f"example: {EXAMPLE}")
    text = "the calibration package, by its name or its folder"
    add_option(made, "package_name", "-pn", required=True, metavar="PKG", help=text)
    text = "name of the configuration in the package, or its path (default: config.yml)"
    add_option(made, "config_file", "-cfg", metavar="FILE", help=text)
    text = "put it in the place of the old one, which becomes config.yml.old"
    add_option(made, "in_place", action="store_true", help=text)
    add_option(made, "overwrite", "-ow", action="store_true", help="replace an earlier copy")
    return made
