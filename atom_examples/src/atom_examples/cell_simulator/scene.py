"""The world of the simulator: a robot's visuals, a room, the board on its tripod, a person."""

from __future__ import annotations

from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import CHARUCO, Pattern
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import FrameGraph, chain_transform
from atom_core.synthetic.board_image import printed
from atom_core.synthetic.rig import Room
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.graphics import Renderer, import_mujoco
from atom_examples.cell_simulator.visuals import BOX, CYLINDER, MESH, SPHERE, Visual

# Groups of shapes. The plate is a textured mesh for pictures and an exact box for rays.
_STILL, _ARM, _MOVING, _HOUSINGS, _PRINT, _PLATE = range(6)
_FOR_PICTURES = (_STILL, _ARM, _MOVING, _HOUSINGS, _PRINT)
_FOR_RAYS = (_STILL, _ARM, _MOVING, _PLATE)

_INK = 0.1  # of the light is reflected by black print
_TEXTURE_PX = 56  # of a square; a marker of 45/60 then has 6 pixels for each of its 7 cells
_NEAR_M, _FAR_M = 0.1, 40.0
PERSON_M = (0.45, 0.28, 1.72)  # a box
_GREYS = {"wall": (0.80, 0.81, 0.80, 1.0), "floor": (0.52, 0.52, 0.51, 1.0)}
# Around the cell: middle, lengths [m], colour. Desk with screen, shelf with boxes, cabinet.
_FURNITURE = (
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


class View(NamedTuple):
    """A pinhole of the scene: where it is and what it sees; K without distortion."""

    name: str
    frame: str
    camera: Camera


class Person(NamedTuple):
    """Where the person stands: x, y [m] and heading [rad] in the world."""

    x: float
    y: float
    heading: float


class Hits(NamedTuple):
    """What rays meet: distances (n,) [m], infinite where nothing, and ids of shapes (n,)."""

    distance: np.ndarray
    shape: np.ndarray
    normal: np.ndarray


class Scene:
    """The world, its moving parts, and rays and pictures of it.

    Attributes:
        plate: id of the board's plate among the shapes that rays meet.
    """

    def __init__(
        self,
        robot: RobotDescription,
        visuals: Sequence[Visual],
        positions: Mapping[str, float],
        housings: Set[str],
        board: Board,
        views: Sequence[View],
        room: Room,
        supersampling: int,
    ):
        """Build the world.

        Args:
            robot: the true description.
            visuals: of its links.
            positions: of its joints by name.
            housings: links of the sensors' bodies; range sensors do not see them.
            board: the calibration pattern.
            views: cameras to draw for.
            room: walls around.
            supersampling: how much finer pictures are drawn.
        """
        self._mujoco = mujoco = import_mujoco()
        self.robot, self.board, self._views = robot, board, {v.name: v for v in views}
        self._frames = FrameGraph(joint.edge for joint in robot.joints.values())
        self._transforms = robot.transforms(positions)
        spec = mujoco.MjSpec()
        _Builder(mujoco, spec).build(self, visuals, housings, board, views, room)
        largest = [
            supersampling * max([1, *(getattr(v.camera, n) for v in views)])
            for n in ("width", "height")
        ]
        spec.visual.global_.offwidth, spec.visual.global_.offheight = largest
        try:
            self.model = spec.compile()
        except ValueError as error:
            raise SimulatorError(f"MuJoCo cannot build the scene: {error}") from None
        self.data = mujoco.MjData(self.model)
        self._largest = dict(zip(("width", "height"), largest))
        self._supersampling = supersampling
        self._renderer: Optional[Renderer] = None
        self.plate = self.model.geom("plate").id
        self.albedo = self.model.geom_rgba[:, :3].mean(axis=1)
        self._print = _print(board)
        self._moving = np.flatnonzero(np.isin(self.model.geom_group, (_MOVING, _PLATE)))
        self._stand = sorted({visual.link for visual in board.visuals})
        self.place_board(se3.from_rpy(np.array([0.0, 0.0, 1.0]), np.array([np.pi / 2, 0, 0])))
        self.place_person(Person(1.0, 0.0, 0.0))

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

    def place_board(self, world_T_pattern: np.ndarray) -> None:
        """Put the board, and the tripod upright under it, its feet on the floor."""
        robot, root = self.board.robot, self.board.pattern.frame
        transforms = robot.transforms(_tripod_joints(robot, root, world_T_pattern))
        frames = FrameGraph(transforms)
        for link in self._stand:
            chain = frames.chain(root, link)
            self._move(link, world_T_pattern @ chain_transform(chain, transforms))
        self.world_T_pattern = world_T_pattern
        self._update()

    def place_person(self, person: Person) -> None:
        """Put the person."""
        rotation = se3.rotation_from_rpy(np.array([0.0, 0.0, person.heading]))
        self._move("person", se3.transform(rotation, np.array([person.x, person.y, 0.0])))
        self._update()

    def _move(self, body: str, world_T_body: np.ndarray) -> None:
        number = self.model.body(body).mocapid[0]
        self.data.mocap_pos[number] = world_T_body[:3, 3]
        self.data.mocap_quat[number] = _wxyz(world_T_body[:3, :3])

    def _update(self) -> None:
        self._mujoco.mj_kinematics(self.model, self.data)
        self._mujoco.mj_camlight(self.model, self.data)

    def moving_balls(self) -> List[Tuple[np.ndarray, float]]:
        """Return balls, centre (3,) in the world and radius [m], around each moving shape."""
        return [
            (self.data.geom_xpos[number].copy(), float(self.model.geom_rbound[number]))
            for number in self._moving
        ]

    def printed_albedo(self, points: np.ndarray) -> np.ndarray:
        """Return how white (0 to 1) the plate is at points (n, 3) of the world on it."""
        in_pattern = se3.apply(se3.inverse(self.world_T_pattern), points)
        column, row = np.floor(in_pattern[:, :2].T * self._print.scale + self._print.margin).astype(
            int
        )
        height, width = self._print.texture.shape
        texel = self._print.texture[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        front = in_pattern[:, 2] < self.board.thickness_m / 2
        return np.where(front, _INK + (1.0 - _INK) * texel / 255.0, 1.0)

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
        wanted = [g for g in _FOR_RAYS if (still if g in (_STILL, _ARM) else moving)]
        groups = np.zeros(6, dtype=np.uint8)
        groups[wanted] = 1
        count = len(directions)
        shape, distance = np.empty(count, dtype=np.int32), np.empty(count)
        normal = np.empty(3 * count)
        rays = np.ascontiguousarray(directions, dtype=float).ravel()
        self._mujoco.mj_multiRay(
            self.model,
            self.data,
            np.asarray(origin, dtype=float),
            rays,
            groups,
            1,
            -1,
            shape,
            distance,
            normal,
            count,
            1e3,
        )
        distance[shape < 0] = np.inf
        return Hits(distance, shape, normal.reshape(-1, 3))

    # ---- pictures

    def colours(self, view: str) -> np.ndarray:
        """Draw a view, finer by the supersampling: red green blue, bottom row first."""
        return self._render().colours(*self._arguments(view, self._supersampling))

    def depths(self, view: str) -> np.ndarray:
        """Return the z-depths of a view's pixels [m], bottom row first."""
        return self._render().depths(*self._arguments(view, 1))

    def _arguments(self, view: str, finer: int):
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


class _Builder:
    """Fills a specification of MuJoCo's."""

    def __init__(self, mujoco, spec):
        self.mujoco, self.spec = mujoco, spec
        self.meshes: Dict[Tuple[str, Tuple[float, ...]], str] = {}

    def build(
        self,
        scene: Scene,
        visuals: Sequence[Visual],
        housings: Set[str],
        board: Board,
        views: Sequence[View],
        room: Room,
    ) -> None:
        """Add everything."""
        self._settings()
        self._room(room)
        for middle, size, rgba in _FURNITURE:
            place = se3.transform(np.eye(3), np.array(middle))
            self._box(self.spec.worldbody, np.array(size), place, rgba, _STILL)
        for visual in visuals:
            group = _HOUSINGS if visual.link in housings else _STILL
            if any(j.type != FIXED for j in _joints_above(scene.robot, visual.link)):
                group = _ARM
            world_T_visual = scene.pose(visual.link) @ visual.link_T_visual
            self._shape(self.spec.worldbody, visual, world_T_visual, group)
        self._board(board)
        self._person()
        for view in views:
            self._view(view, scene.pose(view.frame))

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
                    _STILL,
                )

    def _board(self, board: Board) -> None:
        bodies = {}
        for visual in board.visuals:
            if visual.link not in bodies:
                bodies[visual.link] = self.spec.worldbody.add_body(name=visual.link, mocap=True)
            if visual.link != board.pattern.frame:  # the tripod
                self._shape(bodies[visual.link], visual, visual.link_T_visual, _MOVING)
        plate = bodies[board.pattern.frame]
        self._printed_plate(plate, board)
        border, thickness = board.pattern.border, board.thickness_m
        middle = np.array([*border.centre, thickness / 2])
        size = np.array([*(2 * border.half_size), thickness])
        white = (1.0, 1.0, 1.0, 1.0)
        self._box(plate, size, se3.transform(np.eye(3), middle), white, _PLATE, name="plate")

    def _printed_plate(self, body, board: Board) -> None:
        mujoco, spec = self.mujoco, self.spec
        vertices, coordinates, faces = _plate_mesh(board)
        mesh = spec.add_mesh(
            name="plate_with_print",
            uservert=vertices.ravel().tolist(),
            usertexcoord=coordinates.ravel().tolist(),
            userface=faces.ravel().tolist(),
        )
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        texture = _print(board).texture
        image = spec.add_texture(
            name="print",
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            height=texture.shape[0],
            width=texture.shape[1],
            nchannel=3,
        )
        image.data = np.repeat(texture[..., None], 3, axis=2).tobytes()
        material = spec.add_material(name="print", specular=0.0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "print"
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh.name,
            material="print",
            contype=0,
            conaffinity=0,
            group=_PRINT,
        )

    def _person(self) -> None:
        body = self.spec.worldbody.add_body(name="person", mocap=True)
        middle = se3.transform(np.eye(3), np.array([0.0, 0.0, PERSON_M[2] / 2]))
        self._box(body, np.array(PERSON_M), middle, _PERSON_RGBA, _MOVING, name="person")

    def _view(self, view: View, world_T_optical: np.ndarray) -> None:
        camera = view.camera
        (fx, fy), (cx, cy) = camera.focal_px, camera.centre_px
        width, height = camera.width, camera.height
        # An optical frame looks along z with y down, a camera of OpenGL along -z with y up; its
        # pixels are counted from the corner of the first one, ours from the middle.
        turned = world_T_optical[:3, :3] @ np.diag([1.0, -1.0, -1.0])
        self.spec.worldbody.add_camera(
            name=view.name,
            pos=world_T_optical[:3, 3],
            quat=_wxyz(turned),
            resolution=[width, height],
            sensor_size=[width * 1e-5, height * 1e-5],
            focal_pixel=[fx, fy],
            principal_pixel=[width / 2 - (cx + 0.5), height / 2 - (cy + 0.5)],
        )

    # ---- shapes

    def _shape(self, body, visual: Visual, body_T_visual: np.ndarray, group: int) -> None:
        kinds = self.mujoco.mjtGeom
        if visual.shape == BOX:
            self._box(body, np.array(visual.size), body_T_visual, visual.rgba, group)
            return
        more = {}
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

    def _box(self, body, size: np.ndarray, body_T_box, rgba, group: int, **more) -> None:
        self._add(body, self.mujoco.mjtGeom.mjGEOM_BOX, size / 2, body_T_box, rgba, group, **more)

    def _add(self, body, kind, size, body_T_shape: np.ndarray, rgba, group: int, **more) -> None:
        body.add_geom(
            type=kind,
            size=size,
            pos=body_T_shape[:3, 3],
            quat=_wxyz(body_T_shape[:3, :3]),
            rgba=rgba,
            group=group,
            contype=0,
            conaffinity=0,
            **more,
        )


class _Print(NamedTuple):
    """The print with a white margin; pixel = metres * scale + margin."""

    texture: np.ndarray
    scale: float
    margin: np.ndarray


def _print(board: Board) -> _Print:
    pattern = board.pattern
    scale = _TEXTURE_PX / pattern.square_m
    start = 0.0 if pattern.kind == CHARUCO else -pattern.square_m
    squares = np.array([pattern.columns + 1, pattern.rows + 1]) * pattern.square_m
    margin = int(np.ceil(scale * np.max(pattern.border.half_size - squares / 2))) + 2
    texture = np.pad(printed(pattern, board.config, _TEXTURE_PX), margin, constant_values=255)
    return _Print(texture, scale, np.array([[margin - start * scale]]))


def _plate_mesh(board: Board) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, texture coordinates and faces of the plate.

    The print is on the side of negative z, at z = 0; the other sides are white.
    """
    texture, scale, margin = _print(board)
    corners = board.pattern.border.corners
    front = np.column_stack([corners, np.zeros(4)])
    back = front + [0.0, 0.0, board.thickness_m]
    on_print = (corners * scale + margin) / texture.shape[::-1]
    white = np.full((4, 2), 0.5 / max(texture.shape))
    faces = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]]
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
        faces += [[8 + i, 8 + j, 12 + j], [8 + i, 12 + j, 12 + i]]
    vertices = np.vstack([front, back, front, back])
    return vertices, np.vstack([on_print, white, white, white]), np.array(faces)


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


def _joints_above(robot: RobotDescription, link: str):
    joint = robot.joint_above(link)
    while joint is not None:
        yield joint
        joint = robot.joint_above(joint.parent_link)


def _wxyz(rotation: np.ndarray) -> np.ndarray:
    x, y, z, w = se3.quaternion_from_rotation(rotation)
    return np.array([w, x, y, z])
