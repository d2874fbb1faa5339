"""Which edges of a dataset have one pose and which one for each collection.

Datasets say so under ``transforms``; those that ATOM wrote before it had this part, and edges that
are missing there, are told by their values.
"""

from __future__ import annotations

from typing import Any, Callable, Dict, List, Mapping, Set, Tuple

import numpy as np

from atom_core.io.dataset_entries import pose_of_entry
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import MULTIPLE
from atom_core.model.robot import FLOATING, PLANAR
from atom_core.model.transforms import Edge

_SAME = 1e-6  # entries of a matrix: what interpolation may change of a still edge
_ELSEWHERE = 1e-3  # what makes a difference to a calibration


def edge_types(
    document: Mapping[str, Any], config: CalibrationConfig, one_pose: Set[Edge]
) -> Tuple[Dict[Edge, str], List[str]]:
    """Return the types of edges, and a warning for each additional tf whose type had to be told.

    Args:
        document: of the dataset, with all its collections, also those that are not read further:
            which ones are chosen does not change what an edge is.
        config: of the dataset.
        one_pose: edges to which their values say nothing: those of sensors, which stand still by
            definition, and of boards.

    Returns:
        The stored types, and ``multiple`` for edges whose pose differs between collections and
        that have none, or that of a joint which no number places; an edge that is absent is fixed.
    """
    types: Dict[Edge, str] = {}
    for value in (document.get("transforms") or {}).values():
        if isinstance(value, Mapping) and {"parent", "child"} <= set(value) and value.get("type"):
            types[Edge(value["parent"], value["child"])] = value["type"]
    told = {edge for edge, kind in types.items() if kind not in (PLANAR, FLOATING)}
    moving = _moving(document, lambda edge: edge not in one_pose | told, _SAME)
    warnings = [
        f"the dataset does not say whether additional tf '{name}' moves: its pose '{entry.edge}' "
        f"differs between collections, and each keeps one of its own; if it stands still, give it "
        f"the type 'fixed' under 'transforms'"
        for name, entry in config.additional_tfs.items()
        if entry.edge in moving
    ]
    warnings += _contradicted(document, config, {e: types[e] for e in told if e not in one_pose})
    return {**types, **dict.fromkeys(moving, MULTIPLE)}, warnings


def _contradicted(
    document: Mapping[str, Any], config: CalibrationConfig, told: Mapping[Edge, str]
) -> List[str]:
    """Return a warning for each additional tf that moves, and has the type of one that does not."""
    one_each = {
        name: entry.edge
        for name, entry in config.additional_tfs.items()
        if told.get(entry.edge, MULTIPLE) != MULTIPLE
    }
    moving = _moving(document, lambda edge: edge in one_each.values(), _ELSEWHERE)
    return [
        f"additional tf '{name}' has the type '{told[edge]}', but its pose '{edge}' differs "
        f"between collections by more than 1 mm or 1 mrad, and one value is estimated for all; if "
        f"it moves, give it the type '{MULTIPLE}' under 'transforms'"
        for name, edge in one_each.items()
        if edge in moving
    ]


def _moving(
    document: Mapping[str, Any], is_asked: Callable[[Edge], bool], same: float
) -> List[Edge]:
    """Return those of some edges whose pose differs between collections by more than is the same.

    Args:
        document: of the dataset.
        is_asked: whether an edge is one of them.
        same: by how much entries of a matrix may differ.
    """
    first: Dict[Edge, Mapping[str, Any]] = {}
    moving: Dict[Edge, None] = {}
    for collection in document["collections"].values():
        for entry in (collection.get("transforms") or {}).values():
            try:
                edge = Edge(entry["parent"], entry["child"])
                if edge in moving or not is_asked(edge):
                    continue
                if _differ(first.setdefault(edge, entry), entry, same):
                    moving[edge] = None
            except (KeyError, ValueError, TypeError):
                continue  # damaged: refused by name where the collection is read
    return list(moving)


def _differ(one: Mapping[str, Any], other: Mapping[str, Any], same: float) -> bool:
    if (one["trans"], one["quat"]) == (other["trans"], other["quat"]):
        return False
    return not np.allclose(pose_of_entry(one), pose_of_entry(other), rtol=0.0, atol=same)
