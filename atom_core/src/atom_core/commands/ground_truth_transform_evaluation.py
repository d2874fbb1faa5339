"""Measure how far the transform between two frames is from the true one."""

from __future__ import annotations

import argparse
from typing import Any, List

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
from atom_core.evaluation.frames_against_truth import by_angles, frame_errors, mean_rows, row_of
from atom_core.geometry import se3
from atom_core.report.tables import AVERAGES

EXAMPLE = (
    "python3 -m atom_core ground_truth_transform_evaluation -train_json atom_calibration.json "
    "-test_json dataset.json -p base_link -c rgb_1_link"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add_files(parser)
    for name, short in (("parent_link", "-p"), ("child_link", "-c")):
        text = f"the transform's {name.partition('_')[0]}"
        common.add_option(parser, name, short, required=True, metavar="FRAME", help=text)
    add_results_options(parser, may_have_value=True)


def run(args: argparse.Namespace) -> int:
    """Measure, print ATOM's table: signed, the found value minus the true one."""
    target_file = results_file(args, "ground_truth_transform_results.csv")
    both = compared(args)
    for edge in both.own:
        if {edge.parent, edge.child} == {args.parent_link, args.child_link}:
            raise DatasetError(why_not_measured(edge))
    errors = frame_errors(both.found, both.true, args.parent_link, args.child_link)
    rows: List[List[Any]] = []
    for key, found_T_true in errors.items():
        true_T_found = se3.inverse(found_T_true)
        rows.append([key, *row_of(by_angles(true_T_found), angle(true_T_found))])
    averages = [AVERAGES, *mean_rows([row[1:] for row in rows])]
    title = f"{args.parent_link} to {args.child_link}"
    shown = rows if args.show_all_collections or target_file is not None else []
    show_table(["Collection #", *COLUMNS], [*shown, averages], title, target_file)
    warn_of_what_is_not_calibrated(both.found, args.parent_link, args.child_link)
    return 0
