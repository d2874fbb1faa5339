"""Write a dataset of version 2 in the layout of version 3 beside it."""

from __future__ import annotations

import argparse
from typing import Any, Dict, Mapping

from atom_core.commands import common
from atom_core.commands.dataset_output import (
    add_output_option,
    add_overwrite_option,
    output_path,
    write_documents,
)
from atom_core.errors import DatasetError
from atom_core.io.dataset_json import dataset_from_document, read_document
from atom_core.io.migrate import migrated_document

EXAMPLE = (
    "python3 -m atom_core update_dataset_from_version_2_to_3 -json dataset.json -pn my_calibration"
)
_ADDITION = "_version_3"  # to the name of the input
_NAME = "pattern_1"  # of the one board


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    text = "of the calibration package, for the new dataset (default: as it is)"
    common.add_option(parser, "package_name", "-pn", metavar="NAME", help=text)
    text = f"the board's name in the new dataset (default: {_NAME})"
    names = ("-cpn", "--calibration_pattern")
    common.add_option(
        parser, "calibration_pattern_name", *names, default=_NAME, metavar="NAME", help=text
    )
    add_output_option(parser, _ADDITION)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Write it; data files are shared with the old one."""
    document = migrated_document(read_document(args.dataset), args.dataset)
    document = _with_pattern(document, args.calibration_pattern_name)
    if args.package_name:
        for part in ("_metadata", "calibration_config"):
            document[part] = {**document[part], "package_name": args.package_name}
    try:
        dataset_from_document(document, args.dataset)
    except DatasetError as error:
        raise DatasetError(f"cannot be updated: {error}") from None
    write_documents(args.dataset, {output_path(args, _ADDITION): document}, args.overwrite)
    return 0


def _with_pattern(document: Mapping[str, Any], name: str) -> Dict[str, Any]:
    """Return the document with another name of its board; of several all keep theirs."""
    new = dict(document)
    config = dict(new["calibration_config"])
    patterns = config.get("calibration_patterns") or {}
    if list(patterns) != [_NAME]:
        return new

    def renamed(entries: Any) -> Dict[str, Any]:
        return {name if key == _NAME else key: value for key, value in (entries or {}).items()}

    config["calibration_patterns"] = renamed(patterns)
    new["calibration_config"], new["patterns"] = config, renamed(new.get("patterns"))
    new["collections"] = {
        key: {**collection, "labels": renamed(collection.get("labels"))}
        for key, collection in new["collections"].items()
    }
    return new
