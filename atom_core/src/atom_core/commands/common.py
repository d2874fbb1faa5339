"""What the commands share: options with both spellings, datasets, selections, output folders."""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path
from typing import Any, Dict, List, Optional, Protocol, Sequence

from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import refuse_unwritable
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names

# Set to 1: results and tables of an earlier run are replaced without --overwrite, inputs never.
# batch_execution sets it for its experiments, which write to the same places one after the other.
REPLACE_RESULTS = "ATOM_REPLACE_RESULTS"
_SELECTIONS = (
    ("sensor_selection_function", "-ssf", "sensors"),
    ("collection_selection_function", "-csf", "collections"),
    ("pattern_selection_function", "-psf", "patterns"),
)


class Command(Protocol):
    """What a module of ``atom_core.commands`` offers to the command line."""

    __doc__: Optional[str]
    EXAMPLE: str  # command lines, one in a line

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options of the command."""

    def run(self, args: argparse.Namespace) -> int:
        """Do the work; return the exit code."""


def add_option(parser: Any, name: str, *short: str, **settings: Any) -> None:
    """Add a long option that is accepted with ``_`` and with ``-``, and ATOM's short ones.

    Args:
        parser: an argument parser or group.
        name: the long name without dashes, words joined by ``_``.
        short: ATOM's short options, as they are typed.
        settings: passed on to ``add_argument``.
    """
    dashed = "--" + name.replace("_", "-")
    spellings = dict.fromkeys(["--" + name, dashed, *short])
    parser.add_argument(*spellings, dest=name, **settings)


def group(parser: argparse.ArgumentParser, title: str) -> Any:
    """Return a group of options with a heading in --help; it takes options as a parser does."""
    return parser.add_argument_group(title)


def add_dataset_options(parser: argparse.ArgumentParser) -> None:
    """Add the dataset and the selections."""
    add_dataset_option(parser)
    add_selection_options(parser)


def named_path(text: str) -> Path:
    """Return a path of the command line; an argument that a launch file was not given is refused.

    Raises:
        argparse.ArgumentTypeError: the text is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("is empty; give a path")
    return Path(text)


def seed_of_chance(text: str) -> int:
    """Return a seed that numpy takes, as a type of argparse."""
    if not text.strip().isdigit():
        raise argparse.ArgumentTypeError(f"'{text}' is no seed; give a whole number, 0 or above")
    return int(text)


def add_dataset_option(parser: argparse.ArgumentParser) -> None:
    """Add the dataset."""
    add_option(
        parser,
        "dataset",
        "-json",
        "--json_file",
        required=True,
        type=named_path,
        metavar="FILE",
        help="the dataset's JSON (ATOM v3)",
    )


def add_selection_options(parser: argparse.ArgumentParser) -> None:
    """Add ATOM's selections of sensors, collections and patterns."""
    for name, short, what in _SELECTIONS:
        add_option(
            parser,
            name,
            short,
            nargs="+",
            metavar="SELECTION",
            help=f"{what} to use: names, globs, '!name' to leave one out, or ATOM's lambda strings",
        )


def selection_words(args: argparse.Namespace) -> List[str]:
    """Return the options of `add_selection_options` as they were given."""
    given = ((short, getattr(args, name)) for name, short, _ in _SELECTIONS)
    return [word for short, words in given if words for word in (short, *words)]


def add_overwrite_option(parser: Any, text: str = "replace results of an earlier run") -> None:
    """Add the permission to replace what a run wrote before; see `REPLACE_RESULTS`."""
    allowed = os.environ.get(REPLACE_RESULTS) == "1"
    add_option(parser, "overwrite", "-ow", action="store_true", default=allowed, help=text)


def add_output_options(parser: argparse.ArgumentParser, elsewhere: str = "") -> None:
    """Add the output folder, overwriting and verbosity.

    Args:
        parser: of the command.
        elsewhere: where the results go without the option; empty: it must be given.
    """
    default = f" (default: {elsewhere})" if elsewhere else ""
    add_option(
        parser,
        "output",
        "-o",
        required=not elsewhere,
        type=named_path,
        metavar="DIR",
        help=f"folder for the results; must be empty or absent, or add --overwrite{default}",
    )
    add_overwrite_option(parser)
    add_verbose_option(parser)


def add_verbose_option(parser: argparse.ArgumentParser) -> None:
    """Add the switch for more words."""
    add_option(parser, "verbose", "-v", action="store_true", help="say more while working")


def selected_dataset(args: argparse.Namespace) -> Dataset:
    """Read the dataset and reduce it to the selections.

    Raises:
        AtomError: the dataset is unusable, or a selection names nothing.
    """

    def choose(keys: Sequence[str]) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    return apply_selections(read_dataset(args.dataset, choose), args)


def apply_selections(dataset: Dataset, args: argparse.Namespace) -> Dataset:
    """Reduce a dataset to the selected sensors and patterns."""
    return dataset.selected(
        sensors=select_names(dataset.sensors, args.sensor_selection_function, "sensor"),
        patterns=select_names(dataset.patterns, args.pattern_selection_function, "pattern"),
    )


def refuse_empty(dataset: Dataset) -> None:
    """Refuse a dataset without collections.

    Raises:
        DatasetError: naming the file.
    """
    if not dataset.collections:
        raise DatasetError(
            f"{dataset.source}: there are no collections, so nothing can be measured; collect "
            f"them (collect_data, collect_from_bag), or name another file"
        )


def refuse_occupied(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds something or takes nothing, before any work is done.

    Nothing is created.

    Raises:
        OutputError: naming the folder and --overwrite, or why nothing can be written there.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file is in the way; choose another folder for --output")
    if folder.is_dir() and any(os.scandir(folder)) and not overwrite:
        raise OutputError(
            f"{folder}: the folder is not empty; add --overwrite to replace the results in it, "
            f"or choose another one"
        )
    refuse_unwritable(folder)


def empty_folder(folder: Path) -> None:
    """Remove all that is in a folder; it stays itself, also where it is a link.

    Raises:
        OutputError: something cannot be removed.
    """
    try:
        for path in list(folder.iterdir()):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
    except OSError as error:
        raise OutputError(f"{folder}: cannot be emptied ({error.strerror})") from None


def refuse_results_beside(dataset: Path, names: Sequence[str], overwrite: bool) -> Path:
    """Return the dataset's folder, unless results there would be lost.

    Args:
        dataset: the input.
        names: of the files that will be written beside it.
        overwrite: replace results of an earlier run; never the input itself.

    Raises:
        OutputError: naming what is in the way.
    """
    folder = dataset.parent
    refuse_unwritable(folder)
    if dataset.name in names:
        raise OutputError(
            f"{dataset}: the result beside it would have its own name and replace it; choose a "
            f"folder with --output"
        )
    there = [name for name in names if (folder / name).exists()]
    if there and not overwrite:
        raise OutputError(
            f"{folder}: results of an earlier run lie beside the dataset ({', '.join(there)}); add "
            f"--overwrite to replace them, or choose a folder with --output"
        )
    return folder


def options_document(args: argparse.Namespace) -> Dict[str, Any]:
    """Return the options of a command as they go into its result."""
    skipped = ("run", "command", "verbose")

    def plain(value: Any) -> Any:
        if isinstance(value, Path):
            return str(value)
        return [plain(part) for part in value] if isinstance(value, (list, tuple)) else value

    return {name: plain(value) for name, value in vars(args).items() if name not in skipped}


def strings(values: Optional[List[str]]) -> List[str]:
    """Return a list for an option that may be absent."""
    return list(values or [])
