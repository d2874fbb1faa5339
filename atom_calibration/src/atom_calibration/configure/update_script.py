"""Write the script `configure` of a calibration package again."""

from __future__ import annotations

import argparse
import sys
from typing import Optional, Sequence

from atom_calibration.configure.package import find_package
from atom_calibration.configure.render import skeleton_files
from atom_core.cli import guarded
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.io.atomic import write_text_atomically

EXAMPLE = "rosrun atom_calibration update_configure_script -n my_robot_calibration"
_NAME, _SCRIPT = "update_configure_script", "scripts/configure"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded(_NAME, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    package = find_package(args.name)
    path = package.folder / _SCRIPT
    text = skeleton_files(package.name)[_SCRIPT]
    if path.is_file() and path.read_text(encoding="utf-8", errors="replace") == text:
        sys.stdout.write(f"{path}: is as it should be\n")
        return 0
    path.parent.mkdir(exist_ok=True)
    before = ""
    if path.is_file():
        path.replace(path.with_name(path.name + ".old"))
        before = f"; the old one is {path.name}.old"
    write_text_atomically(path, text)
    path.chmod(0o755)
    sys.stdout.write(f"{path}: written{before}\n")
    return 0


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=_NAME, description=__doc__, epilog=f"example: {EXAMPLE}")
    text = "the calibration package, by its name or its folder"
    add_option(made, "name", "-n", required=True, metavar="PKG", help=text)
    return made
