"""Calibrate one camera against another by OpenCV's stereo calibration."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.commands.dataset_output import add_overwrite_option, refuse_existing
from atom_core.commands.pair_calibration import pose_table, read_pair, refuted, with_source
from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.stereo import stereo_baseline
from atom_core.geometry import se3
from atom_core.io.dataset_json import write_dataset
from atom_core.io.paths import sibling
from atom_core.model.sensor import RGB

EXAMPLE = "python3 -m atom_core cv_stereo_calib -json dataset.json -rc rgb_2 -lc rgb_1"
_RESULT = "cv_calibration.json"
_NOT_HERE = (
    AtomOption("si", "show_images", remark="nothing is drawn; the corners are those of the labels"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    add = common.add_option
    for name, short, what in (
        ("right_camera", "-rc", "the camera that stays where it is"),
        ("left_camera", "-lc", "the camera whose edge is calibrated"),
    ):
        add(parser, name, short, required=True, metavar="CAMERA", help=what)
    text = f"the new dataset (default: {_RESULT} beside the input)"
    add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(parser)
    add_meaningless_options(parser, _NOT_HERE)


def run(args: argparse.Namespace) -> int:
    """Solve with the intrinsics as they are, and put the left camera where it was found.

    1: the labels contradict the answer.
    """
    left, right = args.left_camera, args.right_camera
    target = args.output or sibling(args.dataset, _RESULT)
    refuse_existing(args.dataset, [target], args.overwrite)
    dataset = read_pair(args, [left, right], [RGB])
    rig = stereo_baseline(dataset.selected(sensors=[left, right]))
    if not rig.links:
        why = "; ".join(rig.unsolved.values())
        raise DatasetError(f"{args.dataset}: '{left}' and '{right}' cannot be solved: {why}")
    (link,) = rig.links
    found = link.target_T_source
    right_T_left = found if link.source == left else se3.inverse(found)
    solved = with_source(dataset, left, right, right_T_left)
    write_dataset(solved, target)
    print(pose_table(dataset, left, right, [("OpenCV", right_T_left, link.collections)]))
    print(f"\nresults: {target.resolve()}")
    doubt = refuted(solved, [left, right])
    if doubt:
        print(
            f"cv_stereo_calib: the answer is wrong: {doubt}; look at the labels and intrinsics of "
            f"both, or calibrate",
            file=sys.stderr,
        )
    return 1 if doubt else 0
