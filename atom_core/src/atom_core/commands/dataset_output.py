"""What the dataset tools share: where they write, and that nothing is lost there."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Dict, Mapping, Sequence

from atom_core.commands import common
from atom_core.errors import OutputError
from atom_core.io.dataset_json import relocated, write_document
from atom_core.io.paths import sibling
from atom_core.io.together import written_together


def add_overwrite_option(parser: argparse.ArgumentParser) -> None:
    """Add the permission to replace files."""
    common.add_overwrite_option(parser, "replace files of an earlier run")


def beside(dataset: Path, addition: str) -> Path:
    """Return a path beside a dataset: `train.json` and `_a` give `train_a.json`."""
    return sibling(dataset, f"{dataset.stem}{addition}.json")


def add_output_option(parser: argparse.ArgumentParser, addition: str, *other_names: str) -> None:
    """Add where the new dataset goes; without it beside the input, see `output_path`."""
    common.add_option(
        parser,
        "output",
        *("-o", *other_names),
        type=Path,
        metavar="FILE",
        help=f"the new dataset (default: NAME{addition}.json beside it)",
    )


def output_path(args: argparse.Namespace, addition: str) -> Path:
    """Return where the new dataset goes."""
    return args.output or beside(args.dataset, addition)


def write_documents(
    source: Path, documents: Mapping[Path, Mapping[str, Any]], overwrite: bool
) -> None:
    """Write datasets that were made from another one; say what each holds.

    Args:
        source: the dataset that they were made from, whose data files they share.
        documents: by path.
        overwrite: replace files; never the source.

    Raises:
        OutputError: a file is in the way, and nothing is written.
    """
    refuse_existing(source, list(documents), overwrite)
    for folder in dict.fromkeys(path.parent for path in documents):
        there = {path: document for path, document in documents.items() if path.parent == folder}
        with written_together(folder, [path.name for path in there]):
            for path, document in there.items():
                write_document(path, relocated(document, source.parent, folder))
        for path, document in there.items():
            print(described(path, document))


def refuse_existing(source: Path, targets: Sequence[Path], overwrite: bool) -> None:
    """Refuse targets that exist.

    Raises:
        OutputError: naming the first.
    """
    for path in targets:
        if path.exists() and path.resolve() == source.resolve():
            raise OutputError(f"{path}: is the input, which is left alone; choose another name")
        if path.exists() and not overwrite:
            raise OutputError(f"{path}: exists already; add --overwrite, or choose another name")


def described(path: Path, document: Mapping[str, Any]) -> str:
    """Return a line on a dataset that was written."""
    counts: Dict[str, int] = {name: len(document[name]) for name in ("sensors", "collections")}
    return f"{path.resolve()}: {counts['sensors']} sensors, {counts['collections']} collections"
