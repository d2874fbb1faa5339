"""The command `calibrate` of the library; with -rv it is a node that RViz shows while it runs."""

from __future__ import annotations

import argparse

from atom_calibration.runtime import running
from atom_calibration.show.view_options import ViewOptions, add_view_options, take_view_options
from atom_core import cli
from atom_core.commands import calibrate
from atom_core.commands.calibrate_options import add_options
from atom_core.commands.option_parser import OptionParser, examples

NODE = "calibrate"
EXAMPLE = """
rosrun atom_calibration calibrate --dataset data/dataset.json --output results
rosrun atom_calibration calibrate --dataset data/dataset.json --output results -rv --slow 0.3
"""


def main() -> int:
    """Run the command, or the node; return its exit code."""
    args = parser().parse_args(running.arguments())
    view, stay = take_view_options(args)
    if view is None:
        return cli.guarded(NODE, lambda: calibrate.run(args))
    return running.guarded(NODE, lambda: _watched(args, view, stay))


def _watched(args: argparse.Namespace, view: ViewOptions, stay: bool) -> int:
    from atom_calibration.nodes.calibrating.calibration_view import (
        CalibrationView,  # only where it is needed
    )

    running.start(NODE)
    code = calibrate.run(args, CalibrationView(view))
    if stay:
        running.wait()
    return code


def parser() -> argparse.ArgumentParser:
    """Return the parser: the command's options, and those of the view."""
    made = OptionParser(prog=NODE, description=str(calibrate.__doc__), epilog=examples(EXAMPLE))
    add_options(made)
    add_view_options(made)
    return made
