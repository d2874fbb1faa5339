"""The truth file of a simulation: JSON with calibrated edges, board poses and joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.io.atomic import write_json_atomically
from atom_core.io.json_text import load_json
from atom_core.io.paths import looked_for
from atom_core.io.structure import OTHER_KIND
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth

VERSION = "1.0"


def write_truth(truth: Truth, path: Path, more: Optional[Mapping[str, Any]] = None) -> None:
    """Write the truth: ``edges`` by name, ``boards`` by pattern and collection, ``joints``.

    Args:
        truth: edges, boards, and joints if there are any.
        path: the file.
        more: further entries of the document, which ``read_truth`` passes over.
    """
    boards: Dict[str, Dict[str, Any]] = {}
    for (pattern, collection), matrix in truth.boards.items():
        boards.setdefault(pattern, {})[collection] = pose_document(matrix)
    edges = {
        str(edge): {"parent": edge.parent, "child": edge.child, **pose_document(matrix)}
        for edge, matrix in truth.edges.items()
    }
    document = {**(more or {}), "version": VERSION, "edges": edges, "boards": boards}
    if truth.joints:
        document["joints"] = {name: dict(values) for name, values in truth.joints.items()}
    write_json_atomically(Path(path), document)


def read_truth(path: Path) -> Truth:
    """Read a truth file.

    Raises:
        DatasetError: the file is absent or malformed.
    """
    path = Path(path)
    if not path.is_file():
        raise DatasetError(
            f"{path}: no such truth file{looked_for(path)}; correct the path, or leave out --truth"
        )
    try:
        document = load_json(path.read_text(encoding="utf-8"))
        edges = {
            Edge(e["parent"], e["child"]): pose_from_document(e) for e in document["edges"].values()
        }
        boards = {
            (pattern, collection): pose_from_document(value)
            for pattern, by_collection in document.get("boards", {}).items()
            for collection, value in by_collection.items()
        }
        joints = {
            str(joint): {str(name): _finite(value) for name, value in values.items()}
            for joint, values in document.get("joints", {}).items()
        }
    except OTHER_KIND as error:
        raise DatasetError(f"{path}: not a truth file ({error})") from None
    return Truth(edges, boards, joints=joints)


def _finite(value: Any) -> float:
    if not np.isfinite(float(value)):
        raise ValueError(f"{value} is not finite")
    return float(value)


def pose_document(parent_T_child: np.ndarray) -> Dict[str, Any]:
    """Return a pose as ``translation_m`` and ``quaternion_xyzw``."""
    return {
        "translation_m": [float(v) for v in parent_T_child[:3, 3]],
        "quaternion_xyzw": [float(v) for v in se3.quaternion_from_rotation(parent_T_child[:3, :3])],
    }


def pose_from_document(document: Dict[str, Any]) -> np.ndarray:
    """Return the (4, 4) of ``translation_m`` and ``quaternion_xyzw``."""
    translation = np.array(document["translation_m"], dtype=float).reshape(3)
    return se3.from_quaternion(translation, np.array(document["quaternion_xyzw"], dtype=float))
