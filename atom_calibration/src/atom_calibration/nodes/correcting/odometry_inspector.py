"""ATOM's first corrector of odometry: `transform_corrector` for one edge, moved in the plane."""

from __future__ import annotations

import argparse

from atom_calibration.nodes.correcting.transform_corrector import correct
from atom_calibration.runtime import options, running
from atom_core.commands.atom_options import ODOMETRY_INSPECTOR, add_meaningless_options
from atom_core.commands.common import add_dataset_option, add_option
from atom_core.commands.option_parser import OptionParser

NODE = "odometry_inspector"
EXAMPLE = (
    "rosrun atom_calibration odometry_inspector -json dataset.json -op odom -oc base_footprint"
)


def main() -> int:
    """Run the node; return its exit code."""
    return running.run(NODE, parser(), _run)


def _run(args: argparse.Namespace) -> int:
    args.parent_link_list, args.child_link_list = [args.odometry_parent], [args.odometry_child]
    args.patterns, args.two_dimensional = [], True
    return correct(args, NODE)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=NODE, description=__doc__.split("\n")[0], epilog=f"example: {EXAMPLE}")
    add_dataset_option(made)
    for name, short, what in (("parent", "-op", "parent"), ("child", "-oc", "child")):
        text = f"the {what} of the edge of the odometry"
        add_option(made, f"odometry_{name}", short, required=True, metavar="FRAME", help=text)
    text = "collection whose clouds are shown in grey"
    add_option(made, "reference_collection", "-rc", default="", metavar="KEY", help=text)
    options.add_marker_scale_option(made)
    options.add_corrected_options(made)
    add_meaningless_options(made, ODOMETRY_INSPECTOR)
    return made
