"""Measure how well each camera's corners are where the boards are projected."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.commands.pair_evaluation import (
    add_common_options,
    results_file,
    show_table,
    test_set,
)
from atom_core.errors import DatasetError
from atom_core.evaluation.mixed import mixed_dataset
from atom_core.evaluation.observed import Observed
from atom_core.evaluation.own_edges import own_edges
from atom_core.evaluation.single_camera import single_cameras
from atom_core.evaluation.statistics import mean_of
from atom_core.io.dataset_json import read_dataset
from atom_core.model.selection import select_names
from atom_core.report.tables import AVERAGES

EXAMPLE = (
    "python3 -m atom_core single_rgb_evaluation -train_json atom_calibration.json "
    "-test_json dataset.json -sfr"
)
_NOT_HERE = (
    AtomOption(
        *("si", "show_images"),
        remark="nothing is drawn; docs/evaluation.md tells how the distances are measured",
    ),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for option, what in (("train_json", "calibrated"), ("test_json", "test")):
        text = f"the {what} dataset"
        add(parser, option, f"-{option}", required=True, type=Path, metavar="F", help=text)
    selections = {"-ssf": "sensor", "-psf": "pattern", "-csf": "collection"}
    for short, what in selections.items():
        name = f"{what}_selection_function"
        add(parser, name, short, nargs="+", metavar="SELECTION", help=f"only these {what}s")
    add(
        parser,
        "copy_pattern_transforms",
        "-cpt",
        action="store_true",
        help="boards where the train file has them, instead of where they suit the corners best",
    )
    add_common_options(parser)
    add_meaningless_options(parser, _NOT_HERE)


def run(args: argparse.Namespace) -> int:
    """Measure, print ATOM's table, write it where that is asked for."""
    target = results_file(args, "rgb_results.csv")
    args.pattern_name = args.pattern_selection_function
    train, test = read_dataset(args.train_json), test_set(args)
    every = list(dict.fromkeys([*test.sensors, *train.sensors]))
    sensors = select_names(every, args.sensor_selection_function, "sensor")
    mixed = mixed_dataset(train, test, sensors)
    boards = train if args.copy_pattern_transforms else None
    means: Dict[Tuple[str, str], Dict[str, float]] = {}
    own = own_edges(train, test)
    for result in single_cameras(mixed, Observed(mixed), boards=boards, own=own):
        if result.measured is not None:
            of_collections = result.measured.per_collection
            values = {key: figures.mean for key, figures in of_collections.items()}
            means[result.pattern, result.sensor] = values
    if not means:
        raise DatasetError(f"{args.test_json}: no camera's corners tell where a board is")
    order = [(p, s) for p in mixed.patterns for s in mixed.sensors if (p, s) in means]
    show_table(*_table([means[key] for key in order], order), "reprojection", target)
    return 0


def _table(
    columns: List[Dict[str, float]], order: List[Tuple[str, str]]
) -> Tuple[List[str], List[List[Any]]]:
    """Return ATOM's columns: means by collection, those of a row's cells, and those of all rows."""
    headers = ["Collection", *(f"{sensor}-{pattern} [px]" for pattern, sensor in order), "all [px]"]
    keys = sorted({key for column in columns for key in column})
    rows: List[List[Any]] = []
    for key in keys:
        cells: List[Optional[float]] = [column.get(key) for column in columns]
        rows.append([key, *cells, mean_of(cells)])
    averages = [mean_of([row[i] for row in rows]) for i in range(1, len(headers))]
    return headers, [*rows, [AVERAGES, *averages]]
