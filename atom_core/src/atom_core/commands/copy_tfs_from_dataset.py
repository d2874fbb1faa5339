"""Copy transforms of one dataset into all collections of another one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Dict

import numpy as np

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, beside, write_documents
from atom_core.errors import DatasetError
from atom_core.io.dataset_json import document_of, read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge

EXAMPLE = (
    "python3 -m atom_core copy_tfs_from_dataset -sd atom_calibration.json -td dataset.json "
    "-pll base_link -cll rgb_1_link"
)
_ADDITION = "_tfs_copied"  # to the name of the target
_SAME = 1e-9  # entries of a transform that differ by less do not


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    for name, short, what in (
        ("source_dataset", "-sd", "the dataset whose transforms are copied"),
        ("target_dataset", "-td", "the dataset that gets them; it stays as it is"),
    ):
        add(parser, name, short, required=True, type=Path, metavar="FILE", help=what)
    for name, short, what in (
        ("parent_link_list", "-pll", "parents of the transforms"),
        ("child_link_list", "-cll", "their children, in the same order"),
    ):
        add(parser, name, short, required=True, nargs="+", metavar="FRAME", help=what)
    text = f"the new dataset (default: TARGET{_ADDITION}.json beside it)"
    add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Copy, and write beside the target."""
    parents, children = args.parent_link_list, args.child_link_list
    if len(parents) != len(children):
        raise DatasetError(
            f"-pll names {len(parents)} frames and -cll {len(children)}; each transform needs both"
        )
    source, target = read_dataset(args.source_dataset), read_dataset(args.target_dataset)
    edges = [Edge(parent, child) for parent, child in zip(parents, children)]
    values = {edge: _only_value(source, edge) for edge in edges}
    for edge in edges:
        target.first_value(edge)  # which refuses what the target does not have
    copied = target.with_transforms(dict.fromkeys(target.collections, values))
    path = args.output or beside(args.target_dataset, _ADDITION)
    write_documents(args.target_dataset, {path: document_of(copied)}, args.overwrite)
    return 0


def _only_value(dataset: Dataset, edge: Edge) -> np.ndarray:
    first = dataset.first_value(edge)
    others: Dict[str, np.ndarray] = {
        key: c.transforms[edge] for key, c in dataset.collections.items() if edge in c.transforms
    }
    for key, value in others.items():
        if np.max(np.abs(value - first)) > _SAME:
            raise DatasetError(
                f"{dataset.source}: transform '{edge}' is another one in collection {key}; only "
                f"what holds for all collections can be copied"
            )
    return first
