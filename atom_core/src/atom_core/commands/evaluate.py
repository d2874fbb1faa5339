"""Measure a calibration on a test set, pair by pair, and against the truth where it is known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence

from atom_core.commands import common
from atom_core.commands.annotated_borders import annotated_borders
from atom_core.commands.baseline_options import FILES as BASELINE_FILES
from atom_core.commands.baseline_options import (
    Baselines,
    add_baseline_options,
    chosen_baselines,
)
from atom_core.commands.compare_calibrations import run_comparison
from atom_core.commands.estimated_ranges import estimated_range_remarks
from atom_core.commands.provenance import inputs, versions
from atom_core.commands.report_files import REPORT_FILES, report_beside
from atom_core.commands.report_option import add_report_option
from atom_core.commands.verdict_output import print_verdict
from atom_core.errors import SelectionError
from atom_core.evaluation.baselines.comparison import Measured
from atom_core.evaluation.evaluate import Evaluation, evaluate
from atom_core.evaluation.observed import Borders
from atom_core.evaluation.pairs import pair_kinds
from atom_core.evaluation.rig_differences import board_differences
from atom_core.evaluation.same_data import shared_collections
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

_FILES = "--train results/atom_calibration.json --test test/dataset.json"
EXAMPLE = f"""
python3 -m atom_core evaluate {_FILES} --output evaluation
python3 -m atom_core evaluate {_FILES} --output pair --pairs lidar_1:rgb_1 --verbose
python3 -m atom_core evaluate --compare results_of_may results_of_june
"""
RESULT_FILE = "evaluation.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    files = {"train": "the calibrated dataset (atom_calibration.json)"}
    files["test"] = "the dataset to measure on"
    for name, what in files.items():
        names = (f"-{name}_json", f"--{name}_json")
        add(parser, name, *names, type=Path, metavar="FILE", help=what)
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
        nargs="+",
        type=Path,
        metavar="OTHER",
        help="another calibrated dataset, to stand beside the first; or two folders of results, "
        "without --train and --test: has the rig moved between them?",
    )
    add_baseline_options(parser)
    add_report_option(parser)
    common.add_selection_options(parser)


def run(args: argparse.Namespace) -> int:
    """Evaluate, write the results, print the tables.

    Returns 1 when no pair could be measured, or a baseline that was named has nothing to solve.

    Two results to compare: 1 when the rig has moved between them.
    """
    if len(args.compare or []) == 2 and not (args.train or args.test):
        return run_comparison(args, *args.compare)
    _refuse_half_a_task(args)
    folder = args.output or args.test.parent / "results" / args.train.name.partition(".")[0]
    common.refuse_occupied(folder, args.overwrite)
    train, test = read_dataset(args.train), _selected(args, read_dataset(args.test))
    truth = read_any_truth(args.truth) if args.truth else None
    sensors = _sensors(args, train, test)
    annotations, doubts = annotated_borders(args.test, test, sensors)
    evaluation = _evaluate(args, train, test, truth, annotations)
    other = read_dataset(args.compare[0]) if args.compare else None
    compared = _evaluate(args, other, test, truth, annotations) if other else None
    measured = Measured(train, test, evaluation, truth, annotations)
    found = chosen_baselines(args, measured, sensors)
    document = evaluation_document(evaluation, compared, found.hand_eye, found.rigs)
    told = estimated_range_remarks(args.train, [*(sensors or train.sensors), *test.patterns])
    document["warnings"] = [*_warnings(train, test), *told]
    document["annotations_in_doubt"] = doubts
    document["baselines_left_out"] = [*found.remarks, *found.missed]
    document["options"] = common.options_document(args)
    document["inputs"] = inputs(train=args.train, test=args.test, truth=args.truth)
    document["versions"] = versions()
    _write(args, folder, document, evaluation, found)
    print(evaluation_report(evaluation, compared, args.verbose, found.hand_eye, found.rigs))
    print("".join(f"{remark}\n" for remark in found.remarks), end="")
    print(f"\nresults: {folder.resolve()}\n")
    for sentence in (*document["warnings"], *doubts):
        print(f"warning: {sentence}\n")
    print_verdict(evaluation_verdict(evaluation))
    if not args.no_report:
        report_beside(folder, None, folder)
    return _exit_code(evaluation, found.missed)


def _exit_code(evaluation: Evaluation, missed: Sequence[str]) -> int:
    """Say what could not be done; return 1 where nothing could, or a baseline that was named."""
    for why in missed:
        print(f"evaluate: {why}; all else is done", file=sys.stderr)
    if evaluation.measured:
        return 1 if missed else 0
    told = evaluation.pairs or evaluation.spread
    why = "the table says why" if told else "no two of these sensors can be compared"
    print(f"evaluate: no pair was measured, {why}", file=sys.stderr)
    return 1


def _refuse_half_a_task(args: argparse.Namespace) -> None:
    """Refuse a command line that lacks what is to be evaluated.

    Raises:
        SelectionError: naming what is missing.
    """
    missing = [f"--{name}" for name in ("train", "test") if getattr(args, name) is None]
    if missing:
        raise SelectionError(
            f"evaluate needs --train FILE and --test FILE, {' and '.join(missing)} "
            f"{'is' if len(missing) == 1 else 'are'} missing; or --compare with two results of "
            f"`calibrate` and neither of them"
        )
    if len(args.compare or []) > 1:
        raise SelectionError(
            "--compare takes one other dataset beside --train, or two results without --train and "
            "--test"
        )


def _write(
    args: argparse.Namespace,
    folder: Path,
    document: Dict[str, Any],
    evaluation: Evaluation,
    found: Baselines,
) -> None:
    prepare_output_folder(folder, args.overwrite)
    earlier = [name for name in BASELINE_FILES if (folder / name).exists()]
    names = [RESULT_FILE, *REPORT_FILES, *map(csv_name, pair_kinds()), *earlier]
    with written_together(folder, names):
        for name, text in csv_texts(evaluation).items():
            write_text_atomically(folder / name, text)
        for name, dataset in found.datasets.items():
            write_dataset(dataset, folder / name)
        write_json_atomically(folder / RESULT_FILE, document, sort_keys=False)


def _warnings(train: Dataset, test: Dataset) -> List[str]:
    """Return what puts the figures in doubt: how the test set was read, and what it is.

    What puts single sensors in doubt is in the verdict.
    """
    in_doubt = {caveat.sentence for caveat in test.caveats}
    told = [warning for warning in test.warnings if warning not in in_doubt]
    told += board_differences(train, test)
    shared = shared_collections(train, test)
    if not shared:
        return told
    return [
        *told,
        f"{len(shared)} of {len(test.collections)} collections of the test set are those that were "
        f"calibrated with ({_few(shared)}): errors on them are too small; record a test set of its "
        f"own",
    ]


def _few(names: List[str]) -> str:
    return ", ".join(names[:5]) + (" ..." if len(names) > 5 else "")


def _evaluate(
    args: argparse.Namespace,
    train: Dataset,
    test: Dataset,
    truth: Optional[Truth],
    annotations: Borders,
) -> Evaluation:
    return evaluate(
        train,
        test,
        truth=truth,
        sensors=_sensors(args, train, test),
        pairs=args.pairs,
        annotations=annotations,
    )


def _selected(args: argparse.Namespace, test: Dataset) -> Dataset:
    """Reduce the test set to the selected collections and patterns."""
    common.refuse_empty(test)
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
