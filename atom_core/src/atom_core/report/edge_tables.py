"""Tables of the estimated edges and joints: where they are, how far they moved, how well known."""

from __future__ import annotations

import math
from typing import Any, List, Optional, Union

import numpy as np

from atom_core.geometry import se3
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.report.calibration_results import CalibrationResults
from atom_core.report.edge_results import EdgeResult, ParameterResult
from atom_core.report.tables import Figure, rounded, text_table
from atom_core.report.verdict import is_open

_OPEN = Figure("open")


def edge_tables(results: CalibrationResults) -> List[str]:
    """Return the poses of the selected edges, and how far they moved and how well they are known.

    Args:
        results: the figures.
    """
    initial = results.calibration.initial
    rows: List[List[Any]] = []
    for edge in results.edges:
        matrix = edge.parent_T_child
        rpy_deg = np.degrees(se3.rpy_from_rotation(matrix[:3, :3]))
        pose = [rounded(float(metres), 4) for metres in matrix[:3, 3]]
        pose += [rounded(float(degrees), 3) for degrees in rpy_deg]
        state = "anchored" if edge.anchored else _estimated(edge)
        rows.append([", ".join(edge.sensors), str(edge.edge), state, *pose])
    headers = ["Sensors", "Edge (parent-child)", "State", "x [m]", "y [m]", "z [m]"]
    headers += ["roll [deg]", "pitch [deg]", "yaw [deg]"]
    poses = text_table(headers, rows, "Calibrated edges (pose of the child in its parent)")
    known = results.has_combined_sigmas
    rows = [
        [
            _owner(edge),
            *_moved(edge, initial.first_value(edge.edge)),
            *_sigmas(edge, known),
        ]
        for edge in results.edges
        if not edge.anchored
    ]
    if not rows:
        return [poses]
    headers = ["Sensors", "moved [mm]", "turned [deg]", "sigma [mm]", "sigma [deg]"]
    meaning = "moved and turned since the start; "
    if known:
        headers += ["combined [mm]", "combined [deg]"]
        meaning += (
            "sigma: what differs between collections; combined: with usual errors of sensors and "
            "boards, too: rely on these; "
        )
    meaning += "open: not determined; " if any(_OPEN in row for row in rows) else ""
    title = f"How well they are known ({meaning}the largest of three axes)"
    return [poses, text_table(headers, rows, title)]


def _owner(edge: EdgeResult) -> str:
    """Return whose edge it is, and of which collection its sigmas are."""
    owner = ", ".join(edge.sensors) or str(edge.edge)
    return owner if edge.collection is None else f"{owner} (sigma: {edge.collection})"


def _moved(edge: EdgeResult, started: np.ndarray) -> List[Optional[Figure]]:
    """Return how far an edge is from its (4, 4) pose at the start [mm], [deg].

    Of what has a value in each collection nothing: the first, which is here, is often held.
    """
    if edge.collection is not None:
        return [None, None]
    shift_m, turn_rad = se3.pose_difference(started, edge.parent_T_child)
    return [rounded(1e3 * shift_m, 2), rounded(math.degrees(turn_rad), 3)]


def _sigmas(edge: EdgeResult, with_combined: bool) -> List[Figure]:
    found = []
    for sigma in (edge.sigma, *([edge.combined_sigma] if with_combined else [])):
        metres, radians = (float(np.max(sigma[part])) for part in (TRANSLATION, ROTATION))
        found.append(_OPEN if is_open(metres, "m") else rounded(1e3 * metres, 2))
        found.append(_OPEN if is_open(radians, "rad") else rounded(math.degrees(radians), 3))
    return found


def _estimated(result: Union[EdgeResult, ParameterResult]) -> str:
    """Return how an edge or a joint's parameter was found."""
    return "held by prior" if result.held else "estimated"


def joints_table(results: CalibrationResults) -> List[str]:
    """Return the table of the estimated joints; none where there is none."""
    rows: List[List[Any]] = []
    for name, parameters in results.joints.items():
        for p in parameters:
            factor, unit = (1e3, "mm") if p.unit == "m" else (math.degrees(1.0), "deg")
            numbers = [factor * v for v in figures(results, p)]
            rows.append([name, p.name, _estimated(p), *numbers, unit])
    headers = ["Joint", "Parameter", "State", *figure_names(results), "Unit"]
    return [text_table(headers, rows, "Calibrated joints")] if rows else []


def figures(results: CalibrationResults, parameter: ParameterResult) -> List[float]:
    """Return value, change and standard deviations of a parameter, in its unit."""
    found = [parameter.value, parameter.change, parameter.sigma]
    return found + ([parameter.combined_sigma] if results.has_combined_sigmas else [])


def figure_names(results: CalibrationResults) -> List[str]:
    """Return the headers of `figures`."""
    names = ["Value", "Change", "Sigma"]
    return names + (["Combined"] if results.has_combined_sigmas else [])
