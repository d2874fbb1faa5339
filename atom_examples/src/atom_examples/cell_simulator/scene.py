"""A simulated world: a robot's visuals, what stands around, boards, perhaps a person."""

from __future__ import annotations

from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.robot import RobotDescription
from atom_core.model.transforms import FrameGraph, chain_transform
from atom_core.synthetic.board import BentPattern
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.gloss import Gloss, shining
from atom_examples.cell_simulator.graphics import Renderer, import_mujoco
from atom_examples.cell_simulator.rays import Hits, cast_rays
from atom_examples.cell_simulator.scene_model import (
    ARM,
    HOUSINGS,
    MOVING,
    PLATE,
    PLATE_NAME,
    PRINT,
    STILL,
    Board,
    ModelBuilder,
    Print,
    Surroundings,
    View,
    print_of,
    wxyz,
)
from atom_examples.cell_simulator.visuals import Visual

_FOR_PICTURES = (STILL, ARM, MOVING, HOUSINGS, PRINT)
_FOR_RAYS = (STILL, ARM, MOVING, PLATE)
_INK = 0.1  # of the light is reflected by black print


class Person(NamedTuple):
    """Where the person stands: x, y [m] and heading [rad] in the world."""

    x: float
    y: float
    heading: float


class Scene:
    """The world, its moving parts, and rays and pictures of it.

    Attributes:
        boards: all of them; ``board`` is the first.
        plates: ids (n,) of the boards' plates among the shapes that rays meet; ``plate`` likewise.
        world_T_patterns: where the boards are (4, 4); ``world_T_pattern`` likewise.
        gloss: of the boards in pictures of colours; None: they are matt.
        arrangement: how all stands; another object as soon as something has moved.
    """

    def __init__(
        self,
        robot: RobotDescription,
        visuals: Sequence[Visual],
        positions: Mapping[str, float],
        housings: Set[str],
        boards: Sequence[Board],
        views: Sequence[View],
        around: Surroundings,
        supersampling: int,
        moving: bool = False,
        gloss: Optional[Gloss] = None,
    ):
        """Build the world.

        Args:
            robot: the true description.
            visuals: of its links.
            positions: of its joints by name.
            housings: links of the sensors' bodies; range sensors do not see them.
            boards: the calibration patterns, at least one.
            views: cameras to draw for.
            around: what stands around.
            supersampling: how much finer pictures are drawn.
            moving: the joints will be moved (``place_joints``).
            gloss: of the boards.
        """
        self._mujoco = mujoco = import_mujoco()
        self.robot, self.boards, self._views = robot, tuple(boards), {v.name: v for v in views}
        self._frames = FrameGraph(joint.edge for joint in robot.joints.values())
        self._transforms, self.arrangement = robot.transforms(positions), object()
        spec = mujoco.MjSpec()
        builder = ModelBuilder(mujoco, spec, moving)
        builder.build(robot, self.pose, visuals, housings, boards, views, around)
        self._largest = {
            name: supersampling * max([1, *(getattr(v.camera, name) for v in views)])
            for name in ("width", "height")
        }
        self.model = _compiled(spec, self._largest)
        self.data = mujoco.MjData(self.model)
        self._supersampling = supersampling
        self._renderer: Optional[Renderer] = None
        self._moved, self._person, self.gloss = list(builder.moved), around.person, gloss
        self._index_shapes()
        upright = se3.from_rpy(np.array([0.0, 0.0, 1.0]), np.array([np.pi / 2, 0, 0]))
        self.world_T_patterns = [upright] * len(boards)
        for number in range(len(boards)):
            self.place_board(upright, number)
        self.place_person(Person(1.0, 0.0, 0.0))
        self.place_joints(positions)

    def _index_shapes(self) -> None:
        """Find the shapes that rays are told apart by."""
        endings = [f"_{number}" if number else "" for number in range(len(self.boards))]
        self.plates = np.array([self.model.geom(PLATE_NAME + ending).id for ending in endings])
        self.albedo = self.model.geom_rgba[:, :3].mean(axis=1)
        self._prints = [print_of(board) for board in self.boards]
        self._moving = np.flatnonzero(np.isin(self.model.geom_group, (MOVING, PLATE)))
        self._stands = [sorted({visual.link for visual in b.visuals}) for b in self.boards]

    @property
    def board(self) -> Board:
        """The first board."""
        return self.boards[0]

    @property
    def plate(self) -> int:
        """Id of the first board's plate."""
        return int(self.plates[0])

    @property
    def world_T_pattern(self) -> np.ndarray:
        """Where the first board is (4, 4)."""
        return self.world_T_patterns[0]

    # ---- poses

    def pose(self, frame: str) -> np.ndarray:
        """Return ``world_T_frame`` (4, 4).

        Raises:
            SimulatorError: the description has no such link.
        """
        if frame != self.robot.root_link and frame not in self._frames:
            raise SimulatorError(f"the description has no link '{frame}'")
        chain = self._frames.chain(self.robot.root_link, frame)
        return chain_transform(chain, self._transforms)

    def place_board(self, world_T_pattern: np.ndarray, number: int = 0) -> None:
        """Put a board, and the tripod, if it has one, upright under it, its feet on the floor."""
        board = self.boards[number]
        robot, root = board.robot, board.pattern.frame
        transforms = robot.transforms(_tripod_joints(robot, root, world_T_pattern))
        frames = FrameGraph(transforms)
        for link in self._stands[number]:
            move = np.eye(4)
            if link != root:
                move = chain_transform(frames.chain(root, link), transforms)
            self._move(link, world_T_pattern @ move)
        self.world_T_patterns[number] = world_T_pattern
        self._update()

    def place_joints(self, positions: Mapping[str, float]) -> None:
        """Move the robot's joints, by name [rad, m]; those not named stand at zero."""
        if self._moved:
            self._transforms, self.arrangement = self.robot.transforms(positions), object()
            for link in self._moved:
                self._move(f"moved/{link}", self.pose(link))
            self._update()

    def place_person(self, person: Person) -> None:
        """Put the person, if there is one."""
        if not self._person:
            return
        rotation = se3.rotation_from_rpy(np.array([0.0, 0.0, person.heading]))
        self._move("person", se3.transform(rotation, np.array([person.x, person.y, 0.0])))
        self._update()

    def _move(self, body: str, world_T_body: np.ndarray) -> None:
        number = self.model.body(body).mocapid[0]
        pose = np.concatenate([world_T_body[:3, 3], wxyz(world_T_body[:3, :3])])
        position, turn = self.data.mocap_pos[number], self.data.mocap_quat[number]
        if not np.array_equal(np.concatenate([position, turn]), pose):
            position[:], turn[:], self.arrangement = pose[:3], pose[3:], object()

    def _update(self) -> None:
        self._mujoco.mj_kinematics(self.model, self.data)
        self._mujoco.mj_camlight(self.model, self.data)

    def moving_balls(self) -> List[Tuple[np.ndarray, float]]:
        """Return balls, centre (3,) in the world and radius [m], around each moving shape."""
        return [
            (self.data.geom_xpos[number].copy(), float(self.model.geom_rbound[number]))
            for number in self._moving
        ]

    def printed_albedo(self, points: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """Return how white (0 to 1) plates are at points (n, 3) of the world on shapes (n,)."""
        albedo = np.ones(len(points))
        for number, plate in enumerate(self.plates):
            on_it = shapes == plate
            in_pattern = se3.apply(se3.inverse(self.world_T_patterns[number]), points[on_it])
            albedo[on_it] = _albedo_of(self._prints[number], self.boards[number], in_pattern)
        return albedo

    # ---- rays

    def cast(
        self, origin: np.ndarray, directions: np.ndarray, *, still: bool = True, moving: bool = True
    ) -> Hits:
        """Return what rays meet.

        Args:
            origin: (3,) in the world [m].
            directions: (n, 3) unit vectors in the world.
            still: whether walls and robot are there.
            moving: whether board, tripod and person are there.
        """
        wanted = [g for g in _FOR_RAYS if (still if g in (STILL, ARM) else moving)]
        groups = np.zeros(6, dtype=np.uint8)
        groups[wanted] = 1
        return cast_rays(self._mujoco, (self.model, self.data), origin, directions, groups)

    # ---- pictures

    def colours(self, view: str) -> np.ndarray:
        """Draw a view, finer by the supersampling: red green blue, bottom row first.

        uint8; float32 where boards shine.
        """
        drawn = self._render().colours(*self._arguments(view, self._supersampling))
        return drawn if self.gloss is None else self._shining(drawn, self.gloss, self._views[view])

    def _shining(self, drawn: np.ndarray, gloss: Gloss, view: View) -> np.ndarray:
        world_T_camera = self.pose(view.frame)
        if view.frame_T_optical is not None:
            world_T_camera = world_T_camera @ view.frame_T_optical
        for board, plate, world_T_pattern in zip(self.boards, self.plates, self.world_T_patterns):

            def meets(directions: np.ndarray, plate: int = int(plate)) -> np.ndarray:
                return self.cast(world_T_camera[:3, 3], directions).shape == plate

            where = (view.camera, world_T_camera), (board.pattern.border, world_T_pattern)
            drawn = shining(drawn, gloss, *where, meets)
        return drawn

    def depths(self, view: str) -> np.ndarray:
        """Return the z-depths of a view's pixels [m], bottom row first."""
        return self._render().depths(*self._arguments(view, 1))

    def _arguments(self, view: str, finer: int) -> Tuple[Any, int, int, int]:
        camera = self._views[view].camera
        number = self.model.camera(view).id
        return self.data, number, finer * camera.width, finer * camera.height

    def _render(self) -> Renderer:
        if self._renderer is None:
            self._renderer = Renderer(self.model, self._largest, _FOR_PICTURES)
        return self._renderer

    def close(self) -> None:
        """Free the graphics context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _compiled(spec: Any, largest: Mapping[str, int]) -> Any:
    """Return MuJoCo's model, for pictures of a size at most."""
    spec.visual.global_.offwidth = largest["width"]
    spec.visual.global_.offheight = largest["height"]
    try:
        return spec.compile()
    except ValueError as error:
        raise SimulatorError(f"MuJoCo cannot build the scene: {error}") from None


def _albedo_of(print_: Print, board: Board, in_pattern: np.ndarray) -> np.ndarray:
    """Return how white (0 to 1) a plate is at points (n, 3) on it, in the board's frame."""
    column, row = np.floor(in_pattern[:, :2].T * print_.scale + print_.margin).astype(int)
    height, width = print_.texture.shape
    texel = print_.texture[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
    away = in_pattern[:, 2]
    if isinstance(board.pattern, BentPattern):
        away = away - board.pattern.height_m(in_pattern[:, :2])
    front = away < board.thickness_m / 2
    return np.where(front, _INK + (1.0 - _INK) * texel / 255.0, 1.0)


def _tripod_joints(
    robot: RobotDescription, board: str, world_T_pattern: np.ndarray
) -> Dict[str, float]:
    """Return the joints of the tripod (see pattern.xacro) that put it upright on the floor."""
    up = world_T_pattern[2, :3]
    clamp = robot.joint_above("pattern_clamp_link")
    if clamp is None:
        return {}
    height = (world_T_pattern @ clamp.parent_T_child_at_zero)[2, 3]
    return {
        "tripod_tilt_joint": float(np.arctan2(-up[1], up[2])),
        "tripod_roll_joint": float(np.arcsin(np.clip(up[0], -1.0, 1.0))),
        "tripod_height_joint": float(-height),
    }
