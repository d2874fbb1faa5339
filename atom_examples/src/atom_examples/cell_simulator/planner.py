"""Where the board stands still: poses with the paper's statistics that nothing hides or pierces."""

from __future__ import annotations

from dataclasses import replace
from typing import Collection, Dict, Iterator, List, NamedTuple, Optional, Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.synthetic.cell import SCENARIOS, plan_board_poses
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.scene import Person
from atom_examples.cell_simulator.scene_model import PERSON_M
from atom_examples.cell_simulator.settings import ScannerSettings
from atom_examples.cell_simulator.sight import Sight, cut_length_m, is_open, sight
from atom_examples.cell_simulator.trajectory import ordered
from atom_examples.cell_simulator.world import World

_PERSON = 4  # stream of random numbers of one seed and scenario
_CLAMP_M = (0.4, 1.65)  # heights that the tripod reaches
_FLOOR_M = 0.02
LEAST_CUT_M = 0.25  # of the board, for a label of a 2D LiDAR
_AWAY = Person(50.0, 50.0, 0.0)
_PERSON_DISTANCE_M = (0.8, 1.05)  # from the middle of the board
_PERSON_PLACES = 16


class Stop(NamedTuple):
    """A pose of the board, and where the person stands."""

    world_T_pattern: np.ndarray
    person: Person


def plan_stops(world: World, scenario: str, collections: int) -> List[Stop]:
    """Return the stops of a recording, in an order with short ways.

    The scenario's statistics are those of the paper's seven sensors. Where there are 2D LiDARs, one
    of them sees the board at each stop.

    Args:
        world: the cell; its seed and the scenario decide everything.
        scenario: "train" or "test".
        collections: how many; the scenario's own number reproduces the paper's statistics.

    Raises:
        SimulatorError: nothing fits.
    """
    if collections < 1:
        raise SimulatorError(f"--collections is {collections}; give 1 or more")
    if scenario not in SCENARIOS:
        raise SimulatorError(f"scenario '{scenario}' is unknown; use {' or '.join(SCENARIOS)}")
    wanted = SCENARIOS[scenario].of_size(collections)
    scanners = {s.name for s in world.settings.all if isinstance(s, ScannerSettings)}
    sensors = {name: s for name, s in world.rig.sensors.items() if name not in scanners}
    free = _FreePoses(world, scanners, np.random.default_rng([world.seed, wanted.stream, _PERSON]))
    rng = np.random.default_rng([world.seed, wanted.stream])
    try:
        poses = plan_board_poses(replace(world.rig, sensors=sensors), wanted, rng, free.accept)
    except ValueError as error:
        raise SimulatorError(f"no board poses for seed {world.seed}: {error}") from None
    stops = [Stop(pose, free.persons[pose.tobytes()]) for pose in poses]
    return ordered(stops, lambda stop: stop.world_T_pattern, world.scene.board.pattern)


class _FreePoses:
    """Accepts board poses, and keeps where the person stands for each."""

    def __init__(self, world: World, scanners: Collection[str], rng: np.random.Generator):
        self.world, self.scene, self.scanners, self.rng = world, world.scene, scanners, rng
        self.pattern = world.scene.board.pattern
        self.persons: Dict[bytes, Person] = {}

    def accept(self, world_T_pattern: np.ndarray, seen: Sequence[str]) -> bool:
        """Accept a pose that those who would detect the board see whole, person and all."""
        if not self._has_room(world_T_pattern):
            return False
        self.scene.place_board(world_T_pattern)
        self.scene.place_person(_AWAY)
        lines = [sight(self.world, name, world_T_pattern, self.pattern) for name in seen]
        if not all(np.all(is_open(self.world, line)) for line in lines):
            return False
        person = self._place_person(world_T_pattern, lines)
        if person is None or not self._is_scanned():
            return False
        self.persons[world_T_pattern.tobytes()] = person
        return True

    def _is_scanned(self) -> bool:
        """Tell whether a 2D LiDAR sees the scene's board, if there are any."""
        return not self.scanners or any(
            cut_length_m(self.world, name) >= LEAST_CUT_M for name in self.scanners
        )

    def _has_room(self, world_T_pattern: np.ndarray) -> bool:
        border, scene = self.pattern.border, self.scene
        outline = np.vstack([border.corners, border.centre])
        points = se3.apply(world_T_pattern, np.column_stack([outline, np.zeros(len(outline))]))
        clamp = se3.apply(world_T_pattern, np.array([[*border.centre, 0.06]]))[0]
        if points[:, 2].min() < _FLOOR_M or not _CLAMP_M[0] <= clamp[2] <= _CLAMP_M[1]:
            return False
        for start in points:
            to_others = points - start
            length = np.linalg.norm(to_others, axis=1)
            rays = to_others[length > 0] / length[length > 0, None]
            if np.any(scene.cast(start, rays, moving=False).distance < length[length > 0]):
                return False
        down = np.array([[0.0, 0.0, -1.0]])
        return scene.cast(clamp, down, moving=False).distance[0] > clamp[2] - _FLOOR_M

    def _place_person(self, world_T_pattern: np.ndarray, lines: List[Sight]) -> Optional[Person]:
        """Return where a person hides nothing of what is open without one; None: nowhere."""
        middle = se3.apply(world_T_pattern, self.pattern.border.centre_in_pattern[None])[0]
        for person in self._places(middle):
            if self._may_stand(person):
                self.scene.place_person(person)
                if all(np.all(is_open(self.world, line, still=False)) for line in lines):
                    return person
        return None

    def _places(self, middle: np.ndarray) -> Iterator[Person]:
        first, distance = self.rng.uniform(0, 2 * np.pi), self.rng.uniform(*_PERSON_DISTANCE_M)
        for angle in first + 2 * np.pi / _PERSON_PLACES * np.arange(_PERSON_PLACES):
            x, y = middle[:2] + distance * np.array([np.cos(angle), np.sin(angle)])
            yield Person(x, y, angle + np.pi / 2)

    def _may_stand(self, person: Person) -> bool:
        radius, height = np.hypot(*PERSON_M[:2]) / 2, PERSON_M[2]
        low, high = np.array(self.world.rig.room.low), np.array(self.world.rig.room.high)
        place = np.array([person.x, person.y])
        if np.any(place < low[:2] + 0.5) or np.any(place > high[:2] - 0.5):
            return False
        up = np.array([[0.0, 0.0, 1.0]])
        around = radius * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        feet = np.column_stack([place + around, np.full(5, _FLOOR_M)])
        return all(self.scene.cast(foot, up, moving=False).distance[0] > height for foot in feet)
