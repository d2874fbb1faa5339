"""A truth in any form: a simulation's file, a dataset with true transforms, a description."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, Mapping

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.dataset_entries import pose_of_entry
from atom_core.io.dataset_json import read_dataset
from atom_core.io.json_text import load_json
from atom_core.io.structure import OTHER_KIND
from atom_core.io.truth_json import read_truth
from atom_core.io.urdf import read_description
from atom_core.model.dataset import Dataset
from atom_core.model.joints import MOVING_TYPES, ORIGIN_PARAMETERS, POSITION_BIAS
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth, truth_of

_GROUND_TRUTH = "transforms_ground_truth"  # of a collection, where ATOM's tool has put it
_SAME = 1e-5  # entries of a matrix: what tf may round of a joint's position


def read_any_truth(path: Path) -> Truth:
    """Read a truth.

    Args:
        path: a truth file; an ATOM dataset, of which the ``transforms_ground_truth`` alone are
            taken where a collection has them, and else the ``transforms``; a URDF or xacro.

    Raises:
        DatasetError, DescriptionError: the file is absent or malformed.
    """
    path = Path(path)
    if path.is_file() and path.suffix != ".json" and _first_sign(path) == "<":
        return _of_description(path)
    if path.is_file() and is_dataset(path):
        return _of_dataset(read_dataset(path))
    return read_truth(path)


def _first_sign(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff \t\r\n")[:1]


def is_dataset(path: Path) -> bool:
    """Tell whether a file, which is there, is a dataset's JSON."""
    try:
        document = load_json(path.read_text(encoding="utf-8-sig"))
    except ValueError:
        return False
    return isinstance(document, dict) and {"calibration_config", "collections"} <= set(document)


def _of_dataset(dataset: Dataset) -> Truth:
    stored = {
        key: dataset.document["collections"][key].get(_GROUND_TRUTH) or {}
        for key in dataset.collections
    }
    if not any(stored.values()):
        return truth_of(dataset)
    try:
        true = {key: _poses(entries) for key, entries in stored.items()}
    except OTHER_KIND as error:
        raise DatasetError(
            f"{dataset.source}: {_GROUND_TRUTH} is malformed ({error}); restore the file"
        ) from None
    return _of_true_transforms(dataset, true)


def _of_true_transforms(dataset: Dataset, true: Mapping[str, Mapping[Edge, np.ndarray]]) -> Truth:
    """Return the truth that stands beside a dataset's own transforms, and nothing of the latter.

    These may be estimated: boards are, in a calibrated dataset. Likewise the parameters of its
    joints, which are true only where they give the true transforms.
    """
    collections = {
        key: replace(
            collection,
            transforms=true[key],
            joints={n: joint for n, joint in collection.joints.items() if joint.edge in true[key]},
        )
        for key, collection in dataset.collections.items()
    }
    truth = truth_of(replace(dataset, collections=collections))
    off = {
        name: joint.edge
        for key, collection in collections.items()
        for name, joint in collection.joints.items()
        if not np.allclose(joint.parent_T_child, true[key][joint.edge], rtol=0.0, atol=_SAME)
    }
    moving = {
        (off[name], key): true[key][off[name]]
        for name in set(off) & set(dataset.config.joints)
        for key in true
        if off[name] in true[key]
    }
    joints = {name: values for name, values in truth.joints.items() if name not in off}
    return replace(truth, joints=joints, moving={**truth.moving, **moving})


def _poses(entries: Mapping[str, Mapping[str, Any]]) -> Dict[Edge, np.ndarray]:
    return {Edge(e["parent"], e["child"]): pose_of_entry(e) for e in entries.values()}


def _of_description(path: Path) -> Truth:
    robot = read_description(path).robot
    edges, joints = {}, {}
    for name, joint in robot.joints.items():
        if not joint.has_one_position:
            continue  # where such a link is, a description does not say
        origin = joint.parent_T_child()
        if joint.type in MOVING_TYPES:
            values = (*origin[:3, 3], *se3.rpy_from_rotation(origin[:3, :3]))
            numbers = dict(zip(ORIGIN_PARAMETERS, (float(v) for v in values)))
            joints[name] = {**numbers, POSITION_BIAS: 0.0}
        else:
            edges[joint.edge] = origin
    return replace(Truth(edges), joints=joints)
