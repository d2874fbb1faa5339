"""Draw docs/pictures/robot_NAME.jpg: each example robot at work, and what its first camera sees."""

import sys
from pathlib import Path
from typing import Dict, Tuple

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.synthetic.rig import looking_at, pinhole
from atom_examples.cell_simulator.camera import ColourCamera
from atom_examples.cell_simulator.scene_model import View
from atom_examples.robot_simulator.robots import robot_named, robot_names
from atom_examples.robot_simulator.stops import draw_stops
from atom_examples.robot_simulator.world import RobotWorld

PICTURES = Path(__file__).parent / "pictures"
_HEIGHT = 420
_CAMERA = pinhole(630, _HEIGHT, 560.0)
_OPTICAL = se3.from_rpy(np.zeros(3), np.array([-np.pi / 2, 0.0, -np.pi / 2]))
# From where, and at what, an onlooker looks [m].
_LOOKS: Dict[str, Tuple[Tuple[float, ...], Tuple[float, ...]]] = {
    "rrbot": ((-1.6, 1.9, 2.4), (0.9, 0.0, 1.0)),
    "rlbot": ((-1.6, 1.9, 2.4), (0.9, 0.0, 1.0)),
    "rdbot": ((-1.4, 1.7, 2.3), (0.7, 0.0, 1.1)),
    "mrbot": ((0.9, 1.7, 1.6), (-1.0, 0.0, 1.0)),
    "softbot": ((-1.2, -1.6, 1.4), (0.8, 0.0, 0.3)),
    "collab_cell_at_work": ((3.2, -3.4, 2.6), (0.0, 0.0, 1.0)),
}
_ARM = ((0.9, -1.3, 2.1), (-0.9, 0.2, 1.05))


def draw(name: str) -> np.ndarray:
    """Return the robot (blue green red) from outside, and its first camera's picture."""
    eye, target = _LOOKS.get(name, _ARM)
    world_T_optical = looking_at(eye, target) @ _OPTICAL
    robot = robot_named(name)
    onlooker = View("onlooker", "world", _CAMERA, world_T_optical)
    world = RobotWorld(robot, 0, onlookers=[onlooker])
    stop = draw_stops(world, "train", 1)[0]
    world.place(stop.positions, stop.boards)
    outside = ColourCamera("onlooker", _CAMERA, 0.0).capture(world.scene)
    seen = next(d for d in world.devices if d.draws_pictures).capture(world.scene, None)
    world.scene.close()
    width = round(seen.shape[1] * _HEIGHT / seen.shape[0])
    seen = cv2.resize(seen, (width, _HEIGHT), interpolation=cv2.INTER_AREA)
    return np.hstack([outside, seen])[..., ::-1]


if __name__ == "__main__":
    for wanted in sys.argv[1:] or robot_names():
        picture = PICTURES / f"robot_{wanted}.jpg"
        cv2.imwrite(str(picture), draw(wanted), [cv2.IMWRITE_JPEG_QUALITY, 88])
