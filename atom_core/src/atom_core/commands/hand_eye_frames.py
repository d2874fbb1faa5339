"""What robot poses and images of cameras hang on: hand and base, and what is fixed to them.

The poses tell where the hand is in the base. Whatever else stands between a camera or a board and
these two is taken from fixed joints of the robot's description, where the configuration names one.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.errors import AtomError, ConfigError
from atom_core.geometry import se3
from atom_core.io.urdf import read_description
from atom_core.model.config import CalibrationConfig
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import Edge, FrameGraph, chain_transform

_OPTICAL = se3.from_rpy(np.zeros(3), np.array([-np.pi / 2, 0.0, -np.pi / 2]))


class Frames(NamedTuple):
    """Frames of a robot and its cameras.

    Attributes:
        arm: base and hand.
        fixed: ``parent_T_child`` (4, 4) of edges that the robot's poses do not tell, those of
            cameras as the description has them.
        unplaced: cameras of which it does not tell that; they are put at their parents.
        remarks: what of the edges is taken as usual, a sentence each.
    """

    arm: Edge
    fixed: Mapping[Edge, np.ndarray]
    unplaced: Sequence[str]
    remarks: Sequence[str]


class _Described(NamedTuple):
    """The robot's description; without it, or where it lacks a frame, why it tells nothing."""

    robot: Optional[RobotDescription]
    why_not: str


def config_of_cameras(
    config: CalibrationConfig, cameras: Sequence[str]
) -> Tuple[CalibrationConfig, List[str]]:
    """Return the configuration of cameras and boards alone, and what was left out of it.

    Of additional tfs and joints a robot's poses tell nothing.

    Raises:
        ConfigError: a camera is not in it.
    """
    for name in cameras:
        if name not in config.sensors:
            known = ", ".join(config.sensors)
            raise ConfigError(f"camera '{name}' is not in the configuration; there are: {known}")
    sensors = {name: config.sensors[name] for name in cameras}
    there = {*sensors, *config.calibration_patterns}
    reduced = replace(
        config,
        sensors=sensors,
        anchored_sensor=config.anchored_sensor if config.anchored_sensor in sensors else None,
        additional_tfs={},
        joints={},
        priors={name: prior for name, prior in config.priors.items() if name in there},
    )
    lost = [n for n in (*config.sensors, *config.additional_tfs, *config.joints) if n not in there]
    if not lost:
        return reduced, []
    return reduced, [
        f"left out of the configuration, since images and the robot's poses tell nothing of them: "
        f"{', '.join(lost)}"
    ]


def frames_of(config: CalibrationConfig, args: argparse.Namespace) -> Frames:
    """Return the frames of hand and base, and how all else is fixed to them.

    Raises:
        ConfigError: the configuration does not tell them, or hangs something on neither.
    """
    arm, described = _arm(config, args), _described(config)
    world, free = config.world_link, {sensor.edge for sensor in config.sensors.values()}
    fixed: Dict[Edge, np.ndarray] = {}
    remarks: List[str] = []
    if arm.parent != world:
        found, why = _told(described, Edge(world, arm.parent), free)
        fixed[Edge(world, arm.parent)] = np.eye(4) if found is None else found
        if found is None:
            remarks.append(
                f"'{arm.parent}' and '{world}' are taken to be one place: {why}; if they are not, "
                f"what stands in '{world}' is wrong by that: name a description_file that has both"
            )
    for name, parent in _parents(config).items():
        if parent not in (*arm, world):
            frames = (arm.child, arm.parent, world)
            edge, fixed_pose = _fixed_to_arm(described, name, parent, frames, free)
            fixed[edge] = fixed_pose
    unplaced = []
    for name, sensor in config.sensors.items():
        place, _ = _told(described, sensor.edge, set())
        unplaced += [name] if place is None else []
        fixed[sensor.edge] = np.eye(4) if place is None else place
        if sensor.link == sensor.child_link:
            continue
        edge = Edge(sensor.child_link, sensor.link)
        found, why = _told(described, edge, free)
        fixed[edge] = _OPTICAL if found is None else found
        if found is None:
            remarks.append(
                f"'{edge.child}' is taken to stand in '{edge.parent}' without a shift, z ahead and "
                f"x to the right: {why}; if it does not, the place of '{edge.parent}' is wrong by "
                f"that: name a description_file that has both"
            )
    return Frames(arm, fixed, unplaced, remarks)


def without_hold(
    config: CalibrationConfig, unplaced: Sequence[str]
) -> Tuple[CalibrationConfig, List[str]]:
    """Return the configuration in which no camera is held of whose place nothing is known.

    Args:
        config: of cameras and boards.
        unplaced: those cameras.

    Returns:
        With it what was left out, a sentence.
    """
    anchor = config.anchored_sensor if config.anchored_sensor in unplaced else None
    lost = [name for name in config.priors if name in unplaced]
    if anchor is None and not lost:
        return config, []
    what = ["its anchored_sensor"] if anchor else []
    what += [f"the priors of {', '.join(lost)}"] if lost else []
    kept = {name: prior for name, prior in config.priors.items() if name not in lost}
    held = config.anchored_sensor if anchor is None else None
    return replace(config, anchored_sensor=held, priors=kept), [
        f"left out of the configuration: {' and '.join(what)}, since no description tells where "
        f"{', '.join(dict.fromkeys(filter(None, (anchor, *lost))))} is"
    ]


def _parents(config: CalibrationConfig) -> Dict[str, str]:
    """Return the parents of cameras and boards, by name."""
    entries: Mapping[str, Any] = {**config.sensors, **config.calibration_patterns}
    return {name: entry.parent_link for name, entry in entries.items()}


def _arm(config: CalibrationConfig, args: argparse.Namespace) -> Edge:
    base = args.base_link or config.world_link
    others = sorted(set(_parents(config).values()) - {base, config.world_link})
    hand = args.hand_link or (others[0] if len(others) == 1 else None)
    if hand is None:
        raise ConfigError(
            f"the parents of cameras and boards do not tell which frame is the hand "
            f"({', '.join(others) or 'all are ' + base}); name it with --hand_link"
        )
    return Edge(base, hand)


def _described(config: CalibrationConfig) -> _Described:
    if not config.description_file:
        return _Described(None, "no description tells it")
    try:
        robot = read_description(config.description_file).robot
    except AtomError as error:
        return _Described(None, str(error))
    return _Described(robot, f"{config.description_file} does not tell it")


def _told(described: _Described, edge: Edge, free: Set[Edge]) -> Tuple[Optional[np.ndarray], str]:
    """Return ``parent_T_child`` (4, 4) by fixed joints; or None and why the description has none.

    Args:
        described: the robot.
        edge: between any two frames.
        free: edges that are estimated, of which it tells a first guess alone.

    Raises:
        ConfigError: the two move against each other.
    """
    robot = described.robot
    if robot is None or not {edge.parent, edge.child} <= set(robot.links):
        return None, described.why_not
    joints = {joint.edge: joint for joint in robot.joints.values()}
    chain = FrameGraph(joints).chain(edge.parent, edge.child)
    for step in chain:
        if joints[step.edge].type != FIXED or step.edge in free:
            raise ConfigError(
                f"'{edge.child}' is not fixed to '{edge.parent}': by the description, "
                f"'{step.edge}' is between them, of which the robot's poses tell nothing; correct "
                f"the configuration"
            )
    return chain_transform(chain, robot.transforms()), ""


def _fixed_to_arm(
    described: _Described, name: str, parent: str, robot_frames: Sequence[str], free: Set[Edge]
) -> Tuple[Edge, np.ndarray]:
    """Return the edge from one of the robot's frames to a parent that is fixed to it.

    Raises:
        ConfigError: no description has it so.
    """
    for frame in robot_frames:
        try:
            found, _ = _told(described, Edge(frame, parent), free)
        except ConfigError:
            continue
        if found is not None:
            return Edge(frame, parent), found
    hand, base = robot_frames[:2]
    raise ConfigError(
        f"'{name}' has the parent_link '{parent}', and the robot's poses connect only '{base}' and "
        f"'{hand}'; correct it, or --hand_link and --base_link"
    )
