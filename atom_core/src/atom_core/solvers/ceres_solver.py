"""The fast minimiser: Ceres in C++, with the cost of `LevenbergMarquardt`.

The problem goes over once, as arrays. Residuals, Jacobians and the reduction of each detection
to six numbers are those of atom_core.problem; tests compare the two.
"""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from atom_core import native
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, number_scales
from atom_core.problem.camera_blocks import CameraNumbers
from atom_core.problem.joint_blocks import BiasNumbers, Numbers, OriginNumbers
from atom_core.problem.parameters import PATTERN
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import (
    BorderBlock,
    OrthogonalBlock,
    RangeBlock,
    ReprojectionBlock,
    ResidualBlock,
)
from atom_core.solvers.assessment import Assessment, InsetColumn
from atom_core.solvers.base import EXACT, Minimum, RoundProgress, Tolerance
from atom_core.solvers.levenberg_marquardt import ENOUGH, ROUNDING, interrupted_at, unit_cost
from atom_core.solvers.normal_equations import (
    DetectionParts,
    Layout,
    NormalEquations,
    spread,
)

FEATURE = "the Ceres solver (--solver ceres)"
_FIRST_RADIUS, _LAST_RADIUS, _RADIUS_GROWTH = 1e4, 1e16, 1e6


class CeresSolver:
    """Minimises one problem with Ceres; see `Solver` for the contract."""

    def __init__(self, problem: Problem):
        """Send the problem over.

        Raises:
            NativeModuleError: the compiled module is absent; the message says how to build it.
        """
        self.problem = problem
        self._native = _native_problem(problem)
        self._layout = Layout(problem.parameters)

    def take_insets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its insets only."""
        self.problem = problem
        for i, block in enumerate(problem.residual_blocks):
            if isinstance(block, BorderBlock):
                self._native.set_inset(i, block.inset)

    def take_range_offsets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its range offsets only."""
        before, self.problem = self.problem, problem
        for i, (old, block) in enumerate(zip(before.residual_blocks, problem.residual_blocks)):
            if isinstance(block, RangeBlock) and block is not old:
                self._native.set_points(i, block.points)

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at the vector x."""
        return self._assess(x, sigmas, loss, with_insets=False).equations

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        return self._assess(x, sigmas, loss, with_insets=True)

    def squares(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
        """Return, for each residual block, squared norms (n,) at x in units of sigma."""
        return list(self._native.squares(x, list(sigmas)))

    def _assess(
        self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str, with_insets: bool
    ) -> Assessment:
        blocks, twist_maps = self._native.assess(x, list(sigmas), loss, with_insets)
        maps = self.problem.parameters.localised(self.problem.chains.block, twist_maps)
        parts = [DetectionParts(b["detection"], b["information"], b["gradient"]) for b in blocks]
        columns = [
            InsetColumn(
                i,
                b["across"],
                b["by_steps"],
                b["curvature"],
                b["slope"],
                b["detection"],
                b["by_twist"],
            )
            for i, b in enumerate(blocks)
            if b["curvature"] > 0
        ]
        return Assessment(spread(self.problem, self._layout, maps, parts), tuple(columns))

    def minimise(
        self,
        x: np.ndarray,
        sigmas: Sequence[np.ndarray],
        loss: str,
        max_iterations: int,
        tolerance: Tolerance = EXACT,
        progress: Optional[RoundProgress] = None,
    ) -> Minimum:
        """Minimise the cost from x; the result is never worse than the start.

        Ceres judges by its damped steps. Before an exact minimum is called one, an undamped
        Newton step must promise nothing either; else Ceres goes on with hardly any damping.
        """
        iterations, radius = 0, _FIRST_RADIUS
        while True:
            left = max_iterations - iterations
            end = self._native.minimise(
                x,
                list(sigmas),
                loss,
                left,
                tolerance.decrease,
                tolerance.relative,
                radius,
                progress=_counted_from(iterations, progress),
            )
            x, iterations = end["x"], iterations + end["iterations"]
            if end["stopped"]:
                return interrupted_at(x, end["cost"], iterations)
            if not end["converged"] or tolerance.relative > 0 or iterations >= max_iterations:
                break
            promised = self.equations(x, sigmas, loss).newton_decrease()
            limit = tolerance.decrease * unit_cost(self.problem, end["cost"])
            if promised < max(limit, ROUNDING * end["cost"]):
                return Minimum(x, end["cost"], iterations, True, ENOUGH)
            if radius >= _LAST_RADIUS:
                return Minimum(x, end["cost"], iterations, False, "Ceres stopped too early")
            radius *= _RADIUS_GROWTH
        message = ENOUGH if end["converged"] else f"not done after {iterations} iterations"
        return Minimum(x, end["cost"], iterations, end["converged"], message)


def _counted_from(first: int, progress: Optional[RoundProgress]) -> Optional[RoundProgress]:
    if progress is None or first == 0:
        return progress
    return lambda iteration, cost, x: progress(first + iteration, cost, x)


def _native_problem(problem: Problem) -> Any:
    core = native.require(FEATURE)
    blocks = problem.parameters.blocks
    return core.CalibrationProblem(
        initial=np.array([b.initial for b in blocks]).reshape(-1, 4, 4),
        # Boards of one collection never meet in a detection, so they can be eliminated.
        eliminated=np.array([b.kind == PATTERN and b.collection is not None for b in blocks]),
        constants=problem.chains.constants,
        block=problem.chains.block,
        inverted=problem.chains.inverted,
        residual_blocks=[
            _residual_block(b, b.sensor in problem.parameters.cameras)
            for b in problem.residual_blocks
        ],
        parts=[
            {"block": i, **_part(block.numbers)}
            for i, block in enumerate(blocks)
            if block.numbers is not None
        ],
    )


def _part(numbers: Numbers) -> Dict[str, Any]:
    free = np.asarray(numbers.free, dtype=float)
    if isinstance(numbers, OriginNumbers):
        return {"kind": "origin", "values": numbers.initial, "free": free}
    if isinstance(numbers, CameraNumbers):
        return {"kind": "camera", "first": numbers.first, "free": free}
    assert isinstance(numbers, BiasNumbers)
    return {
        "kind": "bias",
        "values": numbers.initial * free,
        "free": free,
        "axis": numbers.axis,
        "is_prismatic": numbers.is_prismatic,
    }


def _movable(camera: Camera) -> Dict[str, Any]:
    scale = np.zeros(COUNT)
    scale[: 4 + camera.D.size] = number_scales(camera)
    return {"number_scale": scale, "width": camera.width, "height": camera.height}


def _residual_block(block: ResidualBlock, movable: bool) -> Dict[str, Any]:
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
            **({} if not movable else _movable(camera)),
        }
        return item
    assert isinstance(block, (OrthogonalBlock, BorderBlock))
    item["points"] = block.points
    if isinstance(block, BorderBlock):
        item["centre"], item["half_size"] = block.centre, block.half_size
        item["steps"], item["inset"] = block.steps.reshape(-1, 3), block.inset
    return item
