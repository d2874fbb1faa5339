"""Give a dataset and its folder another name."""

from __future__ import annotations

import argparse
from pathlib import Path

from atom_core.commands import common
from atom_core.errors import DatasetError, OutputError
from atom_core.io.dataset_json import read_document, write_document

EXAMPLE = "python3 -m atom_core rename_atom_dataset -d data -n train"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_option(
        parser,
        "dataset_path",
        *("-d", "--dataset"),
        required=True,
        type=Path,
        metavar="DIR",
        help="the dataset's folder",
    )
    common.add_option(
        parser, "name", *("-n", "--new_name"), required=True, metavar="NAME", help="its new name"
    )


def run(args: argparse.Namespace) -> int:
    """Rename the folder, and the dataset in each of its JSON files that are datasets."""
    folder = args.dataset_path.resolve()
    target = folder.parent / args.name
    if not folder.is_dir():
        raise DatasetError(f"{args.dataset_path}: no such folder")
    if args.name in ("", ".", "..") or "/" in args.name:
        raise OutputError(f"'{args.name}': is no name of a folder; choose another one for --name")
    if target.exists():
        raise OutputError(f"{target}: exists already; choose another name")
    documents = {
        path: document for path in sorted(folder.glob("*.json")) if (document := _read(path))
    }
    if not documents:
        raise DatasetError(f"{args.dataset_path}: holds no dataset")
    for path, document in documents.items():
        metadata = {**(document.get("_metadata") or {}), "dataset_name": args.name}
        write_document(path, {**document, "_metadata": metadata})
    try:
        folder.rename(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot take the name ({error.strerror})") from None
    print(f"{target.resolve()}: {', '.join(path.name for path in documents)}")
    return 0


def _read(path: Path) -> dict:
    """Return a dataset's document; an empty one of what is none."""
    try:
        return read_document(path)
    except DatasetError:
        return {}
