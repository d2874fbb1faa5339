"""MuJoCo's model of a simulated world: room, furniture, robot, boards with a tripod, person."""

from __future__ import annotations

from types import ModuleType
from typing import (
    Any,
    Callable,
    Dict,
    Iterator,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
    Union,
)

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, Pattern
from atom_core.model.robot import FIXED, Joint, RobotDescription
from atom_core.synthetic.board import BentPattern
from atom_core.synthetic.board_image import printed
from atom_core.synthetic.rig import Room
from atom_examples.cell_simulator.visuals import BOX, CYLINDER, MESH, SPHERE, Visual

_Rgba = Tuple[float, ...]  # four numbers

# Groups of shapes. The plate is a textured mesh for pictures and an exact box for rays.
STILL, ARM, MOVING, HOUSINGS, PRINT, PLATE = range(6)

PLATE_NAME = "plate"
_TEXTURE_PX = 56  # of a square; a marker of 45/60 then has 6 pixels for each of its 7 cells
_STRIPS = 32  # of a bent plate; flat ones, a thousandth of the sagitta off
_NEAR_M, _FAR_M = 0.1, 40.0
PERSON_M = (0.45, 0.28, 1.72)  # a box
_GREYS = {"wall": (0.80, 0.81, 0.80, 1.0), "floor": (0.52, 0.52, 0.51, 1.0)}
# Around the cell: middle, lengths [m], colour. Desk with screen, shelf with boxes, cabinet.
CELL_FURNITURE = (
    ((3.2, -2.6, 0.72), (0.8, 1.6, 0.04), (0.62, 0.47, 0.31, 1.0)),
    ((3.2, -2.6, 0.35), (0.7, 1.5, 0.70), (0.33, 0.34, 0.36, 1.0)),
    ((3.4, -2.6, 1.05), (0.05, 0.62, 0.38), (0.10, 0.11, 0.13, 1.0)),
    ((-3.6, -2.4, 0.90), (0.5, 1.4, 0.04), (0.58, 0.60, 0.62, 1.0)),
    ((-3.6, -2.4, 1.60), (0.5, 1.4, 0.04), (0.58, 0.60, 0.62, 1.0)),
    ((-3.6, -1.7, 0.85), (0.5, 0.04, 1.70), (0.58, 0.60, 0.62, 1.0)),
    ((-3.6, -3.1, 0.85), (0.5, 0.04, 1.70), (0.58, 0.60, 0.62, 1.0)),
    ((-3.6, -2.7, 1.10), (0.36, 0.44, 0.36), (0.71, 0.56, 0.38, 1.0)),
    ((-3.6, -2.1, 1.06), (0.36, 0.50, 0.28), (0.66, 0.50, 0.33, 1.0)),
    ((-3.6, -2.5, 0.20), (0.45, 0.70, 0.40), (0.20, 0.38, 0.33, 1.0)),
    ((-0.9, -4.2, 0.90), (1.0, 0.45, 1.80), (0.56, 0.60, 0.64, 1.0)),
    ((0.9, -4.25, 0.25), (0.6, 0.40, 0.50), (0.71, 0.56, 0.38, 1.0)),
    ((1.0, -4.25, 0.65), (0.4, 0.36, 0.30), (0.66, 0.50, 0.33, 1.0)),
    ((1.9, -4.47, 1.50), (1.2, 0.04, 0.80), (0.88, 0.89, 0.88, 1.0)),
)
_PERSON_RGBA = (0.24, 0.33, 0.50, 1.0)


class Board(NamedTuple):
    """The board: pattern and print, and the description of its plate and the tripod under it."""

    pattern: Pattern
    config: PatternConfig
    robot: RobotDescription
    visuals: Sequence[Visual]

    @property
    def thickness_m(self) -> float:
        """Of the plate [m], behind the print."""
        return min(v.size[2] for v in self.visuals if v.link == self.pattern.frame)


class Surroundings(NamedTuple):
    """What stands around the robot.

    Attributes:
        room: walls, floor and ceiling.
        furniture: boxes: middle (3,), lengths (3,) [m], colour (4,).
        person: somebody stands in the room.
    """

    room: Room
    furniture: Sequence[Tuple[Tuple[float, ...], Tuple[float, ...], _Rgba]] = ()
    person: bool = False


class View(NamedTuple):
    """A pinhole of the scene: where it is and what it sees; K without distortion.

    Attributes:
        name, camera: what it is called, and its intrinsics.
        frame: its optical frame.
        frame_T_optical: (4, 4) where it is in another frame; None: it is the frame.
    """

    name: str
    frame: str
    camera: Camera
    frame_T_optical: Optional[np.ndarray] = None


class ModelBuilder:
    """Fills a specification of MuJoCo's."""

    def __init__(self, mujoco: ModuleType, spec: Any, moving: bool = False):
        """Take the specification; ``moving``: the robot's joints will move."""
        self.mujoco, self.spec, self.moving = mujoco, spec, moving
        self.meshes: Dict[Tuple[str, Tuple[float, ...]], str] = {}
        self.moved: Dict[str, Any] = {}  # bodies of links and frames that joints move

    def build(
        self,
        robot: RobotDescription,
        pose: Callable[[str], np.ndarray],
        visuals: Sequence[Visual],
        housings: Set[str],
        boards: Sequence[Board],
        views: Sequence[View],
        around: Surroundings,
    ) -> None:
        """Add everything.

        Args:
            robot: the true description.
            pose: a link to ``world_T_link`` (4, 4).
            visuals: of the robot's links.
            housings: links of the sensors' bodies.
            boards: the calibration patterns.
            views: cameras to draw for.
            around: what stands around.
        """
        self._settings()
        self._room(around.room)
        for middle, size, rgba in around.furniture:
            place = se3.transform(np.eye(3), np.array(middle))
            self._box(self.spec.worldbody, np.array(size), place, rgba, STILL)
        for visual in visuals:
            group = HOUSINGS if visual.link in housings else STILL
            if any(j.type != FIXED for j in _joints_above(robot, visual.link)):
                if self.moving:
                    kind = HOUSINGS if visual.link in housings else MOVING
                    self._shape(self._moved(visual.link), visual, visual.link_T_visual, kind)
                    continue
                group = ARM
            world_T_visual = pose(visual.link) @ visual.link_T_visual
            self._shape(self.spec.worldbody, visual, world_T_visual, group)
        for number, board in enumerate(boards):
            self._board(board, f"_{number}" if number else "")
        if around.person:
            self._person()
        for view in views:
            if self.moving and any(j.type != FIXED for j in _joints_above(robot, view.frame)):
                self._view(view, np.eye(4), self._moved(view.frame))
            else:
                self._view(view, pose(view.frame), self.spec.worldbody)

    def _moved(self, link: str) -> Any:
        """Return the body of a link that joints move."""
        if link not in self.moved:
            self.moved[link] = self.spec.worldbody.add_body(name=f"moved/{link}", mocap=True)
        return self.moved[link]

    def _settings(self) -> None:
        visual = self.spec.visual
        visual.quality.offsamples = 0  # pictures are drawn finer and averaged instead
        self.spec.stat.extent = 1.0
        visual.map.znear, visual.map.zfar = _NEAR_M, _FAR_M
        visual.headlight.ambient, visual.headlight.diffuse = [0.42] * 3, [0.10] * 3
        visual.headlight.specular = [0.0] * 3
        for x, y, strength in ((0.3, -0.5, 0.36), (-0.6, 0.2, 0.26)):
            self.spec.worldbody.add_light(
                type=self.mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
                pos=[0, 0, 4],
                dir=[x, y, -1.0],
                diffuse=[strength] * 3,
                specular=[0.0] * 3,
                castshadow=False,
            )

    def _room(self, room: Room) -> None:
        low, high = np.array(room.low), np.array(room.high)
        half, middle, thick = (high - low) / 2, (high + low) / 2, 0.05
        for axis in range(3):
            for sign, bound in ((-1.0, low[axis]), (1.0, high[axis])):
                position, size = middle.copy(), half + thick
                position[axis], size[axis] = bound + sign * thick, thick
                floor = axis == 2 and sign < 0
                self._box(
                    self.spec.worldbody,
                    2 * size,
                    se3.transform(np.eye(3), position),
                    _GREYS["floor" if floor else "wall"],
                    STILL,
                )

    def _board(self, board: Board, ending: str) -> None:
        """Add a board; the names of its shapes end with what tells it from the others."""
        bodies: Dict[str, Any] = {}
        for visual in board.visuals:
            if visual.link not in bodies:
                bodies[visual.link] = self.spec.worldbody.add_body(name=visual.link, mocap=True)
            if visual.link != board.pattern.frame:  # the tripod
                self._shape(bodies[visual.link], visual, visual.link_T_visual, MOVING)
        plate = bodies[board.pattern.frame]
        self._printed_plate(plate, board, ending)
        if isinstance(board.pattern, BentPattern):
            self._bent_plate(plate, board, ending)
            return
        border, thickness = board.pattern.border, board.thickness_m
        middle = np.array([*border.centre, thickness / 2])
        size = np.array([*(2 * border.half_size), thickness])
        white = (1.0, 1.0, 1.0, 1.0)
        place = se3.transform(np.eye(3), middle)
        self._box(plate, size, place, white, PLATE, name=PLATE_NAME + ending)

    def _bent_plate(self, body: Any, board: Board, ending: str) -> None:
        """Add what rays meet of a bent plate."""
        vertices, _, faces = plate_mesh(board)
        mesh = self.spec.add_mesh(
            name="bent_plate" + ending,
            uservert=vertices.ravel().tolist(),
            userface=faces.ravel().tolist(),
        )
        mesh.inertia = self.mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        kind, white = self.mujoco.mjtGeom.mjGEOM_MESH, (1.0, 1.0, 1.0, 1.0)
        more = {"meshname": mesh.name, "name": PLATE_NAME + ending}
        self._add(body, kind, np.zeros(3), np.eye(4), white, PLATE, **more)

    def _printed_plate(self, body: Any, board: Board, ending: str) -> None:
        mujoco, spec = self.mujoco, self.spec
        vertices, coordinates, faces = plate_mesh(board)
        mesh = spec.add_mesh(
            name="plate_with_print" + ending,
            uservert=vertices.ravel().tolist(),
            usertexcoord=coordinates.ravel().tolist(),
            userface=faces.ravel().tolist(),
        )
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        texture = print_of(board).texture
        image = spec.add_texture(
            name="print" + ending,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            height=texture.shape[0],
            width=texture.shape[1],
            nchannel=3,
        )
        image.data = np.repeat(texture[..., None], 3, axis=2).tobytes()
        material = spec.add_material(name="print" + ending, specular=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "print" + ending
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh.name,
            material="print" + ending,
            contype=0,
            conaffinity=0,
            group=PRINT,
        )

    def _person(self) -> None:
        body = self.spec.worldbody.add_body(name="person", mocap=True)
        middle = se3.transform(np.eye(3), np.array([0.0, 0.0, PERSON_M[2] / 2]))
        self._box(body, np.array(PERSON_M), middle, _PERSON_RGBA, MOVING, name="person")

    def _view(self, view: View, body_T_optical: np.ndarray, body: Any) -> None:
        if view.frame_T_optical is not None:
            body_T_optical = body_T_optical @ view.frame_T_optical
        camera = view.camera
        (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
        width, height = camera.width, camera.height
        # An optical frame looks along z with y down, a camera of OpenGL along -z with y up; its
        # pixels are counted from the corner of the first one, ours from the middle.
        turned = body_T_optical[:3, :3] @ np.diag([1.0, -1.0, -1.0])
        body.add_camera(
            name=view.name,
            pos=body_T_optical[:3, 3],
            quat=wxyz(turned),
            resolution=[width, height],
            sensor_size=[width * 1e-5, height * 1e-5],
            focal_pixel=[fx, fy],
            principal_pixel=[width / 2 - (cx + 0.5), height / 2 - (cy + 0.5)],
        )

    # ---- shapes

    def _shape(self, body: Any, visual: Visual, body_T_visual: np.ndarray, group: int) -> None:
        kinds = self.mujoco.mjtGeom
        if visual.shape == BOX:
            self._box(body, np.array(visual.size), body_T_visual, visual.rgba, group)
            return
        more: Dict[str, Any] = {}
        if visual.shape == CYLINDER:
            kind, size = kinds.mjGEOM_CYLINDER, [visual.size[0], visual.size[1] / 2, 0.0]
        elif visual.shape == SPHERE:
            kind, size = kinds.mjGEOM_SPHERE, [visual.size[0], 0.0, 0.0]
        else:
            assert visual.shape == MESH
            kind, size, more = kinds.mjGEOM_MESH, [0.0] * 3, {"meshname": self._mesh(visual)}
        self._add(body, kind, size, body_T_visual, visual.rgba, group, **more)

    def _mesh(self, visual: Visual) -> str:
        key = (str(visual.mesh), visual.size)
        if key not in self.meshes:
            self.meshes[key] = f"mesh_{len(self.meshes)}"
            mesh = self.spec.add_mesh(name=self.meshes[key], file=key[0], scale=visual.size)
            mesh.inertia = self.mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return self.meshes[key]

    def _box(
        self,
        body: Any,
        size: np.ndarray,
        body_T_box: np.ndarray,
        rgba: _Rgba,
        group: int,
        **more: Any,
    ) -> None:
        self._add(body, self.mujoco.mjtGeom.mjGEOM_BOX, size / 2, body_T_box, rgba, group, **more)

    def _add(
        self,
        body: Any,
        kind: Any,
        size: Union[Sequence[float], np.ndarray],
        body_T_shape: np.ndarray,
        rgba: _Rgba,
        group: int,
        **more: Any,
    ) -> None:
        body.add_geom(
            type=kind,
            size=size,
            pos=body_T_shape[:3, 3],
            quat=wxyz(body_T_shape[:3, :3]),
            rgba=rgba,
            group=group,
            contype=0,
            conaffinity=0,
            **more,
        )


class Print(NamedTuple):
    """The print with a white margin; pixel = metres * scale + margin."""

    texture: np.ndarray
    scale: float
    margin: np.ndarray


def print_of(board: Board) -> Print:
    """Return what is printed on a board."""
    pattern = board.pattern
    scale = _TEXTURE_PX / pattern.square_m
    start = 0.0 if pattern.kind == CHARUCO else -pattern.square_m
    squares = np.array([pattern.columns + 1, pattern.rows + 1]) * pattern.square_m
    outside = np.abs(pattern.border.centre - (start + squares / 2))  # 0 where it is in the middle
    beyond = pattern.border.half_size - squares / 2 + outside
    margin = int(np.ceil(scale * np.max(beyond))) + 2
    texture = np.pad(printed(pattern, board.config, _TEXTURE_PX), margin, constant_values=255)
    return Print(texture, scale, np.array([[margin - start * scale]]))


def plate_mesh(board: Board) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (n, 3) [m], texture coordinates (n, 2) and faces (m, 3) of the plate.

    The print is on the side of negative z, at z = 0; the other sides are white. A bent plate is
    cut into flat strips.
    """
    texture, scale, margin = print_of(board)
    outline = _outline(board)
    count, heights = len(outline), np.zeros(len(outline))
    if isinstance(board.pattern, BentPattern):
        heights = board.pattern.height_m(outline)
    front = np.column_stack([outline, heights])
    back = front + [0.0, 0.0, board.thickness_m]
    on_print = (outline * scale + margin) / texture.shape[::-1]
    white = np.full((count, 2), 0.5 / max(texture.shape))
    faces = []
    for i in range(count // 2 - 1):  # along the upper side; below it, backwards
        a, b, c, d = i, i + 1, count - 2 - i, count - 1 - i
        faces += [[a, c, b], [a, d, c]]
        a, b, c, d = (count + corner for corner in (a, b, c, d))
        faces += [[a, b, c], [a, c, d]]
    for i in range(count):
        j = (i + 1) % count
        faces += [[2 * count + i, 2 * count + j, 3 * count + j]]
        faces += [[2 * count + i, 3 * count + j, 3 * count + i]]
    vertices = np.vstack([front, back, front, back])
    return vertices, np.vstack([on_print, white, white, white]), np.array(faces)


def _outline(board: Board) -> np.ndarray:
    """Return the plate's outline (n, 2) [m], clockwise from the top left; n is even."""
    if not isinstance(board.pattern, BentPattern):
        return board.pattern.border.corners
    border = board.pattern.border
    x = np.linspace(border.x_min, border.x_max, _STRIPS + 1)
    upper = np.column_stack([x, np.full(len(x), border.y_min)])
    lower = np.column_stack([x, np.full(len(x), border.y_max)])
    return np.vstack([upper, lower[::-1]])


def _joints_above(robot: RobotDescription, link: str) -> Iterator[Joint]:
    joint = robot.joint_above(link)
    while joint is not None:
        yield joint
        joint = robot.joint_above(joint.parent_link)


def wxyz(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion of a rotation in MuJoCo's order."""
    x, y, z, w = se3.quaternion_from_rotation(rotation)
    return np.array([w, x, y, z])
