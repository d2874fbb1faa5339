"""Clouds without scan layers, with truth: rosettes, strewn beams, ToF cameras, merged clouds."""

from typing import NamedTuple

import numpy as np
from lidar_scenes import BORDER, Box, Cloud, Scene, board_facing, person, pose, scan

from atom_core.geometry import se3
from atom_core.synthetic.lidar_models import LidarModel
from atom_core.synthetic.rig import Room

EYE = (0.0, 0.0, 1.2)


class Beams(NamedTuple):
    """Beams in the sensor's frame (n, 3), x ahead; what ``scan`` asks of a model."""

    directions: np.ndarray
    azimuth_steps: int = 1


def _ahead(azimuth, elevation):
    return np.column_stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )


def rosette(count=30_000, field_deg=38.4):
    """Two prisms that turn against each other, 100,000 points a second."""
    time = np.arange(count) / 1e5
    first, second = 2 * np.pi * 7294 / 60 * time, -2 * np.pi * 4664 / 60 * time
    reach = np.radians(field_deg) / 4.0
    azimuth = reach * (np.cos(first) + np.cos(second))
    return Beams(_ahead(azimuth, reach * (np.sin(first) + np.sin(second))))


def strewn(count=30_000, seed=0):
    """Beams at random, 100 x 60 degrees."""
    rng = np.random.default_rng(seed)
    half = np.sin(np.radians(30.0))
    return Beams(
        _ahead(
            np.radians(rng.uniform(-50.0, 50.0, count)), np.arcsin(rng.uniform(-half, half, count))
        )
    )


def tof(width=240, height=180, field_deg=62.0):
    """The pixels of a ToF camera."""
    reach = np.tan(np.radians(field_deg) / 2.0)
    y, z = np.meshgrid(
        np.linspace(-reach, reach, width), np.linspace(-reach, reach, width)[:height]
    )
    z = z - z.mean()
    rays = np.column_stack([np.ones(y.size), y.ravel(), z.ravel()])
    return Beams(rays / np.linalg.norm(rays, axis=1)[:, None])


def room_about(rng):
    return Room(
        (-4.0, -rng.uniform(2.5, 5.0), 0.0), (rng.uniform(5.5, 8.0), rng.uniform(2.5, 5.0), 3.0)
    )


def things_about(rng, distance, side=1.0):
    """Return a person beside the board, a box, and a table."""
    y = side * rng.uniform(0.8, 1.1)
    x = distance + rng.uniform(-0.3, 0.5)
    return [
        *person(x, y),
        Box((x + 0.3, -y - 0.6, 0.0), (x + 0.7, -y - 0.1, rng.uniform(0.5, 1.6))),
        Box((x - 0.2, -y - 0.5, 0.7), (x + 0.5, -y, 0.75)),
    ]


def scene_with(rng, model, distance, incidence_deg, wall_behind=None, clutter=True, board=True):
    """Return a scene: a board so far ahead, turned so far off, in any roll."""
    off = rng.uniform(-0.05, 0.05, 2) * distance
    centre = np.array([distance, off[0], EYE[2] + off[1]])
    direction = rng.uniform(0.0, 2.0 * np.pi)
    turn, tilt = incidence_deg * np.cos(direction), incidence_deg * np.sin(direction)
    world_T_board = board_facing(EYE, centre, rng.uniform(0.0, 180.0), turn, tilt)
    room = room_about(rng)
    if wall_behind is not None:
        farthest = (world_T_board @ _corners())[0].max()
        room = Room(room.low, (farthest + wall_behind, room.high[1], 3.0))
    things = things_about(rng, distance, rng.choice([-1.0, 1.0])) if clutter else []
    return Scene(pose(EYE), world_T_board if board else None, things, room, model)


def _corners():
    low, high = BORDER.centre - BORDER.half_size, BORDER.centre + BORDER.half_size
    x, y = (
        np.array([low[0], high[0], high[0], low[0]]),
        np.array([low[1], low[1], high[1], high[1]]),
    )
    return np.stack([x, y, np.zeros(4), np.ones(4)])


def cloud_of(scene, seed=0, noise_m=0.008, dropout=0.02, shuffled=True):
    """Scan a scene; the points in any order."""
    cloud = scan(scene, seed, noise_m, dropout)
    if not shuffled:
        return cloud
    order = np.random.default_rng(seed).permutation(len(cloud.points))
    return Cloud(*(values[order] for values in cloud))


def merged(scene, seed=0, voxel_m=0.03, noise_m=0.008):
    """Two spinning scanners' clouds in the frame of one, one mean point for each voxel."""
    model = LidarModel(rings=48, azimuth_steps=1200, elevation_deg=(-30.0, 30.0))
    first = scan(scene._replace(model=model), seed, noise_m)
    moved = scene.world_T_lidar @ pose((-0.2, 0.9, -0.3), (0.1, 0.05, -0.3))
    second = scan(scene._replace(model=model, world_T_lidar=moved), seed + 1, noise_m)
    first_T_second = se3.inverse(scene.world_T_lidar) @ moved
    points = np.vstack([first.points, se3.apply(first_T_second, second.points)])
    on_board = np.concatenate([first.on_board, second.on_board]).astype(float)
    mixed = np.concatenate([first.mixed, second.mixed])
    _, of = np.unique(np.floor(points / voxel_m).astype(int), axis=0, return_inverse=True)
    of = of.ravel()
    count = np.bincount(of)
    means = np.column_stack([np.bincount(of, points[:, k]) / count for k in range(3)])
    share = np.bincount(of, on_board) / count
    unclear = (np.bincount(of, mixed.astype(float)) > 0) | ((share > 0) & (share < 1))
    return Cloud(means, np.zeros(len(means)), share > 0.5, unclear)


KINDS = {
    "rosette": lambda scene, seed: cloud_of(scene._replace(model=rosette()), seed),
    "strewn": lambda scene, seed: cloud_of(scene._replace(model=strewn(seed=seed)), seed),
    "tof": lambda scene, seed: cloud_of(scene._replace(model=tof()), seed, 0.005),
    "merged": merged,
}
