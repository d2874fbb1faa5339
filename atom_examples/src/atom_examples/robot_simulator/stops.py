"""Where joints and boards stand still: drawn, so that each sensor sees each board often enough."""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Set, Tuple

import numpy as np

from atom_core.synthetic.board import held_before
from atom_core.synthetic.cell import SCENARIOS
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.settings import (
    ColourSettings,
    DepthSettings,
    LidarSettings,
    ScannerSettings,
)
from atom_examples.cell_simulator.sight import cut_length_m, is_open, sight
from atom_examples.robot_simulator.scenario import Carried, Fixed
from atom_examples.robot_simulator.world import RobotWorld

_TRIES = 4000  # for each stop
_LEAST_POINTS = {LidarSettings: 150, DepthSettings: 60}  # of 121 on a grid for depth images
_LEAST_CUT_M = 0.25
Pair = Tuple[str, str]  # a sensor and a pattern


class Stop(NamedTuple):
    """Where everything stands: true positions by joint [rad, m], ``world_T_pattern`` by board."""

    positions: Dict[str, float]
    boards: Dict[str, np.ndarray]


def draw_stops(world: RobotWorld, name: str, number: Optional[int] = None) -> List[Stop]:
    """Return the stops of a recording.

    Each shows what was seen least so far, so that all sensors see all boards about equally often.

    Args:
        world: the robot.
        name: of the recording, "train" or "test".
        number: of stops; the scenario's when None.

    Raises:
        SimulatorError: no place is found where enough is seen; names what lacks.
    """
    rng = np.random.default_rng([world.seed, SCENARIOS[name].stream])
    counts = dict.fromkeys(_pairs(world), 0)
    stops: List[Stop] = []
    for turn in range(number or world.scenario.stops[name]):
        stop, seen = _draw_until(world, turn, counts, rng)
        stops.append(stop)
        for pair in seen:
            counts[pair] += 1
    return stops


def _pairs(world: RobotWorld) -> List[Pair]:
    """Return the pairs that count."""
    boards = tuple(world.scenario.boards)
    by = world.scenario.seen.by or dict.fromkeys(world.settings.sensors, boards)
    return [(sensor, board) for sensor, of_sensor in by.items() for board in of_sensor]


def _draw_until(
    world: RobotWorld, turn: int, counts: Dict[Pair, int], rng: np.random.Generator
) -> Tuple[Stop, Set[Pair]]:
    """Return a stop that shows enough, one of the rarest pairs among it, and what it shows."""
    for attempt in range(_TRIES):
        stop = _draw(world, turn + attempt, rng)
        if not world.may_stand(stop.positions):
            continue
        world.place(stop.positions, stop.boards)
        seen = {pair for pair in counts if _is_seen(world, *pair)}
        if len(seen) < world.scenario.seen.detections:
            continue
        # A pair that is hard to see does not hold up the others for long.
        if attempt > _TRIES // 4 or min(counts[pair] for pair in seen) == min(counts.values()):
            return stop, seen
    unseen = min(counts, key=lambda pair: counts[pair])
    raise SimulatorError(
        f"robot '{world.robot.name}', seed {world.seed}: in {_TRIES} draws no stop shows "
        f"{world.scenario.seen.detections} boards to sensors (least often '{unseen[1]}' to "
        f"'{unseen[0]}'); mend boards, postures or 'seen' in {world.robot.scenario}"
    )


def _draw(world: RobotWorld, turn: int, rng: np.random.Generator) -> Stop:
    joints = world.scenario.joints
    posture = joints.postures[turn % len(joints.postures)]
    positions = {
        name: posture.get(name, 0.0) + joints.spread.get(name, 0.0) * rng.uniform(-1.0, 1.0)
        for name in joints.names
    }
    world.scene.place_joints(positions)
    boards = {}
    for name, board in world.scenario.boards.items():
        if isinstance(board, Fixed):
            boards[name] = world.standing(name, board.parent_T_pattern)
        else:
            boards[name] = _carried(world, name, board, rng)
    return Stop(positions, boards)


def _carried(world: RobotWorld, name: str, board: Carried, rng: np.random.Generator) -> np.ndarray:
    centre = rng.uniform(board.low, board.high)
    eye = board.faces[rng.integers(len(board.faces))]
    return held_before(eye, centre, world.patterns[name].border, rng, board.tilt_rad)


def _is_seen(world: RobotWorld, sensor: str, board: str) -> bool:
    """Tell whether a sensor sees enough of a board where it stands in the scene."""
    settings = world.settings.sensors[sensor]
    if isinstance(settings, ScannerSettings):
        return cut_length_m(world, sensor) >= _LEAST_CUT_M
    pattern = world.patterns[board]
    line = sight(world, sensor, world.world_T_pattern(board), pattern)
    part = world.scenario.seen.part
    least = _LEAST_POINTS.get(type(settings), 1.0)
    if isinstance(settings, ColourSettings):
        least = part * pattern.corner_count
    if len(line.goals) < least:
        return False
    return bool(np.sum(is_open(world, line)) >= max(least, part * len(line.goals)))
