"""Run a batch of experiments, e.g. calibrations with folds and noise, one after the other."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, TextIO, Tuple

from atom_core.commands import common
from atom_core.errors import OutputError
from atom_core.io.atomic import prepare_output_folder, write_json_atomically, write_text_atomically
from atom_core.io.batch_files import Batch, Experiment, batch_of, dataset_of, read_data, rendered
from atom_core.io.dataset_json import read_dataset
from atom_core.io.folds import folds
from atom_core.io.json_text import load_json
from atom_core.io.paths import resolve_path

EXAMPLE = "python3 -m atom_core batch_execution -tf template.yml.j2 -df data.yml -of results"
RENDERED, RECORD, STATUS = "auto_rendered.yaml", "batch.json", "experiment.json"
_COLOUR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_DONE, _FAILED = 0, 1
_LAST_WORDS_S = 5.0  # after a command has ended; what it left in the background may go on


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for name, short, what in (
        ("template_filename", "-tf", "the template of the commands (Jinja, YAML)"),
        ("data_filename", "-df", "the data that fill it in (YAML)"),
        ("output_folder", "-of", "a folder for each experiment goes there"),
    ):
        add(parser, name, short, required=True, type=common.named_path, metavar="PATH", help=what)
    common.add_verbose_option(parser)
    text = "remove an earlier batch in the folder; without: go on where it was interrupted"
    add(parser, "overwrite", "-ow", action="store_true", help=text)
    add(parser, "dry_run", "-dr", action="store_true", help="print the commands, and do nothing")
    text = "seed of the folds (default: 0)"
    add(parser, "sample_seed", "-ss", type=common.seed_of_chance, default=0, metavar="N", help=text)
    text = "go on with the next experiment where one fails"
    add(parser, "keep_going", "-k", action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Fill in the template and run what it says; 1: an experiment failed."""
    text, record = _read(args)
    batch = batch_of(text, f"{args.template_filename} (filled in)")
    if args.dry_run:
        print("\n\n".join(_listed(batch)))
        return _DONE
    folder = _prepared(args.output_folder, text, record, args.overwrite)
    if batch.preprocessing.strip() and not _preprocess(batch.preprocessing, folder, args.verbose):
        return _FAILED
    failed = []
    for number, experiment in enumerate(batch.experiments, start=1):
        begin = f"{number}/{len(batch.experiments)} {experiment.name}:"
        if _is_done(folder / experiment.name):
            print(f"{begin} is done already", flush=True)
            continue
        print(f"{begin} runs", flush=True)
        problem = _experiment(experiment, folder / experiment.name, args.verbose)
        if problem:
            print(f"batch_execution: {experiment.name}: {problem}", file=sys.stderr)
            failed.append(experiment.name)
            if not args.keep_going:
                break
    print(_conclusion(folder, batch, failed))
    return _FAILED if failed else _DONE


def _read(args: argparse.Namespace) -> Tuple[str, Dict[str, Any]]:
    """Return the filled-in template, and what to record of how it was made."""
    data = read_data(args.data_filename)
    dataset = read_dataset(dataset_of(data))
    wanted, where = data.get("cross_validation"), str(args.data_filename)
    divisions = folds(dataset, wanted, args.sample_seed, where)
    record = {
        "template": str(args.template_filename),
        "data": where,
        "dataset": str(dataset.source),
        "cross_validation": wanted,
        "sample_seed": args.sample_seed,
        "folds": [fold._asdict() for fold in divisions],
    }
    return rendered(args.template_filename, data, divisions), record


def _listed(batch: Batch) -> List[str]:
    """Return the commands as text."""
    each = [f"# {e.name}\n{e.command.strip()}" for e in batch.experiments]
    if batch.preprocessing.strip():
        each.insert(0, f"# preprocessing\n{batch.preprocessing.strip()}")
    return each


def _prepared(folder: Path, text: str, record: Dict[str, Any], overwrite: bool) -> Path:
    """Make the folder of a batch, or take that of the same batch up again.

    Raises:
        OutputError: something else is in it.
    """
    there = folder / RENDERED
    if overwrite and folder.is_dir() and any(os.scandir(folder)):
        if not there.is_file():
            raise OutputError(f"{folder}: holds no batch, and is left alone; choose another folder")
        common.empty_folder(folder)
    if there.is_file():
        if there.read_text(encoding="utf-8") != text:
            raise OutputError(
                f"{folder}: holds a batch with other commands (compare {RENDERED}); add "
                f"--overwrite to remove it, or choose another folder"
            )
        return folder
    prepare_output_folder(folder)
    write_json_atomically(folder / RECORD, record)
    write_text_atomically(there, text)
    return folder


def _preprocess(command: str, folder: Path, verbose: bool) -> bool:
    print("preprocessing: runs", flush=True)
    code = _shell(command, folder, "preprocessing_", verbose)
    if code:
        print(f"batch_execution: preprocessing: {_ended(code, folder)}", file=sys.stderr)
    return code == 0


def _experiment(experiment: Experiment, folder: Path, verbose: bool) -> str:
    """Run an experiment and collect its files; return what went wrong, if anything."""
    if folder.is_dir():  # what an interrupted run left
        shutil.rmtree(folder)
    prepare_output_folder(folder)
    files = [resolve_path(file) for file in experiment.files]
    before = [_stamp(path) for path in files]
    code = _shell(experiment.command, folder, "", verbose)
    problem = _ended(code, folder) if code else _collected(files, before, folder)
    write_json_atomically(
        folder / STATUS, {"command": experiment.command, "exit_code": code, "problem": problem}
    )
    return problem


def _collected(files: Sequence[Path], before: Sequence[Optional[int]], folder: Path) -> str:
    """Copy the files of an experiment; return what went wrong, if anything."""
    for path, stamp in zip(files, before):
        now = _stamp(path)
        if now is None:
            return f"{path}: this file to collect was not written"
        if now == stamp:
            return (
                f"{path}: this file to collect was not written by the experiment, it is of an "
                f"earlier one; correct the command, or leave the file out"
            )
        shutil.copy2(path, folder / path.name)
    return ""


def _stamp(path: Path) -> Optional[int]:
    return path.stat().st_mtime_ns if path.is_file() else None


def _is_done(folder: Path) -> bool:
    try:
        status = load_json((folder / STATUS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return status.get("problem") == ""


def _shell(command: str, folder: Path, prefix: str, verbose: bool) -> int:
    """Run a command in a shell, what it prints goes to files; return its exit code."""
    environment = {**os.environ, common.REPLACE_RESULTS: "1"}
    process = subprocess.Popen(
        command,
        shell=True,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        universal_newlines=True,
        errors="replace",
    )
    files = [folder / f"{prefix}{name}.txt" for name in ("stdout", "stderr")]
    shown = (sys.stdout, sys.stderr) if verbose else (None, None)
    readers = [
        threading.Thread(target=_copy, args=(stream, file, show), daemon=True)
        for stream, file, show in zip((process.stdout, process.stderr), files, shown)
    ]
    for reader in readers:
        reader.start()
    try:
        return process.wait()
    finally:  # also upon Ctrl-C, which the command has got, too
        process.wait()
        for reader in readers:
            reader.join(_LAST_WORDS_S)
        if any(reader.is_alive() for reader in readers):
            print(f"note: a program that the command started still runs; see {files[0]}")


def _copy(stream: TextIO, path: Path, shown: Optional[TextIO]) -> None:
    """Copy until all who may write are gone: the command, and what it left in the background."""
    with path.open("w", encoding="utf-8") as file:
        for line in stream:
            file.write(_COLOUR.sub("", line))
            file.flush()
            if shown is not None:
                shown.write(line)
                shown.flush()


def _ended(code: int, folder: Path) -> str:
    said = ""
    for path in sorted(folder.glob("*stderr.txt")):
        lines = path.read_text(encoding="utf-8").split("\n")
        said = next((line.strip() for line in reversed(lines) if line.strip()), said)
    return f"its command ended with exit code {code}{': ' + said if said else ''}; see {folder}/"


def _conclusion(folder: Path, batch: Batch, failed: Sequence[str]) -> str:
    done = [e.name for e in batch.experiments if _is_done(folder / e.name)]
    rest = f"; failed: {', '.join(failed)}" if failed else ""
    return (
        f"\n{folder.resolve()}: {len(done)} of {len(batch.experiments)} experiments are done{rest}"
    )
