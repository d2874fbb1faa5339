"""The fast minimiser: the same cost as the scipy solver's, minimised by Ceres in C++.

The problem goes over once, as arrays. Residuals, Jacobians and the reduction of each detection
to six numbers are those of atom_core.problem; tests compare the two.
"""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from atom_core import native
from atom_core.problem.parameters import PATTERN
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BorderBlock, ReprojectionBlock, ResidualBlock
from atom_core.solvers.base import Minimum, Tolerance

FEATURE = "the Ceres solver"


def native_problem(problem: Problem) -> Any:
    """Return the compiled twin of a problem.

    Raises:
        NativeModuleError: the compiled module is absent; the message says how to build it.
    """
    core = native.require(FEATURE)
    blocks = problem.parameters.blocks
    return core.CalibrationProblem(
        initial=np.array([b.initial for b in blocks]).reshape(-1, 4, 4),
        # Boards of one collection never meet in a detection, so they can be eliminated.
        eliminated=np.array([b.kind == PATTERN and b.collection is not None for b in blocks]),
        constants=problem.chains.constants,
        block=problem.chains.block,
        inverted=problem.chains.inverted,
        residual_blocks=[_residual_block(b) for b in problem.residual_blocks],
    )


def _residual_block(block: ResidualBlock) -> Dict[str, Any]:
    item: Dict[str, Any] = {"kind": block.kind, "detection": block.detection}
    if isinstance(block, ReprojectionBlock):
        camera = block.camera
        item["points"], item["pixels"] = block.corners_in_pattern, block.pixels
        item["camera"] = {
            "model": camera.model,
            "focal_px": camera.focal_px,
            "centre_px": camera.centre_px,
            "coefficients": list(camera.D),
            "limit_square": camera.limit_square,
        }
        return item
    item["points"] = block.points
    if isinstance(block, BorderBlock):
        item["centre"], item["half_size"] = block.centre, block.half_size
    return item
