"""The command `calibrate` of the library; with -rv it is a node that RViz shows while it runs."""

from __future__ import annotations

import argparse

import rospy

from atom_calibration import calibrated_tf
from atom_calibration.nodes import running
from atom_calibration.nodes.calibration_view import CalibrationView, ViewOptions
from atom_core import cli
from atom_core.commands import calibrate
from atom_core.commands.common import add_option

NODE = "calibrate"
EXAMPLE = (
    "rosrun atom_calibration calibrate --dataset data/dataset.json --output results -rv --slow 0.3"
)


def main() -> int:
    """Run the command, or the node; return its exit code."""
    args = parser().parse_args(rospy.myargv()[1:])
    view, stay = take_view_options(args)
    if view is None:
        return cli.guarded(NODE, lambda: calibrate.run(args))
    return running.guarded(NODE, lambda: _watched(args, view, stay))


def _watched(args: argparse.Namespace, view: ViewOptions, stay: bool) -> int:
    running.start(NODE)
    code = calibrate.run(args, CalibrationView(view))
    if stay:
        running.wait()
    return code


def parser() -> argparse.ArgumentParser:
    """Return the parser: the command's options, and those of the view."""
    made = argparse.ArgumentParser(
        prog=NODE, description=str(calibrate.__doc__), epilog=f"example: {EXAMPLE}"
    )
    calibrate.add_arguments(made)
    add_view_options(made)
    return made


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a live view."""
    group = parser.add_argument_group("live view in RViz")
    add_option(
        group, "ros_visualization", "-rv", action="store_true",
        help="publish boards, sensors, points, images and residuals while the solver runs",
    )  # fmt: skip
    add_option(
        group, "slow", type=running.not_negative, default=0.0, metavar="S",
        help="pause so many seconds after every iteration",
    )  # fmt: skip
    add_option(
        group, "wait", type=running.not_negative, default=0.0, metavar="S",
        help="begin when RViz looks, after so many seconds at the latest",
    )  # fmt: skip
    add_option(
        group, "stay", action="store_true", help="leave the result on the topics until Ctrl-C"
    )
    add_option(
        group, "tf", choices=calibrated_tf.MODES, default=calibrated_tf.PREFIXED,
        help="transforms to publish: prefixed (as ATOM: cKEY_FRAME for each collection), own "
        "(one collection's, frames under their own names), calibrated (of these only what is "
        "calibrated, beside a running system), off (default: prefixed)",
    )  # fmt: skip
    add_option(
        group, "draw_per_collection_colors", "-dpcc", action="store_true",
        help="points have the colour of their collection, not of their sensor",
    )  # fmt: skip
    add_option(
        group, "show_collection", default="", metavar="KEY", help="show this collection at first"
    )


def take_view_options(args: argparse.Namespace) -> tuple:
    """Take the options of the view out of the others; return them (None: no view) and `stay`.

    What remains is the command's own, as it goes into its result.
    """
    taken = vars(args)
    watched, stay = taken.pop("ros_visualization"), taken.pop("stay")
    view = ViewOptions(
        slow_s=taken.pop("slow"),
        wait_s=taken.pop("wait"),
        tf=taken.pop("tf"),
        by_collection=taken.pop("draw_per_collection_colors"),
        collection=taken.pop("show_collection"),
    )
    return (view if watched else None), stay
