"""Measure a calibration on a test set, pair by pair, and against the truth where it is known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import List, Optional

from atom_core.commands import common
from atom_core.evaluation.evaluate import Evaluation, evaluate
from atom_core.evaluation.hand_eye_comparison import compare_hand_eye
from atom_core.evaluation.pairs import pair_kinds
from atom_core.evaluation.same_data import shared_collections
from atom_core.io.annotations import read_annotations
from atom_core.io.atomic import (
    prepare_output_folder,
    write_json_atomically,
    write_text_atomically,
)
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.together import written_together
from atom_core.io.truth_file import read_any_truth
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names
from atom_core.model.truth import Truth
from atom_core.report.evaluation_csv import csv_name, csv_texts
from atom_core.report.evaluation_document import evaluation_document
from atom_core.report.evaluation_tables import evaluation_report
from atom_core.report.evaluation_verdict import evaluation_verdict
from atom_core.report.verdict import verdict_lines

_FILES = "--train results/atom_calibration.json --test test/dataset.json"
EXAMPLE = f"""
python3 -m atom_core evaluate {_FILES} --output evaluation
python3 -m atom_core evaluate {_FILES} --output pair --pairs lidar_1:rgb_1 --verbose
"""
RESULT_FILE = "evaluation.json"
HAND_EYE = "hand_eye"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    files = {"train": "the calibrated dataset (atom_calibration.json)"}
    files["test"] = "the dataset to measure on"
    for name, what in files.items():
        names = (f"-{name}_json", f"--{name}_json")
        add(parser, name, *names, required=True, type=Path, metavar="FILE", help=what)
    common.add_output_options(parser, "results/TRAIN beside the test set")
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
    add(
        parser,
        "baseline",
        choices=[HAND_EYE],
        help="put OpenCV's hand-eye methods beside it, on the labels of the train file; each "
        "result is written as a dataset",
    )
    common.add_selection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Evaluate, write the results, print the tables; 1 when no pair could be measured."""
    folder = args.output or args.test.parent / "results" / args.train.name.partition(".")[0]
    common.refuse_occupied(folder, args.overwrite)
    train, test = read_dataset(args.train), _selected(args, read_dataset(args.test))
    truth = read_any_truth(args.truth) if args.truth else None
    evaluation = _evaluate(args, train, test, truth)
    compared = _evaluate(args, read_dataset(args.compare), test, truth) if args.compare else None
    hand_eye = None
    if args.baseline == HAND_EYE:
        sensors = _sensors(args, train, test)
        hand_eye = compare_hand_eye(train, test, evaluation, truth=truth, sensors=sensors)
    document = evaluation_document(evaluation, compared, hand_eye)
    document["options"] = common.options_document(args)
    prepare_output_folder(folder, args.overwrite)
    earlier = [path.name for path in folder.glob(f"{HAND_EYE}_*.json")]
    with written_together(folder, [RESULT_FILE, *map(csv_name, pair_kinds()), *earlier]):
        for name, text in csv_texts(evaluation).items():
            write_text_atomically(folder / name, text)
        for baseline in hand_eye.baselines if hand_eye else ():
            if baseline.dataset is not None:
                write_dataset(baseline.dataset, folder / f"{HAND_EYE}_{baseline.method}.json")
        write_json_atomically(folder / RESULT_FILE, document, sort_keys=False)
    print(evaluation_report(evaluation, compared, args.verbose, hand_eye))
    print(f"\nresults: {folder.resolve()}\n")
    shared = shared_collections(train, test)
    if shared:
        print(
            f"warning: {len(shared)} of {len(test.collections)} collections of the test set are "
            f"those that were calibrated with ({_few(shared)}): errors on them are too "
            f"small; record a test set of its own\n"
        )
    print(verdict_lines(evaluation_verdict(evaluation)))
    if evaluation.measured:
        return 0
    told = evaluation.pairs or evaluation.spread
    why = "the table says why" if told else "no two of these sensors can be compared"
    print(f"evaluate: no pair was measured, {why}", file=sys.stderr)
    return 1


def _few(names: List[str]) -> str:
    return ", ".join(names[:5]) + (" ..." if len(names) > 5 else "")


def _evaluate(
    args: argparse.Namespace, train: Dataset, test: Dataset, truth: Optional[Truth]
) -> Evaluation:
    return evaluate(
        train,
        test,
        truth=truth,
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
