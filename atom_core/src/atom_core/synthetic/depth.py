"""What a depth camera sees and labels: a depth image with the boards before the room."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, Dict, Tuple, Union

import numpy as np

from atom_core import opencv as cv2
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.synthetic.board import board_hits, border_points, facing
from atom_core.synthetic.memory import Sampling
from atom_core.synthetic.planted import DepthErrors
from atom_core.synthetic.realism import Realism
from atom_core.synthetic.rig import Rig, Room, camera_of
from atom_core.synthetic.sensing import Outlook, View

LARGEST_ANGLE_DEG = 75.0  # between the ray and the board's normal
LEAST_SHARE = 0.4  # of the board that must lie in the image
_JUMP_M, _JUMP_SHARE = 0.03, 0.02  # neighbours that differ more, by a share of z, jump
RANGE_M = (0.3, 6.5)  # z-depths; ATOM's files hold up to 6.5535 m


class DepthCamera:
    """A depth camera with the rays of its pixels and the room behind its boards, kept."""

    def __init__(self, camera: Camera, room: Room):
        """Prepare the rays of all pixels."""
        self.camera, self.room = camera, room
        intrinsics = (camera.K.tobytes(), camera.D.tobytes(), camera.model)
        self.rays = _rays(camera.width, camera.height, *intrinsics)
        self._pose = np.full((4, 4), np.nan)
        self._background = np.zeros(0)

    def background(self, world_T_camera: np.ndarray) -> np.ndarray:
        """Return the room's z-depths (height * width,) [m]."""
        if not np.array_equal(self._pose, world_T_camera):
            in_world = self.rays @ world_T_camera[:3, :3].T
            self._background = self.room.distance(world_T_camera[:3, 3], in_world)
            self._pose = world_T_camera
        return self._background

    def board(
        self, camera_T_pattern: np.ndarray, pattern: Pattern
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return the pixels (n,) that a board covers and their z-depths (n,) [m]."""
        window = self._window(camera_T_pattern, pattern)
        z, _ = board_hits(camera_T_pattern, pattern, self.rays[window])
        good = (z >= RANGE_M[0]) & (z <= RANGE_M[1])
        return window[good], z[good]

    def _window(self, camera_T_pattern: np.ndarray, pattern: Pattern) -> np.ndarray:
        """Return the pixels (n,) around a board's outline; all of them if it reaches behind."""
        outline = se3.apply(camera_T_pattern, border_points(pattern))
        width, height = self.camera.width, self.camera.height
        if np.min(outline[:, 2]) < RANGE_M[0]:
            return np.arange(width * height)
        pixels = self.camera.project(outline)
        low = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 2, 0, [width, height])
        high = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 3, 0, [width, height])
        rows, columns = np.arange(low[1], high[1]), np.arange(low[0], high[0])
        return (rows[:, None] * width + columns).ravel()


@lru_cache(maxsize=4)
def _rays(width: int, height: int, K: bytes, D: bytes, model: str) -> np.ndarray:
    """Return the rays (height * width, 3) of all pixels, z = 1; many rigs have the same camera."""
    camera = Camera(width, height, np.frombuffer(K), np.frombuffer(D), model)
    row, column = np.mgrid[0:height, 0:width]
    normalised = camera.normalise(np.column_stack([column.ravel(), row.ravel()]))
    rays = np.column_stack([normalised, np.ones(len(normalised))])
    rays.flags.writeable = False
    return rays


def is_detected(camera: Camera, camera_T_pattern: np.ndarray, pattern: Pattern) -> bool:
    """Tell whether enough of a board stands before the camera, not too slanted."""
    if abs(facing(camera_T_pattern, pattern.border)) < np.cos(np.radians(LARGEST_ANGLE_DEG)):
        return False
    steps = np.linspace(-0.95, 0.95, 9)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    on_board = pattern.border.centre + grid * pattern.border.half_size
    points = se3.apply(camera_T_pattern, np.column_stack([on_board, np.zeros(len(grid))]))
    good = camera.in_image(points) & (points[:, 2] > RANGE_M[0]) & (points[:, 2] < RANGE_M[1])
    return float(np.mean(good)) >= LEAST_SHARE


def _capture(device: DepthCamera, view: View) -> Tuple[np.ndarray, Dict[str, RangeLabel]]:
    """Return the depth image (height, width) [m], NaN where there is none, and the labels.

    Labels hold every ``depth_step``-th pixel of a board in both directions, and the board's
    outermost pixels where its border lies in the image.
    """
    camera_T_patterns, patterns = view.sensor_T_patterns, view.patterns
    noise, rng = view.noise, view.rng
    errors = view.errors if isinstance(view.errors, DepthErrors) else DepthErrors()
    shape = (device.camera.height, device.camera.width)
    z = device.background(view.world_T_sensor).copy()
    owner = np.full(z.shape, -1)
    for number, (name, camera_T_pattern) in enumerate(camera_T_patterns.items()):
        pixels, depth = device.board(camera_T_pattern, patterns[name])
        before = depth < z[pixels]
        z[pixels[before]], owner[pixels[before]] = depth[before], number
    lost = (owner >= 0) & (rng.random(len(owner)) < noise.dropout)
    error_m: Union[float, np.ndarray] = 0.0
    if errors != DepthErrors():
        halo = near_jumps(z.reshape(shape), errors.halo_px).ravel()
        owner[halo], error_m = -1, errors.error_m(z.reshape(shape)).ravel()
        lost |= halo
    labels: Dict[str, RangeLabel] = {}
    for number, (name, camera_T_pattern) in enumerate(camera_T_patterns.items()):
        if is_detected(device.camera, camera_T_pattern, patterns[name]):
            label = _label(owner.reshape(shape) == number, lost, view.sampling.depth_step)
            if label.detected:
                labels[name] = label
    if noise.depth_scale > 0:
        z += noise.depth_sigma_m(z) * rng.standard_normal(len(z))
    z += error_m
    for label in labels.values():
        labeled = np.union1d(label.indices, label.limit_indices)
        along_ray = np.linalg.norm(device.rays[labeled], axis=1)
        z[labeled] += noise.gross_range_errors(len(labeled), rng) / along_ray
    z[lost | (z < RANGE_M[0]) | (z > RANGE_M[1])] = np.nan
    return noise.round(z.reshape(shape)), labels


def near_jumps(z: np.ndarray, within_px: int) -> np.ndarray:
    """Return (height, width) bool: pixels this near to a jump of the depth, on either side.

    Args:
        z: (height, width) depths [m].
        within_px: how near; 0: none are.
    """
    if within_px == 0:
        return np.zeros(z.shape, dtype=bool)
    beside = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    jump = (cv2.dilate(z, beside) - cv2.erode(z, beside)) > _JUMP_M + _JUMP_SHARE * z
    wider = np.ones((2 * within_px - 1, 2 * within_px - 1), dtype=np.uint8)
    return cv2.dilate(jump.astype(np.uint8), wider) > 0


def outermost(mask: np.ndarray) -> np.ndarray:
    """Return (height, width) bool: pixels of the mask beside one outside it, within the image."""
    padded = np.pad(mask, 1, mode="edge")  # the image's edge is not the board's
    whole = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return mask & ~whole


def _label(mask: np.ndarray, lost: np.ndarray, grid_step: int) -> RangeLabel:
    grid = np.zeros_like(mask)
    grid[::grid_step, ::grid_step] = True
    kept = ~lost.reshape(mask.shape)
    inside = np.flatnonzero(mask & grid & kept)
    return RangeLabel(inside, np.flatnonzero(outermost(mask) & kept))


def observe(view: View) -> Dict[str, RangeLabel]:
    """Return the labels of the boards in a depth image, and keep the image or what is labeled."""
    name, sampling = view.sensor.name, view.sampling
    if name not in view.prepared:
        view.prepared[name] = DepthCamera(camera_of(view.sensor), view.rig.room)
    image, labels = _capture(view.prepared[name], view)
    if sampling.labeled_only:
        labeled = [i for label in labels.values() for i in (label.indices, label.limit_indices)]
        kept = np.unique(np.concatenate(labeled)) if labeled else np.zeros(0, dtype=int)
        view.data.add_pixels(view.collection, name, image, kept)
    else:
        view.data.add(view.collection, name, image)
    if sampling.exact_border:
        none = np.zeros(0, dtype=int)
        labels = {n: replace(label, limit_indices=none) for n, label in labels.items()}
    return labels


def outlook(_: Rig, sensor: Sensor, camera_T_pattern: np.ndarray, pattern: Pattern) -> Outlook:
    """Tell what a depth camera would make of a board."""
    camera = camera_of(sensor)
    seen = is_detected(camera, camera_T_pattern, pattern)
    return Outlook(seen, False, _rows(camera, camera_T_pattern, pattern) if seen else 0.0)


def _rows(camera: Camera, camera_T_pattern: np.ndarray, pattern: Pattern) -> float:
    """Return about how many rows a board gives: pixels of the grid inside, and of the border."""
    corners = pattern.border.corners_in_pattern
    pixels = camera.project(se3.apply(camera_T_pattern, corners))
    clipped = np.clip(pixels, 0.0, [camera.width, camera.height])
    (x, y), (next_x, next_y) = clipped.T, np.roll(clipped, -1, axis=0).T
    sides = np.hypot(next_x - x, next_y - y)
    area = abs(np.sum(x * next_y - next_x * y)) / 2
    return float(area / Sampling().depth_step ** 2 + sides.sum())


def errors(realism: Realism, sensor: Sensor, _: Any, rng: np.random.Generator) -> DepthErrors:
    """Draw the systematic errors of a camera."""
    return DepthErrors.drawn(realism, sensor, rng)
