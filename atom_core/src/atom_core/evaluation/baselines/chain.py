"""A chain of cameras that Kalibr calibrated, put into a dataset: intrinsics and places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Dict, List, Mapping, Sequence

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.baselines.links import (
    Link,
    LinkedRig,
    placed_at,
    that_stays,
    why_not,
)
from atom_core.geometry import se3
from atom_core.io.kalibr import ChainCamera, read_camchain
from atom_core.model.dataset import Dataset

KALIBR = "kalibr"


def chain_baseline(dataset: Dataset, path: Path, named: Sequence[str] = ()) -> LinkedRig:
    """Put Kalibr's answer beside: its cameras with its intrinsics, where it has them.

    Args:
        dataset: whose cameras.
        path: the camchain.
        named: the cameras in the order of the chain; empty: by their topics.

    Raises:
        DatasetError: it is no camchain, or not one of these cameras.
    """
    chain = read_camchain(path)
    names = names_of_chain(dataset, chain, path, named)
    by_name = dict(zip(names, chain))
    links = [
        Link(
            name,
            names[0],
            se3.inverse(by_name[names[0]].first_T_camera) @ by_name[name].first_T_camera,
            0,
        )
        for name in names[1:]
    ]
    told = [f"{KALIBR}: {remark}" for remark in chain_remarks(dataset, by_name)]
    solved = with_chain(dataset, by_name)
    return LinkedRig(KALIBR, tuple(links), {}, solved, tuple(names), tuple(told))


def names_of_chain(
    dataset: Dataset, chain: Sequence[ChainCamera], path: Path, named: Sequence[str] = ()
) -> List[str]:
    """Return the dataset's camera of each one of a chain.

    Args:
        dataset: whose cameras.
        chain: as read.
        path: of its file, for messages.
        named: the cameras in the order of the chain; empty: by their topics.

    Raises:
        DatasetError: they do not match.
    """
    cameras = [n for n, s in dataset.sensors.items() if s.camera is not None]
    names = list(named)
    for link in chain[len(names) :] if not names else []:
        found = [n for n in cameras if _plain(dataset.sensors[n].topic) == _plain(link.topic)]
        if not found:
            raise DatasetError(
                f"{path}: {link.name} ({link.topic or 'no rostopic'}) is the topic of "
                f"no camera; name the cameras in the order of the chain: --cameras NAME ..."
            )
        names.append(found[0])
    unknown = [name for name in names if name not in cameras]
    if unknown or len(set(names)) != len(chain):
        raise DatasetError(
            f"{dataset.source}: the chain has {len(chain)} cameras, named are {', '.join(names)}; "
            f"there are: {', '.join(cameras)}"
        )
    for name, link in zip(names, chain):
        camera = dataset.sensors[name].camera
        assert camera is not None
        sizes = [(c.width, c.height) for c in (camera, link.camera)]
        if sizes[0] != sizes[1]:
            raise DatasetError(
                f"{path}: {link.name} has {sizes[1][0]} x {sizes[1][1]} pixels and "
                f"'{name}' {sizes[0][0]} x {sizes[0][1]}; they do not belong together"
            )
    return names


def _plain(topic: str) -> str:
    return "/" + topic.replace("/compressed", "").strip("/")


def with_chain(dataset: Dataset, chain: Mapping[str, ChainCamera]) -> Dataset:
    """Return the dataset with the intrinsics and places of a chain of cameras.

    The anchored camera, else the first of the chain, stays where it is; where it hangs below the
    edge of another one of the chain, that one does.

    Raises:
        DatasetError: two cameras have one edge, or the chain's places are not constant.
    """
    edges = [dataset.sensors[name].edge for name in chain]
    for edge in edges:
        if edges.count(edge) > 1:
            raise DatasetError(
                f"{dataset.source}: edge '{edge}' is of two cameras of the chain, and cannot have "
                f"two values"
            )
    fixed = that_stays(dataset, _preferred(dataset, chain), list(chain))
    fixed_T_first = se3.inverse(chain[fixed].first_T_camera)
    poses = {name: fixed_T_first @ link.first_T_camera for name, link in chain.items()}
    moved, _, refused = placed_at(dataset, fixed, poses)
    if refused:
        raise DatasetError(refused[0])
    sensors = dict(dataset.sensors)
    for name, link in chain.items():
        sensors[name] = replace(sensors[name], camera=link.camera)
    return replace(moved, sensors=sensors)


def turned_round(chain: Mapping[str, ChainCamera]) -> Dict[str, ChainCamera]:
    """Return a chain whose poses of each camera in the one before are inverted."""
    found: Dict[str, ChainCamera] = {}
    first_T_before = first_T_turned = np.eye(4)
    for name, link in chain.items():
        camera_T_before = se3.inverse(link.first_T_camera) @ first_T_before
        first_T_turned = first_T_turned @ camera_T_before
        first_T_before = link.first_T_camera
        found[name] = link._replace(first_T_camera=first_T_turned)
    return found


def chain_remarks(dataset: Dataset, chain: Mapping[str, ChainCamera]) -> List[str]:
    """Return what the user should know of a chain in a dataset: whether another camera stays."""
    preferred = _preferred(dataset, chain)
    stays = that_stays(dataset, preferred, list(chain))
    return [] if stays == preferred else [why_not(preferred, stays)]


def _preferred(dataset: Dataset, chain: Mapping[str, ChainCamera]) -> str:
    """Return the camera that should stay: the anchored one, else the first of the chain."""
    anchored = dataset.config.anchored_sensor
    return anchored if anchored is not None and anchored in chain else next(iter(chain))
