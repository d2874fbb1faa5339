"""What the conversions of a dataset into published layouts share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Collection, List

import numpy as np

from atom_core.calibration.prepare.input_changes import without_partial_detections
from atom_core.commands import common
from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.data_files import data_path
from atom_core.io.dataset_json import read_dataset
from atom_core.io.hand_eye_folders import of_other_images
from atom_core.model.dataset import Dataset, is_complete, pose
from atom_core.model.selection import select_names


def add_export_options(parser: argparse.ArgumentParser) -> None:
    """Add what both conversions take."""
    add = common.add_option
    common.add_dataset_option(parser)
    add(
        parser,
        "output",
        *("-out", "--output_folder", "-o"),
        required=True,
        type=Path,
        metavar="DIR",
        help="the new folder; must be empty or absent, or add --overwrite",
    )
    what = "collections to use: names, globs, '!name', or ATOM's lambda strings"
    add(parser, "collection_selection_function", "-csf", nargs="+", metavar="S", help=what)
    flags = {
        "-uic": ("use_incomplete_collections", "also where not all sensors see all patterns"),
        "-rpd": ("remove_partial_detections", "labels of cameras that lack corners do not count"),
        "-ow": ("overwrite", "replace files in the folder"),
    }
    for short, (option, text) in flags.items():
        add(parser, option, short, action="store_true", help=text)


def exported_dataset(args: argparse.Namespace) -> Dataset:
    """Read the dataset and reduce it as ATOM does: complete collections, unless -uic is given.

    Raises:
        DatasetError: no collection is left.
    """
    common.refuse_occupied(args.output, args.overwrite)

    def choose(keys: Any) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    dataset = read_dataset(args.dataset, choose)
    if args.remove_partial_detections:
        dataset, _ = without_partial_detections(dataset)
    if args.use_incomplete_collections:
        return dataset
    complete = [key for key in dataset.collections if is_complete(dataset, key)]
    left_out = [key for key in dataset.collections if key not in complete]
    if not complete:
        raise DatasetError(
            f"{args.dataset}: in no collection all sensors see all patterns; add -uic"
        )
    if left_out:
        print(f"left out, since not all sensors see all patterns (-uic): {', '.join(left_out)}")
    return dataset.selected(collections=complete)


def cameras_of(dataset: Dataset) -> List[str]:
    """Return the names of the sensors that take pictures."""
    kinds = {name: sensor.kind for name, sensor in dataset.sensors.items()}
    return [n for n, kind in kinds.items() if kind.has_camera_info and not kind.measures_range]


def check_camera(dataset: Dataset, name: str) -> None:
    """Refuse what is no camera of the dataset.

    Raises:
        DatasetError: naming those that there are.
    """
    cameras = cameras_of(dataset)
    if name not in cameras:
        raise DatasetError(
            f"{dataset.source}: there is no camera '{name}'; there are: {', '.join(cameras) or '-'}"
        )


def image_file(dataset: Dataset, key: str, camera: str) -> Path:
    """Return the image of a camera in a collection.

    Raises:
        DatasetError: it is absent.
    """
    entry = (dataset.document["collections"][key].get("data") or {}).get(camera) or {}
    found = data_path(dataset.source.parent, entry) if "data_file" in entry else None
    if found is None:
        raise DatasetError(
            f"{dataset.source}: the image of '{camera}' in collection {key} is absent; restore it, "
            f"or leave the collection out with -csf"
        )
    return found


def folder_for(args: argparse.Namespace, written: Collection[Path]) -> Path:
    """Make the folder of a conversion.

    Args:
        args: the options of the command.
        written: images, and corners, that are to stand in it.

    Raises:
        OutputError: images of an earlier conversion are in it, which would stay beside these.
    """
    others = of_other_images(args.output, written)
    if others:
        raise OutputError(
            f"{args.output}: {others[0].relative_to(args.output)} is of another conversion "
            f"({len(others)} files), and would be taken for one of this; remove the images, or "
            f"choose another folder"
        )
    return prepare_output_folder(args.output, args.overwrite)


def robot_poses(dataset: Dataset, base: str, hand: str) -> List[np.ndarray]:
    """Return ``base_T_hand`` (4, 4) of each collection."""
    graph = dataset.graph
    return [pose(collection, graph, base, hand) for collection in dataset.collections.values()]
