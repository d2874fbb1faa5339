"""A rig: sensors hanging on a structure inside a room, at their true poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.sensor import LIDAR3D, Sensor
from atom_core.model.transforms import Edge, FrameGraph, chain_transform
from atom_core.synthetic.lidar_models import AnyLidarModel
from atom_core.synthetic.lidar_models import LidarModel as LidarModel

OPTICAL_RPY = (-np.pi / 2, 0.0, -np.pi / 2)
LIDAR_HEIGHT_M = 0.0377  # a VLP-16's optical centre above its base
Point = Union[Sequence[float], np.ndarray]


@dataclass(frozen=True)
class Room:
    """Walls, floor and ceiling: an axis-aligned box in the world frame [m]."""

    low: Tuple[float, float, float] = (-4.0, -4.0, 0.0)
    high: Tuple[float, float, float] = (4.0, 4.0, 3.2)

    def distance(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return t (n,) with ``origin + t * direction`` on the box, seen from inside.

        Args:
            origin: (3,) in world [m].
            directions: (n, 3) in world; t is a length when they have unit length.
        """
        nearest = np.full(len(directions), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for axis, along in enumerate(directions.T):
                wall = np.where(along > 0, self.high[axis], self.low[axis])
                t = (wall - origin[axis]) / along
                nearest = np.where(t > 0, np.minimum(nearest, t), nearest)
        return nearest


class Mount(NamedTuple):
    """A sensor with the true edges from its beam to its data frame."""

    sensor: Sensor
    edges: Mapping[Edge, np.ndarray]
    lidar: Any = None


@dataclass(frozen=True)
class Rig:
    """All sensors at their true poses.

    Attributes:
        world: the root frame.
        sensors: by name, in order.
        transforms: true ``parent_T_child`` (4, 4) of every static edge.
        lidars: beams of the LiDARs by name, as their modality describes them (`LidarModel`).
        anchored: the sensor that is held still, or None.
        room: what the range sensors see behind the boards.
        centre: (3,) middle of the working volume in world [m].
    """

    world: str
    sensors: Mapping[str, Sensor]
    transforms: Mapping[Edge, np.ndarray]
    lidars: Mapping[str, Any] = field(default_factory=dict)
    anchored: Optional[str] = None
    room: Room = field(default_factory=Room)
    centre: Tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def calibrated_edges(self) -> List[Edge]:
        """The calibrated edges, each one once, in the order of the sensors."""
        return list(dict.fromkeys(sensor.edge for sensor in self.sensors.values()))

    @property
    def free_edges(self) -> List[Edge]:
        """The calibrated edges without the anchored sensor's."""
        held = None if self.anchored is None else self.sensors[self.anchored].edge
        return [edge for edge in self.calibrated_edges if edge != held]

    def pose(self, frame: str, moving: Optional[Mapping[Edge, np.ndarray]] = None) -> np.ndarray:
        """Return ``world_T_frame`` (4, 4); ``moving`` holds the edges of one collection."""
        transforms = {**self.transforms, **(moving or {})}
        return chain_transform(FrameGraph(transforms).chain(self.world, frame), transforms)


def assemble(
    world: str,
    structure: Mapping[Edge, np.ndarray],
    mounts: Iterable[Mount],
    *,
    anchored: Optional[str] = None,
    room: Room = Room(),
    centre: Tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> Rig:
    """Return the rig of a structure's edges and the sensors mounted on it (see ``Rig``)."""
    transforms: Dict[Edge, np.ndarray] = dict(structure)
    sensors, lidars = {}, {}
    for mount in mounts:
        transforms.update(mount.edges)
        sensors[mount.sensor.name] = mount.sensor
        if mount.lidar is not None:
            lidars[mount.sensor.name] = mount.lidar
    return Rig(world, sensors, transforms, lidars, anchored, room, centre)


def camera_mount(
    name: str,
    modality: str,
    beam: str,
    beam_T_link: np.ndarray,
    camera: Camera,
    lens_y_m: float = -0.045,
) -> Mount:
    """Return a camera: beam -> link (calibrated) -> frame -> optical frame."""
    link, frame, optical = f"{name}_link", f"{name}_frame", f"{name}_optical_frame"
    edge = Edge(beam, link)
    edges = {
        edge: beam_T_link,
        Edge(link, frame): se3.transform(np.eye(3), np.array([0.0, lens_y_m, 0.0])),
        Edge(frame, optical): se3.from_rpy(np.zeros(3), np.array(OPTICAL_RPY)),
    }
    return Mount(Sensor(name, modality, optical, edge, camera, f"/{name}/image_raw"), edges)


def lidar_mount(
    name: str, beam: str, beam_T_base: np.ndarray, model: Optional[AnyLidarModel] = None
) -> Mount:
    """Return a LiDAR: beam -> base link (calibrated) -> data frame."""
    edge = Edge(beam, f"{name}_base_link")
    edges = {
        edge: beam_T_base,
        Edge(edge.child, name): se3.transform(np.eye(3), np.array([0.0, 0.0, LIDAR_HEIGHT_M])),
    }
    sensor = Sensor(name, LIDAR3D, name, edge, topic=f"/{name}/points")
    return Mount(sensor, edges, model or LidarModel())


def looking_at(eye: Point, target: Point, roll_rad: float = 0.0) -> np.ndarray:
    """Return ``world_T_link`` (4, 4) of a body at ``eye`` whose x axis points to ``target``."""
    x = np.asarray(target, dtype=float) - np.asarray(eye, dtype=float)
    x /= np.linalg.norm(x)
    y = np.cross([0.0, 0.0, 1.0], x)
    if np.linalg.norm(y) < 1e-6:
        y = np.array([0.0, 1.0, 0.0])
    y /= np.linalg.norm(y)
    rotation = np.column_stack([x, y, np.cross(x, y)])
    turned = rotation @ se3.rotation_from_rpy(np.array([roll_rad, 0.0, 0.0]))
    return se3.transform(turned, np.asarray(eye, dtype=float))


def jittered(
    a_T_b: np.ndarray, metres: float, radians: float, rng: np.random.Generator
) -> np.ndarray:
    """Return a pose moved at random, Gaussian with the given deviations for each axis."""
    rotation = se3.rotation_from_rotation_vector(radians * rng.standard_normal(3))
    moved = se3.transform(a_T_b[:3, :3] @ rotation, a_T_b[:3, 3])
    moved[:3, 3] += metres * rng.standard_normal(3)
    return moved


def pinhole(
    width: int,
    height: int,
    focal_px: float,
    D: Sequence[float] = (0.0, 0.0, 0.0, 0.0, 0.0),
    model: str = "plumb_bob",
) -> Camera:
    """Return a camera with its principal point in the middle of the image."""
    K = np.array(
        [
            [focal_px, 0.0, (width - 1) / 2],
            [0.0, focal_px, (height - 1) / 2],
            [0.0, 0.0, 1.0],
        ]
    )
    return Camera(width, height, K, np.array(D, dtype=float), model)


def camera_of(sensor: Sensor) -> Camera:
    """Return the intrinsics of a sensor that must have them."""
    assert sensor.camera is not None, f"{sensor.name} is no camera"
    return sensor.camera


COLOUR_CAMERA = pinhole(1280, 800, 900.0, (-0.05, 0.01, 0.0005, -0.0005, 0.0))
DEPTH_CAMERA = pinhole(640, 480, 320.0 / np.tan(np.radians(30.0)))
