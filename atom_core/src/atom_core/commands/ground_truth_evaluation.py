"""What ATOM's two evaluations against the truth share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, List, NamedTuple

import numpy as np

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.errors import DatasetError
from atom_core.evaluation.mixed import mixed_dataset, not_measured
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.io.truth_file import read_any_truth
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names
from atom_core.model.transforms import Edge
from atom_core.model.truth import with_truth

COLUMNS = (
    *("Trans (m)", "Rot (rad)", "X (m)", "Y (m)", "Z (m)"),
    *("Roll (rad)", "Pitch (rad)", "Yaw (rad)"),
)
_NO_LABELS = "frames are compared, and no label: every collection counts"
_NOT_HERE = (
    AtomOption("uic", "use_incomplete_collections", remark=_NO_LABELS),
    AtomOption("rpd", "remove_partial_detections", remark=_NO_LABELS),
    AtomOption("pn", "pattern_name", "pattern_1", remark=_NO_LABELS),
    AtomOption("si", "show_images", remark="nothing is drawn"),
)


class Compared(NamedTuple):
    """Both sides of a comparison.

    Attributes:
        found: the test set with the calibrated edges.
        true: with the true ones.
        own: edges that were estimated for each collection of the train file, and of which `found`
            has the test set's own.
    """

    found: Dataset
    true: Dataset
    own: List[Edge]


def add_files(parser: argparse.ArgumentParser) -> None:
    """Add both datasets, the truth and the selection."""
    add = common.add_option
    for option, what in (("train_json", "calibrated"), ("test_json", "test")):
        text = f"the {what} dataset"
        add(parser, option, f"-{option}", required=True, type=Path, metavar="F", help=text)
    text = (
        "a truth file, a dataset with true transforms, a URDF or xacro (default: the test set: its "
        "transforms_ground_truth, else its transforms)"
    )
    add(parser, "truth", type=Path, metavar="FILE", help=text)
    add(parser, "collection_selection_function", "-csf", nargs="+", metavar="S", help="only these")
    text = "a line for each collection"
    add(parser, "show_all_collections", "-sac", action="store_true", help=text)
    add_meaningless_options(parser, _NOT_HERE)


def compared(args: argparse.Namespace) -> Compared:
    """Read both datasets and the truth.

    Raises:
        DatasetError: the truth is that of the calibrated file itself.
    """

    def choose(keys: Any) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    train, test = read_dataset(args.train_json), read_dataset(args.test_json, choose)
    source = args.truth or args.test_json
    if source.resolve() == args.train_json.resolve():
        raise DatasetError(
            f"{source}: the calibration would be compared with itself; give the truth with --truth"
        )
    true = with_truth(test, read_any_truth(source))
    return Compared(mixed_dataset(train, test), true, not_measured(train, test))


def why_not_measured(edge: Edge) -> str:
    """Return why nothing is said of an edge that has a value for each collection."""
    return (
        f"'{edge}' was estimated for each collection of the train file, and is the test set's own "
        f"in its collections; what was found of it is not measured here"
    )


def warn_of_what_is_not_calibrated(dataset: Dataset, one: str, other: str) -> None:
    """Print a warning where no edge between two frames is one that a calibration may change."""
    edges = set(dataset.calibrated_edges)
    for collection in dataset.collections.values():
        edges |= {joint.edge for joint in collection.joints.values()}
    if not any(edge in edges for edge, _ in dataset.graph.chain(one, other)):
        print(
            f"warning: nothing that is calibrated lies between '{one}' and '{other}': these "
            f"figures say nothing of the calibration"
        )


def angle(found_T_true: np.ndarray) -> float:
    """Return the geodesic angle [rad] of a difference (4, 4)."""
    return float(se3.rotation_angle(found_T_true[:3, :3]))
