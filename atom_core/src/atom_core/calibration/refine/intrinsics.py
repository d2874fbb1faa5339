"""Intrinsics join when the rest stands: what the corners do not determine is held.

A polynomial has more coefficients than boards in the middle of an image can tell. Which ones, the
covariance says before anything is solved. The highest are held then, one after the other, and the
user is told.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.calibration.start.boards import boards_in, solved_dataset
from atom_core.calibration.start.starts import RoughSolution
from atom_core.geometry.camera import Camera
from atom_core.model.dataset import Dataset
from atom_core.problem.builder import FreeEdges, build_problem
from atom_core.problem.camera_blocks import PINHOLE
from atom_core.problem.corner_measurement import CornerMeasurement
from atom_core.problem.measurements import Measurement
from atom_core.solvers import losses
from atom_core.solvers.base import Minimum, Solver, SolverSetup
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.reweighting import rough_minimum

_HELD_FIRST = ("k6", "k5", "k4", "k3", "k2", "k1", "p2", "p1")

Names = Mapping[str, Tuple[str, ...]]


@dataclass(frozen=True)
class WithIntrinsics:
    """A problem with those intrinsics free that the corners determine.

    Attributes:
        solver: of the problem.
        minimum: where to go on from.
        free: what is estimated.
        remarks: what the user should know.
    """

    solver: Solver
    minimum: Minimum
    free: FreeEdges
    remarks: Tuple[str, ...]


def with_intrinsics(
    solution: RoughSolution, free: FreeEdges, limit_rad: float, setup: SolverSetup
) -> WithIntrinsics:
    """Return the problem of a rough solution with the intrinsics free that the corners determine.

    Args:
        solution: found with all intrinsics held.
        free: names the intrinsics that are asked for; without any the problem stays as it is.
        limit_rad: a coefficient is determined when its sigma displaces the image's corner by less.
        setup: which solver.
    """
    if not free.intrinsics or solution.minimum.interrupted:
        return WithIntrinsics(solution.solver, solution.minimum, free, ())
    start, problem = solution.start, solution.solver.problem
    base = solved_dataset(start.initial, problem, solution.minimum.x, {})
    boards = boards_in(base, start.measurements)
    names: Dict[str, Tuple[str, ...]] = dict(free.intrinsics)
    while True:
        # Judged by what the corners tell alone, not by what is expected.
        determined = replace(free, intrinsics=names, expected_cameras={})
        solver = setup.make(build_problem(base, start.measurements, boards, determined))
        open_names = _open_names(solver, limit_rad)
        undetermined = _next_to_hold(names, open_names)
        if not undetermined:
            break
        names = {
            sensor: tuple(n for n in of_one if n != undetermined.get(sensor))
            for sensor, of_one in names.items()
        }
    determined = replace(determined, expected_cameras=free.expected_cameras)
    solver = setup.make(build_problem(base, start.measurements, boards, determined))
    zero = np.zeros(solver.problem.parameters.size)
    minimum = rough_minimum(solver, zero, setup.options, solution.minimum.iterations)
    remarks = _remarks(base, start.measurements, free.intrinsics, names)
    for sensor, expected in free.expected_cameras.items():
        pinholes = [name for name in open_names.get(sensor, ()) if name in PINHOLE]
        if pinholes:
            remarks.append(_held_near(sensor, pinholes, expected.sigma))
    return WithIntrinsics(solver, minimum, determined, tuple(remarks))


def _open_names(solver: Solver, limit_rad: float) -> Dict[str, List[str]]:
    """Return, by camera, which of its free intrinsics the corners alone do not tell."""
    problem = solver.problem
    x = np.zeros(problem.parameters.size)
    equations = solver.equations(x, problem.initial_sigmas, losses.NONE)
    covariance = Covariance(equations)
    found: Dict[str, List[str]] = {}
    for i, block in problem.parameters.camera_blocks():
        variance = np.diagonal(covariance.block(i))
        for place, name in block.free_components:
            if variance[place] > limit_rad**2:
                found.setdefault(block.sensor, []).append(name)
    return found


def _next_to_hold(names: Names, open_names: Mapping[str, Sequence[str]]) -> Dict[str, str]:
    """Return, by camera, the coefficient of its distortion to hold next; none where all are told.

    Args:
        names: the free intrinsics.
        open_names: those that the corners do not tell.
    """
    return {
        sensor: min((name for name in of_one if name not in PINHOLE), key=_HELD_FIRST.index)
        for sensor, of_one in names.items()
        if any(name not in PINHOLE for name in open_names.get(sensor, ()))
    }


def _held_near(sensor: str, names: Sequence[str], sigma: float) -> str:
    return (
        f"camera '{sensor}': {', '.join(names)} {'stays' if len(names) == 1 else 'stay'} near what "
        f"is given (within {100.0 * sigma:g} % of the focal length), since the corners do "
        f"not tell; tilt the boards by 30 deg and more, and hold them all over the image"
    )


def _remarks(
    dataset: Dataset, measurements: Sequence[Measurement], asked: Names, determined: Names
) -> List[str]:
    remarks = []
    for sensor, names in asked.items():
        held = [name for name in names if name not in determined[sensor]]
        if held:
            camera = dataset.sensors[sensor].camera
            assert camera is not None
            reach = round(100.0 * _reach(camera, sensor, measurements))
            remarks.append(
                f"camera '{sensor}': {', '.join(held)} {'is' if len(held) == 1 else 'are'} held, "
                f"since the corners that it saw do not tell (they reach {reach} % of the way from "
                f"the centre to the corners of the image); hold boards into the image's corners"
            )
    return remarks


def _reach(camera: Camera, sensor: str, measurements: Sequence[Measurement]) -> float:
    """Return how far from the centre corners were seen, as a part of the farthest corner's way."""
    seen = [
        m.pixels
        for m in measurements
        if isinstance(m, CornerMeasurement) and m.key.sensor == sensor
    ]
    ends = np.array([[x, y] for x in (0, camera.width) for y in (0, camera.height)], dtype=float)
    farthest = np.max(np.linalg.norm(ends - camera.centre_px, axis=1))
    reached = np.max(np.linalg.norm(np.concatenate(seen) - camera.centre_px, axis=1))
    return float(reached / farthest)
