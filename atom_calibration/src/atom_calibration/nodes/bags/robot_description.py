"""Print a robot description as URDF: what launch files set as `robot_description`."""

from __future__ import annotations

import argparse
import sys
from typing import Optional, Sequence

from atom_core.cli import guarded
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.io.urdf import read_description

_NAME = "robot_description"
_EXAMPLES = """
rosrun atom_calibration robot_description ~/robot/robot.urdf.xacro
rosrun atom_calibration robot_description package://my_robot/urdf/robot.urdf
"""


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded(_NAME, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    description = read_description(args.file)
    for warning in description.warnings:
        sys.stderr.write(f"{_NAME}: warning: {warning}\n")
    sys.stdout.write(description.urdf)
    return 0


def parser() -> OptionParser:
    """Return the parser of the command line."""
    made = OptionParser(
        prog=_NAME,
        usage="robot_description FILE",
        description="Print a robot description as URDF; a xacro is expanded.",
        epilog=examples(_EXAMPLES),
    )
    made.add_argument("file", metavar="FILE", help="URDF or xacro: a path, or package://")
    return made
