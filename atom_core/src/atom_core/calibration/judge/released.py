"""Whether a sensor that is held is what the data contradict: nothing does where it is free.

Where it does not stand where it is held, all else is bent to it: the intrinsics of its camera seem
to be wrong, an arm, a board, the sensors beside it. So the problem is solved once more without it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Callable, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.solved import Solved
from atom_core.calibration.prepare.priors import OPTION
from atom_core.calibration.refine.moving_parts import rebuilt
from atom_core.calibration.start.boards import solved_dataset
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.solvers.base import CONVERGED, SIGMA
from atom_core.solvers.reweighting import solve_again

_LEAST_M, _LEAST_RAD = 0.001, float(np.radians(0.05))  # nearer it is where it is held


class Released(NamedTuple):
    """A sensor that is held elsewhere than the data have it.

    Attributes:
        name: of the sensor.
        translation_m, rotation_rad: how far from where it is held.
        is_open: the data leave some direction open then.
    """

    name: str
    translation_m: float
    rotation_rad: float
    is_open: bool


class Tried(NamedTuple):
    """What another solution is worth.

    Attributes:
        fits: nothing contradicts it.
        is_open: the data leave some direction open.
    """

    fits: bool
    is_open: bool


def released(
    solved: Solved, held: Sequence[str], look_at: Callable[[Solved], Tried]
) -> Tuple[Released, ...]:
    """Return the sensors of which each, where it alone is released, leaves no contradiction.

    Args:
        solved: the solution that is contradicted.
        held: sensors whose place is stated though the data could tell it.
        look_at: tells what another solution is worth.
    """
    if solved.refined.options.weights != SIGMA:
        return ()
    initial, found = solved.start.initial, []
    for name in held:
        try:
            free = _without(solved, name)
        except AtomError:
            continue
        summary, problem = free.refined.summary, free.problem
        if summary.status != CONVERGED:
            continue
        tried = look_at(free)
        if not tried.fits:
            continue
        edge = initial.sensors[name].edge
        after = solved_dataset(initial, problem, summary.x, {})
        key = problem.detections[0].collection
        places = (dataset.collections[key].transforms[edge] for dataset in (initial, after))
        shift_m, turn_rad = se3.pose_difference(*places)
        if shift_m > _LEAST_M or turn_rad > _LEAST_RAD:
            found.append(Released(name, shift_m, turn_rad, tried.is_open))
    return tuple(found)


def _without(solved: Solved, name: str) -> Solved:
    """Return the solution with a sensor's edge free, and those of all sensors that share it."""
    start, refined, before = solved.start, solved.refined, solved.problem
    sensors = start.initial.sensors
    held = refined.free.anchored_sensors
    left = tuple(n for n in held if sensors[n].edge != sensors[name].edge)
    free = replace(refined.free, anchored_sensors=left)
    solver = solved.setup.make(rebuilt(start, before, refined.summary.x, free))
    summary = solve_again(solver, refined.options, before, refined.summary)
    after = replace(refined, solver=solver, summary=summary, free=free)
    return replace(solved, refined=after)


def why(found: Sequence[Released], otherwise: str) -> str:
    """Return one sentence on what is held elsewhere.

    Args:
        found: one or more.
        otherwise: what is the likeliest cause if they stand where they are held.
    """
    names = " and ".join(one.name for one in found)
    if len(found) > 1:
        return (
            f"{names} are held where the description has them (anchored_sensor, -as), and all "
            f"fits where one of them is free: hold one of them alone, or, if their places "
            f"are known: {otherwise}"
        )
    far = f"{1e3 * found[0].translation_m:.3g} mm and {np.degrees(found[0].rotation_rad):.2g} deg"
    remedy = "release it (-ias, or leave it out of -as)"
    if found[0].is_open:
        remedy = (
            f"as some direction is open then, state how well its place is known instead "
            f"(-ias, or out of -as, and {OPTION} {names} SIGMA_M SIGMA_RAD)"
        )
    return (
        f"{names} is held where the description has it (anchored_sensor, -as), and all fits "
        f"where it is free, {far} from there: {remedy}, or, if its place is known better than "
        f"that: {otherwise}"
    )
