"""Measure a calibration on a test set, pair by pair, and against the truth where it is known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import List, Optional

from atom_core.commands import common
from atom_core.evaluation.evaluate import Evaluation, evaluate
from atom_core.evaluation.pairs import pair_kinds
from atom_core.io.annotations import read_annotations
from atom_core.io.atomic import (
    prepare_output_folder,
    write_json_atomically,
    write_text_atomically,
)
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_file import read_any_truth
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names
from atom_core.report.evaluation_csv import csv_name, csv_texts
from atom_core.report.evaluation_document import evaluation_document
from atom_core.report.evaluation_tables import evaluation_report

EXAMPLE = (
    "python3 -m atom_core evaluate --train results/atom_calibration.json "
    "--test test/dataset.json --output evaluation"
)
RESULT_FILE = "evaluation.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    add(
        parser,
        "train",
        "-train_json",
        "--train_json",
        required=True,
        type=Path,
        metavar="FILE",
        help="the calibrated dataset (atom_calibration.json)",
    )
    add(
        parser,
        "test",
        "-test_json",
        "--test_json",
        required=True,
        type=Path,
        metavar="FILE",
        help="the dataset to measure on",
    )
    common.add_output_options(parser)
    add(
        parser,
        "truth",
        type=Path,
        metavar="FILE",
        help="the truth (a simulation's file, a dataset with true transforms, a URDF): the floor "
        "of every metric, and the sensors' errors",
    )
    add(
        parser,
        "pairs",
        nargs="+",
        metavar="A:B",
        help="only these pairs of sensors; names or globs, in either order",
    )
    add(
        parser,
        "compare",
        type=Path,
        metavar="OTHER",
        help="another calibrated dataset, to stand beside the first",
    )
    common.add_selection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Evaluate, write the results, print the tables; 1 when no pair could be measured."""
    common.refuse_occupied(args.output, args.overwrite)
    test = read_dataset(args.test)
    evaluation = _evaluate(args, args.train, test)
    compared = _evaluate(args, args.compare, test) if args.compare else None
    document = evaluation_document(evaluation, compared)
    document["options"] = common.options_document(args)
    folder = prepare_output_folder(args.output, args.overwrite)
    _write_csv_files(folder, evaluation)
    write_json_atomically(folder / RESULT_FILE, document, sort_keys=False)
    print(evaluation_report(evaluation, compared, verbose=args.verbose))
    print(f"\nresults: {folder}")
    if evaluation.measured:
        return 0
    why = "the table says why" if evaluation.pairs else "no two of these sensors can be compared"
    print(f"evaluate: no pair was measured, {why}", file=sys.stderr)
    return 1


def _write_csv_files(folder: Path, evaluation: Evaluation) -> None:
    """Write a file for each kind that was measured; remove those of an earlier run."""
    texts = csv_texts(evaluation)
    for kind in pair_kinds():
        if csv_name(kind) in texts:
            write_text_atomically(folder / csv_name(kind), texts[csv_name(kind)])
        elif (folder / csv_name(kind)).is_file():
            (folder / csv_name(kind)).unlink()


def _evaluate(args: argparse.Namespace, path: Path, test: Dataset) -> Evaluation:
    train = read_dataset(path)
    test = _selected(args, test)
    return evaluate(
        train,
        test,
        truth=read_any_truth(args.truth) if args.truth else None,
        sensors=_sensors(args, train, test),
        pairs=args.pairs,
        annotations=read_annotations(args.test.parent, test.sensors, test.patterns),
    )


def _selected(args: argparse.Namespace, test: Dataset) -> Dataset:
    """Reduce the test set to the selected collections and patterns."""
    return test.selected(
        collections=select_names(
            test.collections, args.collection_selection_function, "collection"
        ),
        patterns=select_names(test.patterns, args.pattern_selection_function, "pattern"),
    )


def _sensors(args: argparse.Namespace, train: Dataset, test: Dataset) -> Optional[List[str]]:
    """Return the selected sensors of both files; None for all."""
    if not args.sensor_selection_function:
        return None
    names = list(dict.fromkeys([*test.sensors, *train.sensors]))
    return select_names(names, args.sensor_selection_function, "sensor")
