"""Average the tables of a batch over the runs and folds of each experiment."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Dict, List, Mapping, Sequence

from atom_core.commands import common
from atom_core.commands.batch_execution import STATUS
from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import prepare_output_folder, write_text_atomically
from atom_core.report.batch_averages import (
    Average,
    atom_text,
    averages,
    experiment_groups,
    long_text,
)
from atom_core.report.tables import AVERAGES, text_table

EXAMPLE = "python3 -m atom_core process_results -rf results -of averages"
LONG_FILE = "averages.csv"
_USUAL_COLUMN = "Collection #"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for name, short, what in (
        ("results_folder", "-rf", "what batch_execution has made"),
        ("output_folder", "-of", "the averages go there"),
    ):
        add(parser, name, short, required=True, type=common.named_path, metavar="DIR", help=what)
    for name, short, default, what in (
        ("runs_suffix", "-rs", "_run", "what stands before the number of a run"),
        ("folds_suffix", "-fs", "_fold", "what stands before the number of a fold"),
        ("average_row", "-ar", AVERAGES, "name of the line that is averaged"),
    ):
        add(parser, name, short, default=default, metavar="TEXT", help=what)
    text = "the column in which that name stands (default: the first one of each table)"
    add(parser, "collection_test_column", "-ctc", metavar="COLUMN", help=text)
    add(parser, "overwrite", "-ow", action="store_true", help="remove earlier averages there")
    common.add_verbose_option(parser)


def run(args: argparse.Namespace) -> int:
    """Print and write the averages; 1: a repetition or an experiment lacks a table."""
    folder = args.results_folder
    if not folder.is_dir():
        raise DatasetError(f"{folder}: there is no such folder")
    names = [entry.name for entry in os.scandir(folder) if entry.is_dir()]
    groups = experiment_groups(names, [args.runs_suffix, args.folds_suffix])
    found = averages(folder, groups, args.average_row, args.collection_test_column)
    if not found:
        raise DatasetError(f"{folder}: no folder in it has a table (*.csv)")
    _write(args, found)
    rows = [[*average[:5], average.number] for average in found]
    headers = ["experiment", "file", "column", "mean", "std", "n"]
    print(text_table(headers, rows, f"Averages of {folder}", 4))
    missing = dict.fromkeys((a.file, name) for a in found for name in a.missing)
    said = [f"{folder / name}: {file} is missing" for file, name in missing]
    said += _without_tables(folder, groups)
    for sentence in said:
        print(f"process_results: {sentence}", file=sys.stderr)
    print(f"\nresults: {args.output_folder.resolve()}")
    return 1 if said else 0


def _without_tables(folder: Path, groups: Mapping[str, Sequence[str]]) -> List[str]:
    """Return which experiments of `batch_execution` have no table at all."""
    return [
        f"{folder / members[0]}: no repetition of experiment '{experiment}' has a table; see its "
        f"{STATUS}"
        for experiment, members in groups.items()
        if not any(any((folder / m).glob("*.csv")) for m in members)
        and any((folder / m / STATUS).is_file() for m in members)
    ]


def _write(args: argparse.Namespace, found: List[Average]) -> None:
    folder = args.output_folder
    if args.overwrite and folder.is_dir() and any(os.scandir(folder)):
        if not (folder / LONG_FILE).is_file():
            raise OutputError(f"{folder}: holds no averages, and is left alone; choose another")
        common.empty_folder(folder)
    prepare_output_folder(folder)
    tables: Dict[tuple, List[Average]] = {}
    for average in found:
        tables.setdefault((average.experiment, average.file), []).append(average)
    column = args.collection_test_column or _USUAL_COLUMN
    for (experiment, file), of_file in tables.items():
        (folder / experiment).mkdir(exist_ok=True)
        text = atom_text(of_file, args.average_row, column)
        write_text_atomically(folder / experiment / file, text)
    write_text_atomically(folder / LONG_FILE, long_text(found))
