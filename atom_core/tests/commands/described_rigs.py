"""Descriptions of simulated rigs, and of rigs in which a sensor stands elsewhere."""

import json

import numpy as np

from atom_core.geometry import se3
from atom_core.io.urdf import read_description, write_calibrated_description
from atom_core.model.transforms import Edge


def urdf_of(dataset):
    return urdf_of_edges(next(iter(dataset.collections.values())).transforms)


def urdf_of_edges(edges):
    """Return a description with a fixed joint for each edge, `parent_T_child` (4, 4) by edge."""
    links = dict.fromkeys(f for edge in edges for f in edge)
    lines = ['<robot name="rig">', *(f'<link name="{name}"/>' for name in links)]
    for edge, matrix in edges.items():
        xyz = " ".join(repr(float(v)) for v in matrix[:3, 3])
        rpy = " ".join(repr(float(v)) for v in se3.rpy_from_rotation(matrix[:3, :3]))
        lines.append(
            f'<joint name="{edge.parent}_to_{edge.child}" type="fixed"><parent '
            f'link="{edge.parent}"/><child link="{edge.child}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
            f"</joint>"
        )
    return "\n".join([*lines, "</robot>"])


def document_with_moved_edge(made, child, move):
    """Return ``calibration.json`` of the results with an edge elsewhere, and the description."""
    text = (made / "results" / "calibration.json").read_text()
    document = json.loads(text)
    entry = next(e for e in document["edges"].values() if child in e["sensors"])
    pose = se3.from_quaternion(np.array(entry["translation_m"]), np.array(entry["quaternion_xyzw"]))
    pose = se3.moved(pose, move)
    entry["translation_m"] = pose[:3, 3].tolist()
    entry["quaternion_xyzw"] = se3.quaternion_from_rotation(pose[:3, :3]).tolist()
    return document, entry


def described_elsewhere(made, tmp_path, child, move):
    """Write a description in which a sensor is elsewhere, beside the results; return it."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    document, entry = document_with_moved_edge(made, child, move)
    (folder / "calibration.json").write_text(json.dumps(document))
    text = (made / "results" / "optimized.urdf.xacro").read_text()
    (tmp_path / "plain.urdf.xacro").write_text(text)
    description = read_description(tmp_path / "plain.urdf.xacro")
    pose = se3.from_quaternion(np.array(entry["translation_m"]), np.array(entry["quaternion_xyzw"]))
    edges = {Edge(entry["parent"], entry["child"]): pose}
    write_calibrated_description(description, edges, folder / "optimized.urdf.xacro", {}, {})
    return folder / "optimized.urdf.xacro"
