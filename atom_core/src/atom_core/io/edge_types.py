"""Which edges of a dataset have one pose and which one for each collection.

Datasets say so under ``transforms``; those that ATOM wrote before it had this part, and edges that
are missing there, are told by their values.
"""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, Set, Tuple

import numpy as np

from atom_core.io.dataset_entries import pose_of_entry
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import MULTIPLE
from atom_core.model.transforms import Edge

_SAME = 1e-6  # entries of a matrix: what interpolation may change of a still edge


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
        The stored types, and ``multiple`` for edges without one whose pose differs between
        collections; an edge that is absent is fixed.
    """
    types: Dict[Edge, str] = {}
    for value in (document.get("transforms") or {}).values():
        if isinstance(value, Mapping) and {"parent", "child"} <= set(value) and value.get("type"):
            types[Edge(value["parent"], value["child"])] = value["type"]
    moving = _moving(document, one_pose | set(types))
    warnings = [
        f"the dataset does not say whether additional tf '{name}' moves: its pose '{entry.edge}' "
        f"differs between collections, and each keeps one of its own; if it stands still, give it "
        f"the type 'fixed' under 'transforms'"
        for name, entry in config.additional_tfs.items()
        if entry.edge in moving
    ]
    return {**types, **dict.fromkeys(moving, MULTIPLE)}, warnings


def _moving(document: Mapping[str, Any], known: Set[Edge]) -> List[Edge]:
    """Return the edges, but for known ones, whose pose differs between collections."""
    first: Dict[Edge, Mapping[str, Any]] = {}
    moving: Dict[Edge, None] = {}
    for collection in document["collections"].values():
        for entry in (collection.get("transforms") or {}).values():
            try:
                edge = Edge(entry["parent"], entry["child"])
                if edge in known or edge in moving:
                    continue
                if _differ(first.setdefault(edge, entry), entry):
                    moving[edge] = None
            except (KeyError, ValueError, TypeError):
                continue  # damaged: refused by name where the collection is read
    return list(moving)


def _differ(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    if (one["trans"], one["quat"]) == (other["trans"], other["quat"]):
        return False
    return not np.allclose(pose_of_entry(one), pose_of_entry(other), rtol=0.0, atol=_SAME)
