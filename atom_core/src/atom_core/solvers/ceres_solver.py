"""The fast minimiser: Ceres in C++, with the cost of `LevenbergMarquardt`.

The problem goes over once, as arrays. Residuals, Jacobians and the reduction of each detection
to six numbers are those of atom_core.problem; tests compare the two.
"""

from __future__ import annotations

from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from atom_core import native
from atom_core.geometry.camera import NEAR_M, Camera
from atom_core.geometry.intrinsics import COUNT, MOST_LOG, number_scales
from atom_core.geometry.rectangle import BLEND
from atom_core.problem.blocks import ExpectedPoseBlock, ParameterBlock, PoseBlock
from atom_core.problem.camera_blocks import CameraBlock
from atom_core.problem.joint_blocks import JointBiasBlock, JointOriginBlock
from atom_core.problem.model_errors import RangeOffset, RangeScale
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import (
    BorderBlock,
    OrthogonalBlock,
    RangeBlock,
    ReprojectionBlock,
    ResidualBlock,
)
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, InsetColumn
from atom_core.solvers.base import Minimum, RoundProgress
from atom_core.solvers.criteria import (
    ENOUGH,
    EXACT,
    LONGEST_MOVE_M,
    LONGEST_TURN_RAD,
    ROUNDING,
    SETTLING,
    SMALLEST_UNIT,
    Tolerance,
    unit_cost,
)
from atom_core.solvers.normal_equations import (
    DetectionParts,
    Layout,
    NormalEquations,
    add_prior,
    assembled,
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

    def take_rows(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its model errors only."""
        before, self.problem = self.problem, problem
        errors = {*before.model_errors, *problem.model_errors}
        if any(not isinstance(error, (RangeOffset, RangeScale)) for error in errors):
            self._native = _native_problem(problem)
            return
        for i, (old, block) in enumerate(zip(before.residual_blocks, problem.residual_blocks)):
            if isinstance(block, RangeBlock) and block is not old:
                self._native.set_points(i, block.points)

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at the vector x."""
        return self._assess(x, sigmas, loss, with_insets=False).equations

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        return self._assess(x, sigmas, loss, with_insets=True)

    def linearised_blocks(
        self, x: np.ndarray, poses: np.ndarray
    ) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
        """Yield residuals and derivatives by state of one block after the other, at x."""
        if self.problem.parameters.cameras:  # whose states have more numbers
            yield from self.problem.linearised_blocks(x, poses)
            return
        for i in range(len(self.problem.residual_blocks)):
            yield self._native.rows(i, x)

    def squares(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
        """Return, for each residual block, squared norms (n,) at x in units of sigma."""
        return list(self._native.squares(x, list(sigmas)))

    def _assess(
        self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str, with_insets: bool
    ) -> Assessment:
        blocks, by_chain = self._native.assess(x, list(sigmas), _loss(loss), with_insets)
        jacobians = self.problem.state_jacobians(by_chain)
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
        equations = assembled(self.problem, self._layout, jacobians, parts)
        add_prior(equations, self.problem.parameters, x)
        return Assessment(equations, tuple(columns))

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
                _loss(loss),
                _criteria(),
                left,
                tolerance.decrease,
                tolerance.relative,
                radius,
                progress=_counted_from(iterations, progress),
            )
            x, iterations = end["x"], iterations + end["iterations"]
            if end["stopped"]:
                return Minimum.interrupted_at(x, end["cost"], iterations)
            if not end["converged"] or tolerance.relative > 0 or iterations >= max_iterations:
                break
            promised = self.equations(x, sigmas, loss).newton_decrease()
            unit = unit_cost(self.problem, end["cost"])
            limit = tolerance.decrease * unit
            if promised < max(limit, ROUNDING * end["cost"]):
                return Minimum(x, end["cost"], iterations, True, ENOUGH)
            if radius >= _LAST_RADIUS:
                # No step lowers the cost, as where a distance has a kink: is it near enough?
                near = promised < SETTLING.decrease * unit
                why = ENOUGH if near else "Ceres stopped too early"
                return Minimum(x, end["cost"], iterations, near, why)
            radius *= _RADIUS_GROWTH
        message = ENOUGH if end["converged"] else f"not done after {iterations} iterations"
        return Minimum(x, end["cost"], iterations, end["converged"], message)


def _counted_from(first: int, progress: Optional[RoundProgress]) -> Optional[RoundProgress]:
    if progress is None or first == 0:
        return progress
    return lambda iteration, cost, x: progress(first + iteration, cost, x)


def _loss(name: str) -> Any:
    core = native.require(FEATURE)
    return core.Loss(name, losses.width(name), losses.step_length(name))


def _criteria() -> Any:
    core = native.require(FEATURE)
    return core.Criteria(
        longest_turn_rad=LONGEST_TURN_RAD,
        longest_move_m=LONGEST_MOVE_M,
        rounding=ROUNDING,
        smallest_unit=SMALLEST_UNIT,
    )


def _native_problem(problem: Problem) -> Any:
    core, parameters = native.require(FEATURE), problem.parameters
    return core.CalibrationProblem(
        initial=parameters.initial,
        eliminated=parameters.is_eliminated,  # they never meet in a detection
        constants=problem.chains.constants,
        block=problem.chains.block,
        inverted=problem.chains.inverted,
        intrinsics=problem.intrinsics_blocks,
        residual_blocks=[
            _residual_block(b, b.sensor in parameters.cameras) for b in problem.residual_blocks
        ],
        parts=[
            {"block": i, "free": np.asarray(block.free, dtype=float), **_part(block)}
            for i, block in enumerate(parameters.blocks)
            if not isinstance(block, PoseBlock) or isinstance(block, ExpectedPoseBlock)
        ],
    )


def _part(block: ParameterBlock) -> Dict[str, Any]:
    """Return a block that is more than a pose, as the native problem takes it."""
    expected = {"prior_mean": block.prior_mean, "prior_weight": block.prior_weight}
    if isinstance(block, JointOriginBlock):
        return {"kind": "origin", "values": block.initial, **expected}
    if isinstance(block, ExpectedPoseBlock):
        return {"kind": "pose", **expected}
    if isinstance(block, CameraBlock):
        return {"kind": "camera", "first": block.first, **expected}
    assert isinstance(block, JointBiasBlock)
    return {
        **expected,
        "kind": "bias",
        "values": block.initial * np.asarray(block.free, dtype=float),
        "axis": block.axis,
        "is_prismatic": block.is_prismatic,
    }


def _movable(camera: Camera) -> Dict[str, Any]:
    scale = np.zeros(COUNT)
    scale[: 4 + camera.D.size] = number_scales(camera)
    return {
        "number_scale": scale,
        "most_log": MOST_LOG,
        "width": camera.width,
        "height": camera.height,
    }


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
            "near_m": NEAR_M,
            **({} if not movable else _movable(camera)),
        }
        return item
    assert isinstance(block, (OrthogonalBlock, BorderBlock))
    item["points"] = block.points
    if isinstance(block, BorderBlock):
        item["centre"], item["half_size"] = block.centre, block.half_size
        item["blend"] = BLEND
        item["steps"], item["inset"] = block.steps.reshape(-1, 3), block.inset
        return item
    if block.added_m is not None:
        item["deviation"] = block.added_m
    if block.along_rays:
        item["facing"] = block.facing
    return item
