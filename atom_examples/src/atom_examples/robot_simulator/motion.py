"""How a robot gets from stop to stop: joints and boards together, smoothly, at a moderate speed."""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from atom_core.model.pattern import Pattern
from atom_examples.cell_simulator.trajectory import TICK_S, between
from atom_examples.robot_simulator.scenario import Carried
from atom_examples.robot_simulator.stops import Stop
from atom_examples.robot_simulator.world import RobotWorld

JOINT_SPEED, BOARD_SPEED_M_S = 0.8, 0.5  # on average; rad/s, and m/s of prismatic joints
_SHORTEST_S = 1.0


class RobotState(NamedTuple):
    """The moving part of the world at one instant.

    Attributes:
        positions: true positions by joint [rad, m].
        boards: ``world_T_pattern`` of those that are carried about, by name.
        stop: number of the stop where everything stands still, None while it moves.
        tick_of_stop: ticks since it came to the stop.
    """

    positions: Dict[str, float]
    boards: Dict[str, np.ndarray]
    stop: Optional[int] = None
    tick_of_stop: int = 0


class RobotMotion:
    """Joints and boards at each tick.

    Attributes:
        stops: where everything stands still.
        ticks: number of ticks.
    """

    def __init__(self, world: RobotWorld, stops: Sequence[Stop], stop_s: float):
        """Plan the motion; it stands for ``stop_s`` seconds at each stop."""
        self.stops = stops
        self._carried: Dict[str, Pattern] = {
            name: world.patterns[name]
            for name, board in world.scenario.boards.items()
            if isinstance(board, Carried)
        }
        self._stop_ticks = max(int(round(stop_s / TICK_S)), 1)
        moves = [self._ticks_between(a, b) for a, b in zip(stops, stops[1:])]
        self._starts: List[int] = [0, *np.cumsum([self._stop_ticks + n for n in moves]).tolist()]
        self.ticks = self._starts[-1] + self._stop_ticks

    def interval(self, stop: int) -> tuple:
        """Return the first tick of a stop and the first one after it."""
        return self._starts[stop], self._starts[stop] + self._stop_ticks

    def state(self, tick: float) -> RobotState:
        """Return where everything is at a tick, or between two."""
        number = int(np.searchsorted(self._starts, tick, side="right")) - 1
        since, here = tick - self._starts[number], self.stops[number]
        boards = {name: here.boards[name] for name in self._carried}
        if since <= self._stop_ticks - 1:
            return RobotState(dict(here.positions), boards, number, int(since))
        there = self.stops[number + 1]
        moving = self._starts[number + 1] - self._starts[number] - self._stop_ticks + 1
        share = _smooth((since - self._stop_ticks + 1) / moving)
        for name, pattern in self._carried.items():
            middle = pattern.border.centre_in_pattern
            boards[name] = between(here.boards[name], there.boards[name], middle, share)
        positions = {
            name: position + share * (there.positions[name] - position)
            for name, position in here.positions.items()
        }
        return RobotState(positions, boards)

    def _ticks_between(self, a: Stop, b: Stop) -> int:
        """Return the ticks strictly between two stops."""
        turns = [abs(b.positions[name] - p) / JOINT_SPEED for name, p in a.positions.items()]
        ways = [
            pattern.border.way_m(a.boards[name], b.boards[name]) / BOARD_SPEED_M_S
            for name, pattern in self._carried.items()
        ]
        return int(np.ceil(max([_SHORTEST_S, *turns, *ways]) / TICK_S))


def _smooth(share: float) -> float:
    """Return a share that starts and ends at rest."""
    return share * share * (3.0 - 2.0 * share)
