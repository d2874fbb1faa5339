"""Mounts of the simulated cell that the tolerance of their place would put inside a beam."""

from __future__ import annotations

from dataclasses import replace
from typing import List, Mapping, NamedTuple, Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.model.robot import RobotDescription
from atom_core.model.transforms import FrameGraph, chain_transform
from atom_core.synthetic.rig import Rig
from atom_examples.cell_simulator.visuals import BOX, Visual

_TOUCHING_M = 5e-5  # a sensor this near to a beam's surface sees nothing but the beam
_CLEARANCE_M = 2e-3  # left between a beam and a sensor that was moved out of it


class Box(NamedTuple):
    """A box of the structure: its middle's pose (4, 4) in the world, and half its size (3,) [m]."""

    world_T_box: np.ndarray
    half_size: np.ndarray

    def way_out(self, point: np.ndarray) -> np.ndarray:
        """Return by how much a point (3,) moves out of the box, the shortest way; zero outside."""
        in_box = se3.apply(se3.inverse(self.world_T_box), point[None])[0]
        outside = np.abs(in_box) - self.half_size
        axis = int(np.argmax(outside))
        if outside[axis] > _TOUCHING_M:
            return np.zeros(3)
        side = 1.0 if in_box[axis] >= 0 else -1.0
        return self.world_T_box[:3, axis] * side * (_CLEARANCE_M - outside[axis])


def boxes_of(
    robot: RobotDescription, visuals: Sequence[Visual], positions: Mapping[str, float]
) -> List[Box]:
    """Return the boxes of a description, without those that carry no box.

    Args:
        robot: the description.
        visuals: of the links that count.
        positions: of the joints by name.
    """
    transforms = robot.transforms(positions)
    frames = FrameGraph(transforms)
    return [
        Box(
            chain_transform(frames.chain(robot.root_link, v.link), transforms) @ v.link_T_visual,
            np.array(v.size) / 2.0,
        )
        for v in visuals
        if v.shape == BOX
    ]


def clear_of(rig: Rig, boxes: Sequence[Box]) -> Rig:
    """Return the rig with sensors that are inside a box moved out of it; all others stay.

    The mounts of a seed are drawn about the drawing's, which are centimetres from the beams. Now
    and then one ends up inside, where it sees nothing, and no pose of the board would be seen by
    all sensors.
    """
    transforms = dict(rig.transforms)
    for sensor in rig.sensors.values():
        world_R_parent = rig.pose(sensor.edge.parent)[:3, :3]
        for box in boxes:
            way = box.way_out(replace(rig, transforms=transforms).pose(sensor.frame)[:3, 3])
            if np.any(way):
                moved = transforms[sensor.edge].copy()
                moved[:3, 3] += world_R_parent.T @ way
                transforms[sensor.edge] = moved
    return replace(rig, transforms=transforms)
