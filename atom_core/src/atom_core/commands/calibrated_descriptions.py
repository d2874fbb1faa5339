"""The robot's description with what was calibrated, and once more with the boards that stay."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, List, Sequence, Tuple, Union

import numpy as np

from atom_core.errors import DescriptionError, quoted
from atom_core.io.urdf import Description, write_calibrated_description
from atom_core.io.urdf_boards import BoardLink, with_boards
from atom_core.model.dataset import MULTIPLE, board_edge
from atom_core.model.transforms import Edge
from atom_core.report.calibration_results import CalibrationResults
from atom_core.report.edge_comments import edge_comments

DESCRIPTION_FILE, WITH_BOARDS_FILE = "optimized.urdf.xacro", "optimized_w_pattern.urdf.xacro"
DESCRIPTION_FILES = (DESCRIPTION_FILE, WITH_BOARDS_FILE)
_OF_EACH = "it moves, and has a pose of its own in each collection"


def write_descriptions(
    folder: Path,
    results: CalibrationResults,
    description: Union[Description, DescriptionError],
) -> List[str]:
    """Write them into a folder; return what the user should know.

    Args:
        folder: of the results.
        results: with the calibrated edges and joints.
        description: to start from, or why there is none.
    """
    if isinstance(description, DescriptionError):
        return [f"{DESCRIPTION_FILE} is not written: {description}"]
    try:
        remarks = _write_description(folder / DESCRIPTION_FILE, results, description)
    except DescriptionError as error:  # all other results are as good without it
        remarks = [f"{DESCRIPTION_FILE} is not written: {error}"]
    return remarks + _write_with_boards(folder / WITH_BOARDS_FILE, results, description)


def _write_description(
    path: Path, results: CalibrationResults, description: Description
) -> List[str]:
    edges, origins = _written_values(results)
    report = write_calibrated_description(description, edges, path, edge_comments(results), origins)
    of_each = [(edge, _OF_EACH) for edge in _of_each_collection(results)]
    missing = [*report.missing, *report.missing_joints, *of_each]
    remarks = [f"'{what}' is not written to {path.name}: {why}" for what, why in missing]
    if report.flattened:
        remarks.append(f"{path.name} is the expanded description: {report.reason}")
    return remarks


def _write_with_boards(
    path: Path, results: CalibrationResults, description: Description
) -> List[str]:
    """Write the description once more, with the boards that stay where they are, if there are any.

    What else is to be said of it has been said of the first one.
    """
    dataset = results.calibration.dataset
    there = {edge for c in dataset.collections.values() for edge in c.transforms}
    boards = [
        BoardLink(board_edge(pattern), dataset.config.calibration_patterns[name].mesh_file or "")
        for name, pattern in dataset.patterns.items()
        if pattern.fixed and board_edge(pattern) in there
    ]
    if not boards:
        return []
    poses = {board.edge: dataset.first_value(board.edge) for board in boards}
    edges, origins = _written_values(results)
    try:
        described = with_boards(description, boards)
        if not any(edge.child in described.robot.links for edge in poses):
            return [f"{path.name} is not written: {_no_parent(boards)}"]
        report = write_calibrated_description(
            described, {**edges, **poses}, path, edge_comments(results), origins
        )
    except DescriptionError as error:
        return [f"{path.name} is not written: {error}"]
    missing = [(edge, why) for edge, why in report.missing if edge in poses]
    return [f"'{edge}' is not written to {path.name}: {why}" for edge, why in missing]


def _no_parent(boards: Sequence[BoardLink]) -> str:
    names = dict.fromkeys(board.edge.parent for board in boards)
    return f"the robot has no link {quoted(names)}, the board's parent_link"


def _written_values(
    results: CalibrationResults,
) -> Tuple[Dict[Edge, np.ndarray], Dict[str, np.ndarray]]:
    """Return what a description is given: poses of edges, and origins of joints by name."""
    joints, dataset = results.calibration.free.joints, results.calibration.dataset
    of_each = _of_each_collection(results)
    edges = {e.edge: e.parent_T_child for e in results.edges if e.edge not in of_each}
    return edges, {name: dataset.joint(name).corrected_origin for name in joints}


def _of_each_collection(results: CalibrationResults) -> List[Edge]:
    """Return the edges that have no one pose: of what moves between the collections."""
    types = results.calibration.dataset.edge_types
    return [e.edge for e in results.edges if types.get(e.edge) == MULTIPLE and not e.sensors]
