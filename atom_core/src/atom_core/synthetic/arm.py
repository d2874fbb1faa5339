"""An arm with seven joints whose description is wrong by a known amount.

It carries a camera before a board that stands still, or a board before a camera that stands still.
The dataset holds the positions that the robot reports, and the transforms that follow from the
description; the measurements are those of the true arm. Of a `Realism` the errors of moving
transforms do not apply: here they follow from the joints.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.config import JointConfig
from atom_core.model.joints import PRISMATIC, REVOLUTE, JointState
from atom_core.model.pattern import pattern_from_config
from atom_core.model.sensor import RGB
from atom_core.model.transforms import Edge
from atom_core.synthetic.board import charuco, held_before
from atom_core.synthetic.dataset import SyntheticDataset, disturbed, make_dataset
from atom_core.synthetic.rgb import visible_corners
from atom_core.synthetic.rig import (
    COLOUR_CAMERA,
    Rig,
    Room,
    assemble,
    camera_mount,
    camera_of,
    jittered,
    looking_at,
)
from atom_core.synthetic.scenes import SceneOptions
from atom_core.synthetic.sensing import planted_in

FLANGE = "flange"
_BASE, _ROOM = "arm_base", Room((-7.0, -7.0, 0.0), (7.0, 7.0, 3.5))
_ERRORS = 310  # stream of random numbers of one seed
_CORNERS_SEEN, _TRIES = 0.6, 5000
_SPREAD = (0.5, 0.5, 0.1, 0.5, 0.5, 0.5, 0.5)  # rad, m


class _Joint(NamedTuple):
    name: str
    child: str
    xyz: Tuple[float, float, float]
    rpy: Tuple[float, float, float]
    axis: Tuple[float, float, float]
    type: str = REVOLUTE


_JOINTS = (
    _Joint("shoulder_pan", "shoulder", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), (0, 0, 1)),
    _Joint("shoulder_lift", "upper_arm", (0.0, 0.12, 0.0), (0.1, -0.2, 0.3), (0, 1, 0)),
    _Joint("telescope", "boom", (0.0, -0.05, 0.3), (0.0, 0.0, 0.0), (0.05, 0, 1), PRISMATIC),
    _Joint("elbow", "forearm", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), (0, 1, 0)),
    _Joint("wrist_1", "wrist_1_link", (0.0, 0.0, 0.40), (0.0, 0.2, 0.0), (0, 1, 0)),
    _Joint("wrist_2", "wrist_2_link", (0.0, 0.09, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)),
    _Joint("wrist_3", FLANGE, (0.0, 0.0, 0.09), (0.0, 0.0, 0.0), (0, 1, 0)),
)
JOINT_NAMES = tuple(joint.name for joint in _JOINTS)
_HOME = (0.0, 0.4, 0.0, 0.9, 0.1, 0.0, 0.0)  # the arm stretched forwards

Errors = Mapping[str, Mapping[str, float]]
Lacks = Mapping[str, Callable[[float], float]]


class _Wrong(NamedTuple):
    """What of the arm's description and of its reported positions is wrong."""

    errors: Errors
    lacks: Lacks

    def states(self, positions: Any) -> Dict[str, JointState]:
        """Return the true joints at some reported positions (7,), by name."""
        described = _states(positions)
        true = {}
        for name, state in described.items():
            lack = self.lacks[name](state.position) if name in self.lacks else 0.0
            parameters = self.errors.get(name, {})
            true[name] = replace(state, position=state.position + lack).with_parameters(
                {p: state.parameters[p] + error for p, error in parameters.items()}
            )
        return true

    def edges(self, positions: Any) -> Dict[Edge, np.ndarray]:
        """Return the true edges at some reported positions (7,)."""
        return _edges(self.states(positions))


def camera_on_arm(
    seed: int = 0,
    *,
    errors: Errors,
    lacks: Lacks = {},  # noqa: B006 (never changed)
    **options: Any,
) -> SyntheticDataset:
    """Simulate a camera on the flange of an arm before a board that stands still.

    Open by nature: the bias of the last joint, which the camera's pose imitates, and that of the
    first, which the board's does.

    Args:
        seed: of everything random.
        errors: true minus described value of parameters, by joint; they are the ones that the
            configuration asks for.
        lacks: what the reported positions lack, by joint, as a function of them [rad, m].
        options: of ``SceneOptions``.
    """
    rng, chosen = np.random.default_rng([seed, 300]), SceneOptions(seed=seed, **options)
    flange_T_link = jittered(se3.from_rpy(np.array([0.05, 0.0, 0.06]), np.zeros(3)), 0.02, 0.1, rng)
    mount = camera_mount("rgb_1", RGB, FLANGE, flange_T_link, COLOUR_CAMERA)
    rig = _rig([mount], rng)
    wrong = _Wrong(errors, lacks)
    world_T_link = rig.pose(FLANGE, wrong.edges(_HOME)) @ flange_T_link
    centre = (world_T_link @ np.array([1.5, 0.0, -0.1, 1.0]))[:3]
    border = pattern_from_config("", charuco()).border
    board = held_before(world_T_link[:3, 3], centre, border, rng, tilt_rad=0.3)
    return _simulated("camera_on_arm", rig, board, "world", wrong, rng, chosen)


def board_on_arm(
    seed: int = 0,
    *,
    errors: Errors,
    lacks: Lacks = {},  # noqa: B006 (never changed)
    **options: Any,
) -> SyntheticDataset:
    """Simulate a board on the flange of an arm before a camera that stands still.

    Open by nature: the bias of the first joint, which the camera's pose imitates, and that of
    the last, which the board's does. Arguments as in ``camera_on_arm``.
    """
    rng, chosen = np.random.default_rng([seed, 301]), SceneOptions(seed=seed, **options)
    structure_T_link = se3.transform(np.eye(3), np.zeros(3))
    mount = camera_mount("rgb_1", RGB, "post", structure_T_link, COLOUR_CAMERA)
    rig = _rig([mount], rng)
    wrong = _Wrong(errors, lacks)
    world_T_flange = rig.pose(FLANGE, wrong.edges(_HOME))
    eye = world_T_flange[:3, 3] + world_T_flange[:3, :3] @ np.array([1.8, 0.2, 0.3])
    post = looking_at(eye, world_T_flange[:3, 3], 0.1)
    rig = replace(rig, transforms={**rig.transforms, Edge("world", "post"): post})
    border = pattern_from_config("", charuco()).border
    world_T_board = held_before(eye, world_T_flange[:3, 3], border, rng, tilt_rad=0.2)
    flange_T_board = se3.inverse(world_T_flange) @ world_T_board
    return _simulated("board_on_arm", rig, flange_T_board, FLANGE, wrong, rng, chosen)


def _rig(mounts: List[Any], rng: np.random.Generator) -> Rig:
    structure = {Edge("world", _BASE): jittered(np.eye(4), 0.2, 0.2, rng)}
    structure[Edge("world", _BASE)][2, 3] += 0.8
    structure[Edge("world", "post")] = np.eye(4)
    return assemble("world", structure, mounts, room=_ROOM)


def _states(positions: Any) -> Dict[str, JointState]:
    """Return the joints as described, at some positions (7,), by name."""
    states, parent = {}, _BASE
    for joint, position in zip(_JOINTS, positions):
        values = (*joint.xyz, *joint.rpy)
        names = ("x", "y", "z", "roll", "pitch", "yaw")
        described = {f"origin_{name}": value for name, value in zip(names, values)}
        states[joint.name] = JointState(
            Edge(parent, joint.child), joint.type, np.array(joint.axis), position, described
        )
        parent = joint.child
    return states


def _edges(states: Mapping[str, JointState]) -> Dict[Edge, np.ndarray]:
    return {state.edge: state.parent_T_child for state in states.values()}


def _simulated(
    name: str,
    rig: Rig,
    parent_T_board: np.ndarray,
    board_parent: str,
    wrong: _Wrong,
    rng: np.random.Generator,
    options: SceneOptions,
) -> SyntheticDataset:
    pattern = charuco(parent_link=board_parent, fixed=True)
    positions = _positions_in_view(rig, parent_T_board, board_parent, wrong, rng, options)
    exact = make_dataset(
        rig,
        {"pattern_1": [parent_T_board] * options.collections},
        options.noise,
        rng,
        patterns={"pattern_1": pattern},
        motion=[wrong.edges(q) for q in positions],
        sampling=options.sampling,
        name=name,
        planted=planted_in(rig, ["pattern_1"], options.realism, [options.seed, _ERRORS]),
    )
    dataset = exact.dataset
    joints = {joint: JointConfig(tuple(e)) for joint, e in wrong.errors.items() if e}
    collections = {
        key: replace(
            collection,
            joints=_states(q),
            transforms={**collection.transforms, **_edges(_states(q))},
        )
        for (key, collection), q in zip(dataset.collections.items(), positions)
    }
    config = replace(dataset.config, joints=joints)
    described = replace(dataset, config=config, collections=collections)
    return disturbed(replace(exact, dataset=described), options.disturbance, rng)


def _positions_in_view(
    rig: Rig,
    parent_T_board: np.ndarray,
    board_parent: str,
    wrong: _Wrong,
    rng: np.random.Generator,
    options: SceneOptions,
) -> List[np.ndarray]:
    """Return positions (7,) at which the camera sees most of the board."""
    pattern, sensor = pattern_from_config("", charuco()), rig.sensors["rgb_1"]
    found: List[np.ndarray] = []
    for _ in range(_TRIES):
        q = np.array(_HOME) + rng.uniform(-1.0, 1.0, len(_HOME)) * _SPREAD
        moving = wrong.edges(q)
        world_T_board = rig.pose(board_parent, moving) @ parent_T_board
        camera_T_board = se3.inverse(rig.pose(sensor.frame, moving)) @ world_T_board
        seen = visible_corners(camera_of(sensor), camera_T_board, pattern)
        if len(seen) > _CORNERS_SEEN * pattern.corner_count:
            found.append(q)
        if len(found) == options.collections:
            return found
    raise ValueError("the camera hardly ever sees the board")
