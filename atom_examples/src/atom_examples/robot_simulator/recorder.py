"""A simulated robot into a bag, with the truth beside it; no master."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Dict, List, Mapping, Optional

import numpy as np

from atom_core.io.truth_json import write_truth
from atom_core.model.joints import POSITION_BIAS
from atom_core.model.transforms import Edge
from atom_core.model.truth import Truth
from atom_core.synthetic.cell import SCENARIOS
from atom_examples.cell_simulator import messages
from atom_examples.cell_simulator.recorder import (
    Recording,
    all_or_none,
    interval_s,
    record_ticks,
)
from atom_examples.robot_simulator.motion import RobotMotion, RobotState
from atom_examples.robot_simulator.scenario import Fixed
from atom_examples.robot_simulator.stops import Stop, draw_stops
from atom_examples.robot_simulator.world import RobotWorld


def record(
    world: RobotWorld, recording: Recording, path: Path, number: Optional[int] = None
) -> None:
    """Write a bag and its truth (``.truth.json``); both or none.

    Args:
        world: the robot.
        recording: which, and how.
        path: of the bag.
        number: of stops; the scenario's when None.

    Raises:
        SimulatorError: no stops are found, or the file cannot be written.
    """
    stops = draw_stops(world, recording.scenario, number)
    motion = RobotMotion(world, stops, recording.stop_s)
    truth_path = path.with_suffix(".truth.json")
    with all_or_none(path, [truth_path, path]) as active:
        record_ticks(_ShownRobot(world, recording), motion, recording, path, active[1])
        intervals = {f"{n:03d}": interval_s(motion, n) for n in range(len(stops))}
        more = {"robot": world.robot.name, "seed": world.seed, "stops": intervals}
        write_truth(truth_of_stops(world, stops), active[0], {**asdict(recording), **more})


def truth_of_stops(world: RobotWorld, stops: List[Stop]) -> Truth:
    """Return what is true of a recording: edges, boards at each stop, biases of joints."""
    boards = {}
    for number, stop in enumerate(stops):
        world.place(stop.positions, stop.boards)
        for name, board in world.scenario.boards.items():
            pose = world.parent_T_pattern(name)
            if isinstance(board, Fixed):
                pose = board.parent_T_pattern
            boards[(name, f"{number:03d}")] = pose
    biases = {name: {POSITION_BIAS: value} for name, value in world.biases.items()}
    return Truth(world.true_edges, boards, joints=biases)


class _ShownRobot:
    """A robot as it is recorded."""

    def __init__(self, world: RobotWorld, recording: Recording):
        self._world, self.scene, self.seed = world, world.scene, world.seed
        self.stream, self.devices = SCENARIOS[recording.scenario].stream, world.devices
        at_rest = messages.split_edges(world.description, {})[0]
        self.still: Mapping[Edge, np.ndarray] = {
            **at_rest,
            **world.told_edges(recording.initial_estimate),
        }

    def told(self, state: RobotState, tick: int) -> Mapping[Edge, np.ndarray]:
        reported = self._world.reported(state.positions)
        return messages.split_edges(self._world.description, reported)[1]

    def positions(self, state: RobotState) -> Dict[str, float]:
        return self._world.reported(state.positions)

    def place(self, state: RobotState) -> None:
        self._world.scene.place_joints(state.positions)
        boards = dict(state.boards)
        for name, board in self._world.scenario.boards.items():
            if isinstance(board, Fixed):
                boards[name] = self._world.standing(name, board.parent_T_pattern)
        self._world.place(state.positions, boards)

    def stamp_error_s(self, sensor: int, tick: int) -> float:
        return 0.0
