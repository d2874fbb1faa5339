"""Put the static transforms of a bag into a dataset: the factory's calibration of a device."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Dict, Optional, Sequence

import numpy as np

from atom_calibration.errors import BagError
from atom_calibration.messages.poses import edge_of, transform_matrix
from atom_calibration.runtime import running
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.sound_transforms import SoundTransforms
from atom_core.commands.common import add_dataset_option, add_option
from atom_core.commands.dataset_output import add_overwrite_option, write_documents
from atom_core.commands.option_parser import OptionParser
from atom_core.io.dataset_json import document_of, read_dataset
from atom_core.io.paths import resolve_path, sibling
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge

EXAMPLE = "rosrun atom_calibration tf_static_to_dataset -json dataset.json -b data.bag"
_NAME, _RESULT, _TOPIC = "tf_static_to_dataset", "factory_calibration.json", "/tf_static"


def main(words: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(running.arguments() if words is None else list(words))
    return running.guarded(_NAME, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    dataset = read_dataset(args.dataset)
    static = static_transforms(_bag_of(dataset, args.bag))
    known = {edge for c in dataset.collections.values() for edge in c.transforms}
    taken = {edge: value for edge, value in static.items() if edge in known}
    if not taken:
        there = ", ".join(str(edge) for edge in static)
        raise BagError(f"{_TOPIC} has no transform of the dataset; it has: {there}")
    solved = dataset.with_transforms(dict.fromkeys(dataset.collections, taken))
    target = args.output or sibling(args.dataset, _RESULT)
    write_documents(args.dataset, {target: document_of(solved)}, args.overwrite)
    sys.stdout.write(f"taken from {_TOPIC}: {', '.join(str(edge) for edge in taken)}\n")
    return 0


def static_transforms(path: Path) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) [m] of the static transforms of a bag, the last ones.

    Raises:
        BagError: the bag cannot be read, or has none.
    """
    sound = SoundTransforms(_warn)
    with BagReader(path) as bag:
        found = {
            edge_of(transform): transform_matrix(transform)
            for item in bag.messages([_TOPIC])
            for transform in sound.of(item.message.transforms, _TOPIC)
        }
    if not found:
        raise BagError(f"{path}: there is no {_TOPIC} in it")
    return found


def _warn(text: str) -> None:
    sys.stderr.write(f"{_NAME}: warning: {text}\n")


def _bag_of(dataset: Dataset, given: Optional[Path]) -> Path:
    if given is not None:
        return given
    if not dataset.config.bag_file:
        raise BagError(f"{dataset.source}: its configuration names no bag_file; give one with -b")
    return resolve_path(dataset.config.bag_file)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=_NAME, description=__doc__, epilog=f"example: {EXAMPLE}")
    add_dataset_option(made)
    text = "the recording (default: bag_file of the dataset's configuration)"
    add_option(made, "bag", "-b", type=Path, metavar="FILE", help=text)
    text = f"the new dataset (default: {_RESULT} beside the input)"
    add_option(made, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(made)
    return made
