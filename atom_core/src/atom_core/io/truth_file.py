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


def read_any_truth(path: Path) -> Truth:
    """Read a truth.

    Args:
        path: a truth file; an ATOM dataset, of which the ``transforms_ground_truth`` are taken
            where they stand and else the ``transforms``; a URDF or xacro.

    Raises:
        DatasetError, DescriptionError: the file is absent or malformed.
    """
    path = Path(path)
    if path.is_file() and path.suffix != ".json" and _first_sign(path) == "<":
        return _of_description(path)
    if path.is_file() and _is_dataset(path):
        return truth_of(_with_ground_truth(read_dataset(path)))
    return read_truth(path)


def _first_sign(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace").lstrip("\ufeff \t\r\n")[:1]


def _is_dataset(path: Path) -> bool:
    try:
        document = load_json(path.read_text(encoding="utf-8"))
    except ValueError:
        return False
    return isinstance(document, dict) and {"sensors", "collections"} <= set(document)


def _with_ground_truth(dataset: Dataset) -> Dataset:
    stored = {
        key: dataset.document["collections"][key].get(_GROUND_TRUTH) or {}
        for key in dataset.collections
    }
    try:
        return dataset.with_transforms({key: _poses(entries) for key, entries in stored.items()})
    except OTHER_KIND as error:
        raise DatasetError(
            f"{dataset.source}: {_GROUND_TRUTH} is malformed ({error}); restore the file"
        ) from None


def _poses(entries: Mapping[str, Mapping[str, Any]]) -> Dict[Edge, np.ndarray]:
    return {Edge(e["parent"], e["child"]): pose_of_entry(e) for e in entries.values()}


def _of_description(path: Path) -> Truth:
    robot = read_description(path).robot
    edges, joints = {}, {}
    for name, joint in robot.joints.items():
        origin = joint.parent_T_child(0.0)
        if joint.type in MOVING_TYPES:
            values = (*origin[:3, 3], *se3.rpy_from_rotation(origin[:3, :3]))
            numbers = dict(zip(ORIGIN_PARAMETERS, (float(v) for v in values)))
            joints[name] = {**numbers, POSITION_BIAS: 0.0}
        else:
            edges[joint.edge] = origin
    return replace(Truth(edges), joints=joints)
