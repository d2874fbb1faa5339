"""What is true of a recording: edges, board poses, stops, and what sensors saw of the plate."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, List

import numpy as np

from atom_core.geometry import se3
from atom_core.io.atomic import write_bytes_atomically
from atom_core.io.truth_json import write_truth
from atom_core.model.truth import Truth
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE
from atom_examples.cell_simulator.sight import is_open, sight
from atom_examples.cell_simulator.world import EXACT, PATTERN, World


class Labels:
    """Collects what truly belongs to the board, for ``OUT.labels.npz``.

    Its arrays, by stop ("000"), sensor and kind, joined by "/":

    * ``.../corner_ids`` (n,), ``.../corners_px`` (n, 2): corners that a camera sees, exact;
    * ``.../pixels`` (n,): pixels of a depth image, row by row, whose rays hit the plate;
    * ``.../stamps`` (m,) [s] and ``.../returns_0`` to ``..._m-1`` (n,): for each cloud of the
      stop, the indices of the points whose beam's centre line hits the plate; for each scan of a
      2D LiDAR likewise, of its ranges.
    """

    def __init__(self, world: World):
        """Start without labels."""
        self._world = world
        self._arrays: Dict[str, np.ndarray] = {}
        self._stamps: Dict[str, List[float]] = {}

    def add_stop(self, stop: int) -> None:
        """Add corners and depth pixels of the stop at which the scene's board stands."""
        world = self._world
        pattern, world_T_pattern = world.scene.board.pattern, world.scene.world_T_pattern
        for name, camera in world.colours.items():
            if name not in world.rig.sensors:
                continue
            line = sight(world, name, world_T_pattern, pattern)
            goals = line.goals[is_open(world, line)] if len(line.goals) else line.goals
            in_pattern = se3.apply(se3.inverse(world_T_pattern), goals)
            ids = _nearest_corners(pattern.corners_by_id, in_pattern)
            optical_T_world = se3.inverse(world.scene.pose(world.rig.sensors[name].frame))
            self._arrays[f"{stop:03d}/{name}/corner_ids"] = ids
            self._arrays[f"{stop:03d}/{name}/corners_px"] = camera.camera.project(
                se3.apply(optical_T_world, goals)
            )
        for name, depth in world.depths.items():
            self._arrays[f"{stop:03d}/{name}/pixels"] = depth.plate_pixels(world.scene)

    def add_scan(self, stop: int, name: str, stamp_s: float, on_plate: np.ndarray) -> None:
        """Add which points of a cloud, or ranges of a scan, are on the plate (n,)."""
        place = f"{stop:03d}/{name}"
        stamps = self._stamps.setdefault(place, [])
        self._arrays[f"{place}/returns_{len(stamps)}"] = on_plate.astype(np.int32)
        stamps.append(stamp_s)

    def write(self, path: Path) -> None:
        """Write the file."""
        import io

        stamps = {f"{place}/stamps": np.array(s) for place, s in self._stamps.items()}
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **self._arrays, **stamps)
        write_bytes_atomically(path, buffer.getvalue())


def write_recording_truth(
    path: Path, world: World, boards: List[np.ndarray], stops: Dict[str, Any], more: Dict[str, Any]
) -> None:
    """Write ``OUT.truth.json``, with the systematic errors of a profile that is not plain.

    Args:
        path: the file.
        world: the cell.
        boards: ``world_T_pattern`` of each stop.
        stops: beginning and end of each stop by key.
        more: how the recording was made.
    """
    truth = Truth(
        world.edges(EXACT),
        {(PATTERN, f"{stop:03d}"): pose for stop, pose in enumerate(boards)},
    )
    rough: Dict[str, Any] = {}
    if world.profile != PLAIN_PROFILE:
        rough = {"realism": {"profile": world.profile, **world.planted.document()}}
        rough["realism"]["stamp_sigma_s"] = world.realism.stamp_sigma_s
    write_truth(truth, path, {**more, **rough, "stops": stops})


def _nearest_corners(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    away = np.linalg.norm(corners[None] - points[:, None, :2], axis=2)
    return np.argmin(away, axis=1) if len(points) else np.zeros(0, dtype=int)
