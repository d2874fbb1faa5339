"""Compute the boards' first poses (transforms_initial) of a dataset anew."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Dict, Mapping, Optional, Tuple

import numpy as np

from atom_core.commands import common
from atom_core.commands.dataset_output import beside, described, write_documents
from atom_core.errors import OutputError
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.io.dataset_json import read_dataset, write_document
from atom_core.io.dataset_writer import initial_board_document
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey, RgbLabel
from atom_core.model.pattern import Pattern, geometry_document

EXAMPLE = "python3 -m atom_core estimate_pattern_poses -json data/dataset.json"
_ADDITION = "_pattern_poses"  # to the name of the input


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    text = f"the new dataset (default: NAME{_ADDITION}.json beside it)"
    common.add_option(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    text = "replace files of an earlier run"
    common.add_option(parser, "overwrite", "-ow", action="store_true", help=text)
    text = "write into the input itself, as ATOM does"
    common.add_option(parser, "in_place", action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Compute, write, and say which boards no camera tells."""
    if args.in_place and args.output:
        raise OutputError("--in_place and --output exclude one another; leave one out")
    dataset = read_dataset(args.dataset)
    document = with_initial_boards(dataset)
    for name, pattern in document["patterns"].items():
        first = pattern["transforms_initial"]
        without = [key for key, value in first.items() if not value["detected"]]
        tail = f"; no camera tells it in {', '.join(without)}" if without else ""
        print(f"{name}: placed in {len(first) - len(without)} of {len(first)} collections{tail}")
    if args.in_place:
        write_document(args.dataset, document)
        print(described(args.dataset, document))
    else:
        target = args.output or beside(args.dataset, _ADDITION)
        write_documents(args.dataset, {target: document}, args.overwrite)
    return 0


def with_initial_boards(dataset: Dataset) -> Dict[str, Any]:
    """Return the dataset's document with the boards where the first camera that tells it has them.

    A camera tells it by its corners; both solutions for a plane are refined and compared.
    """
    observed = Observed(dataset)
    stored: Mapping[str, Any] = dataset.document.get("patterns") or {}
    patterns = dict(stored)
    for name, pattern in dataset.patterns.items():
        kept = stored.get(name) or geometry_document(pattern)
        first = {
            key: initial_board_document(pattern, _placed(dataset, observed, pattern, key))
            for key in dataset.collections
        }
        patterns[name] = {**kept, "transforms_initial": first}
    return {**dataset.document, "patterns": patterns}


def _placed(
    dataset: Dataset, observed: Observed, pattern: Pattern, key: str
) -> Optional[Tuple[str, np.ndarray]]:
    """Return the camera, and ``parent_T_pattern`` (4, 4); None where no camera tells it."""
    collection = dataset.collections[key]
    for name, sensor in dataset.sensors.items():
        if not isinstance(collection.labels.get((name, pattern.name)), RgbLabel):
            continue
        try:
            camera_T_pattern = observed.camera_T_pattern(DetectionKey(key, name, pattern.name))
        except NotMeasurableError:
            continue
        parent_T_camera = pose(collection, dataset.graph, pattern.parent_frame, sensor.frame)
        return name, parent_T_camera @ camera_T_pattern
    return None
