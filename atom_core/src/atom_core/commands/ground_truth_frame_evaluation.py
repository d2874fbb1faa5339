"""Measure how far the frames of sensors are from where they truly are."""

from __future__ import annotations

import argparse
from typing import Any, List

import numpy as np

from atom_core.commands import common
from atom_core.commands.ground_truth_evaluation import (
    COLUMNS,
    add_files,
    angle,
    compared,
    warn_of_what_is_not_calibrated,
    why_not_measured,
)
from atom_core.commands.pair_evaluation import add_results_options, results_file, show_table
from atom_core.errors import DatasetError
from atom_core.evaluation.frames_against_truth import (
    by_rotation_vector,
    calibrated_frames,
    frame_errors,
    mean_rows,
    row_of,
)
from atom_core.report.tables import AVERAGES

EXAMPLE = (
    "python3 -m atom_core ground_truth_frame_evaluation -train_json atom_calibration.json "
    "-test_json dataset.json"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add_files(parser)
    text = "from which the frames are seen (default: the configuration's world_link)"
    common.add_option(parser, "target_frame", "-tf", metavar="FRAME", help=text)
    text = "only this one, collection by collection (default: all that are calibrated)"
    common.add_option(parser, "source_frame", "-sf", metavar="FRAME", help=text)
    add_results_options(parser, may_have_value=True)


def run(args: argparse.Namespace) -> int:
    """Measure, print ATOM's table, write it where that is asked for."""
    target_file = results_file(args, "ground_truth_frame_results.csv")
    both = compared(args)
    target = args.target_frame or both.found.world
    frames = [args.source_frame] if args.source_frame else calibrated_frames(both.found)
    for edge in both.own:
        if edge.child in frames:
            print(f"note: {why_not_measured(edge)}")
            frames.remove(edge.child)
    if not frames:
        raise DatasetError(f"{args.test_json}: no frame is left to compare")
    by_collection = args.show_all_collections or args.source_frame
    rows: List[List[Any]] = []
    for frame in frames:
        errors = frame_errors(both.found, both.true, target, frame)
        of_frame = {
            key: row_of(by_rotation_vector(error), angle(error)) for key, error in errors.items()
        }
        if by_collection:
            named = {key: key if args.source_frame else f"{frame} {key}" for key in of_frame}
            rows += [[named[key], *row] for key, row in of_frame.items()]
        else:
            rows.append([f"{target}-{frame}", *mean_rows(np.abs(list(of_frame.values())).tolist())])
    averages = mean_rows(np.abs([row[1:] for row in rows]).tolist())
    first = "Collection #" if args.source_frame else "Transformation #"
    rows.append([AVERAGES, *averages])
    show_table([first, *COLUMNS], rows, f"seen from {target}", target_file)
    if args.source_frame:
        warn_of_what_is_not_calibrated(both.found, target, args.source_frame)
    return 0
