"""Put the cameras of a Kalibr camchain into a dataset: intrinsics and where they are."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Dict, List

import numpy as np

from atom_core.commands import common
from atom_core.commands.dataset_output import add_overwrite_option, write_documents
from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_json import document_of, read_dataset
from atom_core.io.kalibr import ChainCamera, read_camchain
from atom_core.model.dataset import Dataset, pose
from atom_core.model.transforms import Edge

EXAMPLE = "python3 -m atom_core kalibr_stereo_calib -json dataset.json -k camchain.yaml"
_RESULT = "kalibr_calibration.json"
_SAME = 1e-6  # entries of a transform that differ by less do not


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_option(parser)
    add = common.add_option
    text = "Kalibr's camchain"
    add(parser, "kalibr_file", "-k", required=True, type=Path, metavar="FILE", help=text)
    text = "the dataset's cameras in the order of the chain (default: by their topics)"
    add(parser, "cameras", nargs="+", metavar="NAME", help=text)
    text = f"the new dataset (default: {_RESULT} beside the input)"
    add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
    add_overwrite_option(parser)


def run(args: argparse.Namespace) -> int:
    """Apply the chain; the anchored camera, else the first, stays where it is."""
    dataset, chain = read_dataset(args.dataset), read_camchain(args.kalibr_file)
    names = _names(dataset, chain, args)
    solved = with_chain(dataset, dict(zip(names, chain)))
    target = args.output or args.dataset.with_name(_RESULT)
    write_documents(args.dataset, {target: document_of(solved)}, args.overwrite)
    return 0


def _names(dataset: Dataset, chain: List[ChainCamera], args: argparse.Namespace) -> List[str]:
    """Return the dataset's camera of each one of the chain.

    Raises:
        DatasetError: they do not match.
    """
    cameras = [n for n, s in dataset.sensors.items() if s.camera is not None]
    names = list(args.cameras or [])
    for link in chain[len(names) :] if not names else []:
        found = [n for n in cameras if _plain(dataset.sensors[n].topic) == _plain(link.topic)]
        if not found:
            raise DatasetError(
                f"{args.kalibr_file}: {link.name} ({link.topic or 'no rostopic'}) is the topic of "
                f"no camera; name the cameras in the order of the chain: --cameras NAME ..."
            )
        names.append(found[0])
    unknown = [name for name in names if name not in cameras]
    if unknown or len(set(names)) != len(chain):
        raise DatasetError(
            f"{args.dataset}: the chain has {len(chain)} cameras, named are {', '.join(names)}; "
            f"there are: {', '.join(cameras)}"
        )
    for name, link in zip(names, chain):
        camera = dataset.sensors[name].camera
        assert camera is not None
        sizes = [(c.width, c.height) for c in (camera, link.camera)]
        if sizes[0] != sizes[1]:
            raise DatasetError(
                f"{args.kalibr_file}: {link.name} has {sizes[1][0]} x {sizes[1][1]} pixels and "
                f"'{name}' {sizes[0][0]} x {sizes[0][1]}; they do not belong together"
            )
    return names


def _plain(topic: str) -> str:
    return "/" + topic.replace("/compressed", "").strip("/")


def with_chain(dataset: Dataset, chain: Dict[str, ChainCamera]) -> Dataset:
    """Return the dataset with the intrinsics and places of a chain of cameras.

    Raises:
        DatasetError: two cameras have one edge, or the chain's places are not constant.
    """
    anchored = dataset.config.anchored_sensor
    fixed = anchored if anchored in chain else next(iter(chain))
    assert fixed is not None
    edges: Dict[Edge, np.ndarray] = {}
    for name, link in chain.items():
        edge = dataset.sensors[name].edge
        if name != fixed and (edge in edges or edge == dataset.sensors[fixed].edge):
            raise DatasetError(
                f"{dataset.source}: edge '{edge}' is of two cameras of the chain, and cannot have "
                f"two values"
            )
        if name != fixed:
            fixed_T_camera = se3.inverse(chain[fixed].first_T_camera) @ link.first_T_camera
            edges[edge] = _edge_value(dataset, fixed, name, fixed_T_camera)
    moved = dataset.with_transforms(dict.fromkeys(dataset.collections, edges))
    sensors = dict(dataset.sensors)
    for name, link in chain.items():
        sensors[name] = replace(sensors[name], camera=link.camera)
    return replace(moved, sensors=sensors)


def _edge_value(dataset: Dataset, fixed: str, name: str, fixed_T_camera: np.ndarray) -> np.ndarray:
    """Return ``parent_T_child`` (4, 4) with which a camera is where the chain has it."""
    sensor, graph = dataset.sensors[name], dataset.graph
    values = []
    for collection in dataset.collections.values():
        reference = dataset.sensors[fixed].frame
        parent_T_fixed = pose(collection, graph, sensor.edge.parent, reference)
        child_T_camera = pose(collection, graph, sensor.edge.child, sensor.frame)
        values.append(parent_T_fixed @ fixed_T_camera @ se3.inverse(child_T_camera))
    if np.max(np.ptp(np.array(values), axis=0)) > _SAME:
        raise DatasetError(
            f"{dataset.source}: '{fixed}' moves against the parent of '{name}', so that one chain "
            f"cannot place it in all collections"
        )
    return values[0]
