"""The simulated cell of a seed: its true mounts, the scene, its sensors, its initial estimate."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, TypeVar, Union

import numpy as np
import yaml

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.io.paths import PackageResolver, package_folder
from atom_core.io.urdf import Description, read_description
from atom_core.model.transforms import Edge
from atom_core.synthetic.cell import cell_rig, initial_edges
from atom_core.synthetic.lidar_models import GridModel, RosetteModel
from atom_core.synthetic.planted import (
    SensorErrors,
)
from atom_core.synthetic.realism import Realism
from atom_core.synthetic.rig import Rig, camera_of, jittered, looking_at
from atom_core.synthetic.scanners import cell_with_scanners_rig
from atom_core.synthetic.sensing import planted_in
from atom_examples.cell_simulator.camera import FINER
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.gloss import gloss_in
from atom_examples.cell_simulator.mounts import Box, boxes_of, clear_of
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.scene_model import CELL_FURNITURE, Board, Surroundings
from atom_examples.cell_simulator.sensing import colour_camera, depth_camera, lidar_of, view_of
from atom_examples.cell_simulator.settings import (
    ColourSettings,
    DepthSettings,
    LidarSettings,
    ScannerSettings,
    Settings,
    read_settings,
)
from atom_examples.cell_simulator.visuals import read_visuals

PACKAGE = "collab_cell_description"
EXACT, DISTURBED = "exact", "disturbed"
PATTERN = "pattern_1"
_ERRORS, _STAMPS, _MOVING = 41, 42, 43  # streams of random numbers of one seed

_Errors = TypeVar("_Errors", bound=SensorErrors)
_DISTURBANCES = {EXACT: (0.0, 0.0), DISTURBED: (0.1, 0.1)}  # m, rad on each free edge


@dataclass(frozen=True)
class Files:
    """Where the cell is described."""

    cell: Path
    pattern: Path
    sensors: Path
    home: Path


def cell_files(resolve_package: Optional[PackageResolver] = None) -> Files:
    """Return the files of the package collab_cell_description."""
    folder = package_folder(PACKAGE, resolve_package)
    return Files(
        folder / "urdf" / "collab_cell.urdf.xacro",
        folder / "urdf" / "pattern.urdf.xacro",
        folder / "config" / "sensors.yaml",
        folder / "config" / "home.yaml",
    )


class World:
    """The cell of a seed.

    Attributes:
        seed: from which everything was drawn.
        scanners: the two 2D LiDARs are there.
        settings: of the sensors.
        rig: the true sensors, as ``atom_core.synthetic`` sees them.
        lidar: model of all 3D LiDARs; None: that of ``sensors.yaml``.
        profile: of the systematic errors, a name of ``sensors.yaml``.
        realism, planted: their sizes, and what was drawn of them.
        gloss: how brightly the board reflects lamps, as a share of white; 0: it is matt.
        home: positions of the manipulator's joints [rad].
        scene: what there is to be seen.
        colours, depths, lidars: the sensors by name; 2D LiDARs are among the last.
    """

    def __init__(
        self,
        seed: int,
        files: Optional[Files] = None,
        resolve_package: Optional[PackageResolver] = None,
        scanners: bool = False,
        profile: str = PLAIN_PROFILE,
        lidar: Optional[str] = None,
        gloss: float = 0.0,
    ):
        """Build the cell.

        Args:
            seed: decides everything.
            files: of the description; those of its package when None.
            resolve_package: finds packages.
            scanners: with the two 2D LiDARs.
            profile: of the systematic errors.
            lidar: model of `LIDAR_MODELS` that all 3D LiDARs are. One that does not look all
                around is turned to the middle of the cell.
            gloss: of the board.

        Raises:
            AtomError: a description or a setting is malformed, a link or a mesh is absent.
        """
        self.seed, self.scanners, self._resolve = seed, scanners, resolve_package
        self.lidar, self.gloss = lidar, gloss
        self._files = files or cell_files(resolve_package)
        self._descriptions: Dict[str, Description] = {}  # by the mounts: reading takes a while
        self.settings = read_settings(self._files.sensors, scanners, lidar)
        rig = cell_with_scanners_rig(seed) if scanners else cell_rig(seed)
        self.rig = _aimed(_as_set(rig, self.settings))
        self.profile, self.realism = profile, _realism(self.settings, profile, self._files)
        self.planted = planted_in(self.rig, [PATTERN], self.realism, [seed, _ERRORS])
        self.home = _joint_positions(self._files.home)
        drawn = self.description(EXACT)
        self._check_links(drawn)
        self.rig = clear_of(self.rig, self._structure(drawn))
        truth = self.description(EXACT)
        self.scene = self._scene(truth)
        self._make_sensors()

    def _make_sensors(self) -> None:
        """Set ``colours``, ``depths`` and ``lidars``."""
        planted = {s.name: self.planted.of(s.name) for s in self.settings.all}
        self.colours = {
            s.name: colour_camera(s, self._camera(s), planted[s.name])
            for s in self._all_of(ColourSettings)
        }
        self.depths = {
            s.name: depth_camera(s, self._camera(s), planted[s.name])
            for s in self._all_of(DepthSettings)
        }
        self.lidars = {
            s.name: lidar_of(s, planted[s.name])
            for s in [*self._all_of(LidarSettings), *self._all_of(ScannerSettings)]
        }

    def _all_of(self, kind: type) -> List[Any]:
        return [sensor for sensor in self.settings.all if isinstance(sensor, kind)]

    def _camera(self, settings: Union[ColourSettings, DepthSettings]) -> Camera:
        """Return the true intrinsics of a camera."""
        if settings.name not in self.rig.sensors:
            return settings.camera
        sensor = self.rig.sensors[settings.name]
        return camera_of(self.planted.of(settings.name).true_sensor(sensor))

    def stamp_error_s(self, *stream: int) -> float:
        """Return by how much a stamp is off, drawn by the seed and further integers."""
        sigma_s = self.realism.stamp_sigma_s
        if sigma_s == 0.0:
            return 0.0
        return float(sigma_s * np.random.default_rng([self.seed, _STAMPS, *stream]).normal())

    def as_told(self, moving: Mapping[Edge, np.ndarray], *stream: int) -> Dict[Edge, np.ndarray]:
        """Return moving edges as the robot tells them, off by what the seed and integers draw."""
        sigmas = (self.realism.moving_edge_sigma_m, self.realism.moving_edge_sigma_rad)
        if sigmas == (0.0, 0.0):
            return dict(moving)
        rng = np.random.default_rng([self.seed, _MOVING, *stream])
        return {edge: jittered(pose, *sigmas, rng) for edge, pose in moving.items()}

    @property
    def folder(self) -> Path:
        """The folder of the cell's description."""
        return self._files.cell.parents[1]

    def edges(self, estimate: str) -> Dict[Edge, np.ndarray]:
        """Return the calibrated edges (4, 4): the true ones, or those of the disturbed start."""
        return initial_edges(self.rig, self.seed, _DISTURBANCES[estimate])

    def description(self, estimate: str) -> Description:
        """Return the robot description with the true mounts or the disturbed ones."""
        mounts = yaml.safe_dump(self._mounts(self.edges(estimate)))
        if mounts not in self._descriptions:
            self._descriptions[mounts] = self._read(mounts)
        return self._descriptions[mounts]

    def _read(self, mounts: str) -> Description:
        with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
            file.write(mounts)
            file.flush()
            arguments = {"mounts": file.name, "scanners": str(self.scanners).lower()}
            return read_description(self._files.cell, self._resolve, arguments)

    def _mounts(self, edges: Mapping[Edge, np.ndarray]) -> Dict[str, Dict]:
        return {
            name: {
                "parent": sensor.edge.parent,
                "child": sensor.edge.child,
                "xyz": [float(v) for v in edges[sensor.edge][:3, 3]],
                "rpy": [float(v) for v in se3.rpy_from_rotation(edges[sensor.edge][:3, :3])],
            }
            for name, sensor in self.rig.sensors.items()
        }

    def _check_links(self, truth: Description) -> None:
        for sensor in self.settings.all:
            if sensor.frame not in truth.robot.links:
                raise SimulatorError(
                    f"{self._files.sensors}: sensor '{sensor.name}': the description has no link "
                    f"'{sensor.frame}'; mend its 'frame' or add the link to {self._files.cell.name}"
                )

    def _structure(self, truth: Description) -> List[Box]:
        """Return the boxes of the cell, without the sensors' own bodies."""
        bodies = {sensor.edge.child for sensor in self.rig.sensors.values()}
        visuals = [v for v in read_visuals(truth.urdf, self._resolve) if v.link not in bodies]
        return boxes_of(truth.robot, visuals, self.home)

    def _scene(self, truth: Description) -> Scene:
        settings = self.settings
        stand = read_description(self._files.pattern, self._resolve)
        made = self.planted.of_board(PATTERN)
        board = Board(
            made.true_pattern(PATTERN, settings.board),
            made.true_config(settings.board),
            stand.robot,
            read_visuals(stand.urdf, self._resolve),
        )
        views = [
            view_of(s, self._camera(s))
            for s in settings.all
            if isinstance(s, (ColourSettings, DepthSettings))
        ]
        return Scene(
            truth.robot,
            read_visuals(truth.urdf, self._resolve),
            self.home,
            {sensor.edge.child for sensor in self.rig.sensors.values()},
            [board],
            views,
            Surroundings(self.rig.room, CELL_FURNITURE, person=True),
            FINER,
            gloss=gloss_in(self.rig.room, self.gloss) if self.gloss > 0.0 else None,
        )


def _as_set(rig: Rig, settings: Settings) -> Rig:
    """Return the rig with the intrinsics, the beams and the topics of the settings."""
    unknown = set(settings.sensors) ^ set(rig.sensors)
    if unknown:
        raise SimulatorError(
            f"sensors.yaml and the cell do not have the same sensors: {', '.join(sorted(unknown))};"
            f" put what is not to be calibrated under 'other_sensors'"
        )
    sensors, lidars = {}, {}
    for name, sensor in rig.sensors.items():
        entry = settings.sensors[name]
        if isinstance(entry, (LidarSettings, ScannerSettings)):
            lidars[name] = entry.model
            sensors[name] = replace(sensor, frame=entry.frame, topic=entry.topic)
        else:
            sensors[name] = replace(
                sensor, frame=entry.frame, topic=entry.topic, camera=entry.camera
            )
    return replace(rig, sensors=sensors, lidars=lidars)


def _aimed(rig: Rig) -> Rig:
    """Return the rig with its LiDARs without layers, which see a part, turned to its middle."""
    transforms = dict(rig.transforms)
    for name, model in rig.lidars.items():
        if not isinstance(model, (RosetteModel, GridModel)):
            continue
        sensor = rig.sensors[name]
        world_T_lidar = rig.pose(sensor.frame)
        aimed = looking_at(world_T_lidar[:3, 3], rig.centre)
        base_T_lidar = se3.inverse(rig.pose(sensor.edge.child)) @ world_T_lidar
        world_T_parent = rig.pose(sensor.edge.parent)
        transforms[sensor.edge] = se3.inverse(world_T_parent) @ aimed @ se3.inverse(base_T_lidar)
    return replace(rig, transforms=transforms)


def _realism(settings: Settings, profile: str, files: Files) -> Realism:
    if profile not in settings.profiles:
        known = ", ".join(settings.profiles)
        raise SimulatorError(
            f"{files.sensors}: realism has no profile '{profile}'; use {known}, or add it"
        )
    return settings.profiles[profile]


def _joint_positions(path: Path) -> Dict[str, float]:
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        return {str(name): float(value) for name, value in document.items()}
    except (OSError, yaml.YAMLError, AttributeError, TypeError, ValueError) as error:
        raise SimulatorError(f"{path}: no positions of joints ({error}); mend it") from None
