"""A robot of a seed: its description, sensors and boards, and what it tells wrongly of itself."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, NamedTuple, Sequence

import numpy as np

from atom_core.io.config_yaml import read_config
from atom_core.io.urdf import read_description
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import Edge
from atom_core.synthetic.dataset import disturbed_edges
from atom_examples.cell_simulator.camera import FINER
from atom_examples.cell_simulator.devices import Device, device_of
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.lidar import Lidar
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.scene_model import Board, Surroundings, View
from atom_examples.cell_simulator.sensing import colour_camera, depth_camera, lidar_of, view_of
from atom_examples.cell_simulator.settings import (
    AnySettings,
    ColourSettings,
    DepthSettings,
    read_sensors,
)
from atom_examples.cell_simulator.visuals import BOX, Visual, read_visuals
from atom_examples.robot_simulator.robots import Robot
from atom_examples.robot_simulator.scenario import Fixed, read_scenario

DISTURBANCES = {"exact": (0.0, 0.0), "disturbed": (0.1, 0.1)}  # m, rad on each free edge
_THICKNESS_M = 0.001
_DISTURBANCE, _BIAS = 51, 52  # streams of random numbers of one seed
_WHITE = (1.0, 1.0, 1.0, 1.0)
_AT_ZERO: Dict[str, float] = {}


class Sensors(NamedTuple):
    """The robot's sensors by name."""

    sensors: Mapping[str, AnySettings]


class RobotWorld:
    """A robot with its boards in a room.

    What its description says is true; what it tells (``told_edges``, ``reported``) is wrong by the
    disturbance of each free edge and by the bias of each joint, which the seed draws.

    Attributes:
        robot: where it is described.
        seed: from which everything was drawn.
        config, scenario: what is calibrated, and how it is recorded.
        settings: of the sensors.
        description: the true robot.
        patterns: the boards by name.
        biases: what must be added to the positions that joints report [rad, m].
        scene: what there is to be seen.
        lidars: LiDARs by name.
        devices: all sensors.
    """

    def __init__(
        self,
        robot: Robot,
        seed: int,
        onlookers: Sequence[View] = (),
    ):
        """Build the robot.

        Args:
            robot: where it is described.
            seed: decides everything that is not described.
            onlookers: further views of the scene, which are recorded by nobody.

        Raises:
            AtomError: a file is malformed, or they contradict each other.
        """
        self.robot, self.seed = robot, seed
        self.config, self.scenario = read_config(robot.config), read_scenario(robot.scenario)
        self.settings = Sensors(read_sensors(robot.sensors))
        if not self.config.description_file:
            raise SimulatorError(f"{robot.config}: names no description_file; add it")
        described = read_description(self.config.description_file)
        self.description: RobotDescription = described.robot
        self._check()
        self.patterns: Dict[str, Pattern] = {
            name: pattern_from_config(name, self.config.calibration_patterns[name])
            for name in self.scenario.boards
        }
        self.biases = self._drawn_biases()
        visuals = read_visuals(described.urdf)
        self.scene = self._scene(visuals, onlookers)
        captured: Dict[str, Any] = {s.name: _captures(s) for s in self.settings.sensors.values()}
        self.lidars = {n: sensor for n, sensor in captured.items() if isinstance(sensor, Lidar)}
        self.devices: List[Device] = [
            device_of(s, captured[s.name]) for s in self.settings.sensors.values()
        ]

    # ---- what is true

    @property
    def true_edges(self) -> Dict[Edge, np.ndarray]:
        """The calibrated edges (4, 4), anchored ones included."""
        edges = self.description.transforms(_AT_ZERO)
        return {edge: edges[edge] for _, edge in self.config.estimated_edges}

    def world_T_pattern(self, board: str) -> np.ndarray:
        """Return where a board is in the scene (4, 4)."""
        return self.scene.world_T_patterns[list(self.patterns).index(board)]

    def parent_T_pattern(self, board: str) -> np.ndarray:
        """Return likewise in the frame of its parent_link."""
        parent = self.config.calibration_patterns[board].parent_link
        return np.linalg.solve(self.scene.pose(parent), self.world_T_pattern(board))

    def standing(self, board: str, parent_T_pattern: np.ndarray) -> np.ndarray:
        """Return ``world_T_pattern`` of a board in its parent, joints as they are in the scene."""
        parent = self.config.calibration_patterns[board].parent_link
        return self.scene.pose(parent) @ parent_T_pattern

    def place(self, positions: Mapping[str, float], boards: Mapping[str, np.ndarray]) -> None:
        """Put joints (true positions) and boards (``world_T_pattern``)."""
        self.scene.place_joints(positions)
        for number, name in enumerate(self.patterns):
            self.scene.place_board(boards[name], number)

    def may_stand(self, positions: Mapping[str, float]) -> bool:
        """Tell whether no joint is beyond its limits."""
        for name, position in positions.items():
            limits = self.description.joints[name].limits
            if limits is None or limits.upper <= limits.lower:
                continue
            if not limits.lower <= position <= limits.upper:
                return False
        return True

    # ---- what the robot tells

    def told_edges(self, estimate: str) -> Dict[Edge, np.ndarray]:
        """Return the calibrated edges (4, 4) as they are told: "exact" or "disturbed"."""
        true, anchored = self.true_edges, self.config.anchored_sensor
        held = None if anchored is None else self.config.sensors[anchored].edge
        rng = np.random.default_rng([self.seed, _DISTURBANCE])
        return {**true, **disturbed_edges(true, held, DISTURBANCES[estimate], rng)}

    def reported(self, positions: Mapping[str, float]) -> Dict[str, float]:
        """Return the positions that the robot reports for true ones."""
        return {name: p - self.biases.get(name, 0.0) for name, p in positions.items()}

    def _drawn_biases(self) -> Dict[str, float]:
        """Return biases between half of the largest and the largest, of either sign."""
        rng = np.random.default_rng([self.seed, _BIAS])
        largest = self.scenario.joints.position_bias
        return {
            name: float(value * rng.uniform(0.5, 1.0) * rng.choice([-1.0, 1.0]))
            for name, value in largest.items()
        }

    # ---- building

    def _scene(self, visuals: List[Visual], onlookers: Sequence[View]) -> Scene:
        settings = self.settings.sensors
        views = [
            view_of(s, s.camera)
            for s in settings.values()
            if isinstance(s, (ColourSettings, DepthSettings))
        ]
        patterns = self.config.calibration_patterns
        return Scene(
            self.description,
            visuals,
            self.scenario.joints.postures[0],
            {sensor.child_link for sensor in self.config.sensors.values()},
            [_board(pattern, patterns[name]) for name, pattern in self.patterns.items()],
            [*views, *onlookers],
            Surroundings(self.scenario.room),
            FINER,
            moving=True,
        )

    def _check(self) -> None:
        """Refuse files that contradict each other."""
        config, where = self.config, self.robot.folder
        _same(f"{where}: sensors of sensors.yaml", self.settings.sensors, config.sensors)
        told = {**self.scenario.boards, **dict.fromkeys(self.scenario.absent)}
        name = self.robot.scenario.name
        _same(f"{where}: boards of {name}", told, config.calibration_patterns)
        for name, sensor in config.sensors.items():
            settings = self.settings.sensors[name]
            if (settings.frame, settings.topic) != (sensor.link, sensor.topic_name):
                raise SimulatorError(
                    f"{self.robot.sensors}: sensor '{name}': frame {settings.frame} and topic "
                    f"{settings.topic} are not the link and topic_name of config.yml, "
                    f"{sensor.link} and {sensor.topic_name}; mend one of them"
                )
        for name, edge in config.estimated_edges:
            joint = self.description.joint_between(edge.parent, edge.child)
            if joint is None or joint.type != FIXED:
                raise SimulatorError(
                    f"{self.robot.config}: '{name}': the description has no fixed joint from "
                    f"'{edge.parent}' to '{edge.child}'; mend the edge or the description"
                )
        self._check_joints()
        self._check_boards()

    def _check_joints(self) -> None:
        joints = self.scenario.joints
        for name in [*joints.names, *joints.spread, *joints.position_bias]:
            if name not in joints.names or name not in self.description.joints:
                raise SimulatorError(
                    f"{self.robot.scenario}: joint '{name}' is in no posture, or not in the "
                    f"description; mend its name"
                )

    def _check_boards(self) -> None:
        for sensor, boards in (self.scenario.seen.by or {}).items():
            for name in (sensor, *boards):
                if name not in self.settings.sensors and name not in self.scenario.boards:
                    raise SimulatorError(
                        f"{self.robot.scenario}: seen: by: '{name}' is no sensor and no board; "
                        f"mend its name"
                    )
        for name, board in self.scenario.boards.items():
            config = self.config.calibration_patterns[name]
            if config.parent_link not in self.description.links:
                raise SimulatorError(
                    f"{self.robot.config}: pattern '{name}': the description has no link "
                    f"'{config.parent_link}'; mend its parent_link"
                )
            if isinstance(board, Fixed) != config.fixed:
                raise SimulatorError(
                    f"{self.robot.scenario}: board '{name}' is {'not ' * config.fixed}carried "
                    f"about, config.yml says fixed: {str(config.fixed).lower()}; mend one of them"
                )


def _same(what: str, here: Mapping[str, Any], there: Mapping[str, Any]) -> None:
    different = sorted(set(here) ^ set(there))
    if different:
        raise SimulatorError(
            f"{what} are not those of config.yml: {', '.join(different)}; give both the same"
        )


def _captures(settings: AnySettings) -> Any:
    if isinstance(settings, ColourSettings):
        return colour_camera(settings, settings.camera)
    if isinstance(settings, DepthSettings):
        return depth_camera(settings, settings.camera)
    return lidar_of(settings)


def _board(pattern: Pattern, config: PatternConfig) -> Board:
    """Return a board that is a white plate and nothing else."""
    border, link = pattern.border, pattern.frame
    middle = np.eye(4)
    middle[:3, 3] = [*border.centre, _THICKNESS_M / 2]
    width, height = (float(2 * half) for half in border.half_size)
    plate = Visual(link, middle, BOX, (width, height, _THICKNESS_M), _WHITE)
    return Board(pattern, config, RobotDescription(link, link, (link,), {}), [plate])
