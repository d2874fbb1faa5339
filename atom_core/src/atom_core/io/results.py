"""Results for other programs: ATOM's parameter file, with angles as URDF has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, Mapping, Optional

import numpy as np
import yaml

from atom_core.geometry import se3
from atom_core.io.atomic import write_text_atomically
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.joints import JointSelection
from atom_core.model.transforms import Edge

_HEADER = (
    "# Calibrated edges, parent_T_child: metres; roll, pitch, yaw in radians about fixed axes\n"
    "# (URDF rpy); the same rotation as a quaternion x y z w.\n"
)


def write_parameters_yaml(
    path: Path,
    dataset: Dataset,
    additional: Mapping[str, Edge],
    joints: Optional[JointSelection] = None,
) -> None:
    """Write ``atom_calibration_params.yml``.

    Args:
        path: the file.
        dataset: the calibrated dataset.
        additional: additional tfs that were estimated, by name.
        joints: parameters that were estimated, by joint.
    """
    document: Dict[str, Any] = {
        "sensors": {s.name: _values(dataset, s.edge) for s in dataset.sensors.values()}
    }
    if additional:
        document["additional_tfs"] = {n: _values(dataset, e) for n, e in additional.items()}
    if joints:
        document["joints"] = {
            name: {parameter: dataset.joint(name).parameters[parameter] for parameter in parameters}
            for name, parameters in joints.items()
        }
    header = _HEADER
    for name, edge in additional.items():
        if dataset.edge_types.get(edge) == MULTIPLE:
            header += f"# '{name}' has a pose of its own in each collection: here is the first.\n"
    text = header + yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    write_text_atomically(path, text)


def _values(dataset: Dataset, edge: Edge) -> Dict[str, Any]:
    """Return an edge's numbers; of one with a value for each collection, the first."""
    matrix = dataset.first_value(edge)
    rpy = se3.rpy_from_rotation(matrix[:3, :3])
    values = np.concatenate([matrix[:3, 3], rpy])
    named = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), (float(v) for v in values)))
    quaternion = [float(v) for v in se3.quaternion_from_rotation(matrix[:3, :3])]
    return {**named, "quaternion_xyzw": quaternion}


def write_arguments_yaml(path: Path, arguments: Mapping[str, Any]) -> None:
    """Write ``command_line_args.yml``: the options of a command with their values.

    Args:
        path: the file.
        arguments: by long name; texts, numbers, lists of them, None.
    """
    write_text_atomically(path, yaml.safe_dump(dict(arguments), sort_keys=False))
