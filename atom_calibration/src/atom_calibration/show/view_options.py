"""What a live view of a calibration can be told; light to load, since the command asks for it."""

from __future__ import annotations

import argparse
from typing import NamedTuple, Optional, Tuple

from atom_core.commands.common import add_option

# Transforms that are published. OWN: all of a collection. CALIBRATED: the edges that are
# calibrated, beside a robot or a recording that publishes the others. PREFIXED: all of all
# collections, each in a tree of its own, as ATOM does.
OFF, OWN, CALIBRATED, PREFIXED = "off", "own", "calibrated", "prefixed"
TF_MODES = (OFF, OWN, CALIBRATED, PREFIXED)
ALL = ""  # no collection is chosen


class ViewOptions(NamedTuple):
    """What is shown, and how slowly.

    Attributes:
        slow_s: pause after every iteration.
        wait_s: the solver begins when somebody looks, but after so many seconds at the latest.
        tf: which transforms are published.
        by_collection: points have their collection's colour, not their sensor's.
        collection: that is shown at first; ALL.
        input_ghost: the ghost is where the input has the sensors, before any disturbance.
    """

    slow_s: float = 0.0
    wait_s: float = 0.0
    tf: str = PREFIXED
    by_collection: bool = False
    collection: str = ALL
    input_ghost: bool = False


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a live view."""
    group = parser.add_argument_group("live view in RViz")
    add_option(
        group,
        "ros_visualization",
        "-rv",
        action="store_true",
        help="publish boards, sensors, points, images and residuals while the solver runs",
    )
    add_option(
        group,
        "slow",
        type=_not_negative,
        default=0.0,
        metavar="S",
        help="pause so many seconds after every iteration",
    )
    add_option(
        group,
        "wait",
        type=_not_negative,
        default=0.0,
        metavar="S",
        help="begin when RViz looks, after so many seconds at the latest",
    )
    add_option(
        group, "stay", action="store_true", help="leave the result on the topics until Ctrl-C"
    )
    add_option(
        group,
        "tf",
        choices=TF_MODES,
        default=PREFIXED,
        help="transforms to publish: prefixed (as ATOM: cKEY_FRAME for each collection), own "
        "(one collection's, frames under their own names), calibrated (of these only what is "
        "calibrated, beside a running system), off (default: prefixed)",
    )
    add_option(
        group,
        "draw_per_collection_colors",
        "-dpcc",
        action="store_true",
        help="points have the colour of their collection, not of their sensor",
    )
    text = "the ghost is where the input has the sensors, not where -nig has put them"
    add_option(group, "initial_pose_ghost", "-ipg", action="store_true", help=text)
    add_option(
        group, "show_collection", default=ALL, metavar="KEY", help="show this collection at first"
    )


def take_view_options(args: argparse.Namespace) -> Tuple[Optional[ViewOptions], bool]:
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
        input_ghost=taken.pop("initial_pose_ghost"),
    )
    return (view if watched else None), stay


def _not_negative(text: str) -> float:
    """Return a number of the command line that is 0 or above."""
    value = float(text)
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is no number of 0 or above")
    return value
