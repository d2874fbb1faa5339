"""What a robot description says beside each calibrated edge: how exact it is."""

from __future__ import annotations

from typing import Dict

import numpy as np

from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.report.calibration_results import CalibrationResults
from atom_core.report.edge_results import EdgeResult

_DISTANCE_M = 2.0  # of the point that is carried to the reference


def edge_comments(results: CalibrationResults) -> Dict[Edge, str]:
    """Return a comment for every selected edge and every calibrated joint."""
    calibration = results.calibration
    comments = {
        edge.edge: "anchored" if edge.anchored else _comment(results, edge)
        for edge in results.edges
    }
    joints = [calibration.dataset.joint(name) for name in calibration.free.joints]
    comments.update({joint.edge: "calibrated joint" for joint in joints})
    return comments


def _comment(results: CalibrationResults, edge: EdgeResult) -> str:
    """Return an edge's combined standard deviations and how well its sensors see with it.

    The latter is the deviation of a point carried to the reference, which is the anchored sensor,
    or the first one.
    """
    move = ", ".join(f"{1e3 * s:.2g}" for s in edge.combined_sigma[TRANSLATION])
    turn = ", ".join(f"{np.rad2deg(s):.2g}" for s in edge.combined_sigma[ROTATION])
    sort = "combined sigma" if results.has_combined_sigmas else "sigma"
    text = "calibrated, in part held by a prior" if edge.held else "calibrated"
    text += f"; {sort} x y z: {move} mm, about x y z: {turn} deg"
    anchored = results.calibration.free.anchored_sensors
    reference = anchored[0] if anchored else next(iter(results.sensors))
    for pair in results.propagation:
        if pair.source in edge.sensors and pair.target == reference:
            carried = next(p for p in pair.points if p.distance_m == _DISTANCE_M)
            text += f"; a point at {_DISTANCE_M:g} m, carried to {reference}: "
            text += f"{1e3 * carried.combined_sigma_m:.2g} mm"
            in_image = carried.combined_sigma_px
            text += "" if in_image is None else f", {in_image:.2g} px"
    return text
