"""Rays into a scene of MuJoCo, whichever version it is."""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple, Tuple

import numpy as np

_FARTHEST_M = 1e3
_STEP = 1e-4  # to the rays beside one, of which its surface's normal is taken


class Hits(NamedTuple):
    """What rays meet.

    Attributes:
        distance: (n,) [m], infinite where nothing.
        shape: (n,) ids of shapes.
        normal: (n, 3) unit normals of the surfaces, to either side.
    """

    distance: np.ndarray
    shape: np.ndarray
    normal: np.ndarray


def cast_rays(
    mujoco: ModuleType,
    scene: Tuple[Any, Any],
    origin: np.ndarray,
    directions: np.ndarray,
    groups: np.ndarray,
) -> Hits:
    """Return what rays meet.

    Args:
        mujoco: the library.
        scene: its model and data.
        origin: (3,) in the world [m].
        directions: (n, 3) unit vectors in the world.
        groups: (6,) uint8, which groups of shapes are there.
    """
    if "normal" in (mujoco.mj_multiRay.__doc__ or ""):
        return _cast(mujoco, scene, origin, directions, groups, with_normals=True)
    hits = _cast(mujoco, scene, origin, directions, groups)
    return hits._replace(normal=_normals(mujoco, scene, origin, directions, groups, hits))


def _cast(
    mujoco: ModuleType,
    scene: Tuple[Any, Any],
    origin: np.ndarray,
    directions: np.ndarray,
    groups: np.ndarray,
    with_normals: bool = False,
) -> Hits:
    count = len(directions)
    shape, distance = np.empty(count, dtype=np.int32), np.empty(count)
    normal = np.zeros(3 * count)
    rays = np.ascontiguousarray(directions, dtype=float).ravel()
    more = [normal] if with_normals else []
    start = np.asarray(origin, dtype=float)
    mujoco.mj_multiRay(
        *scene, start, rays, groups, 1, -1, shape, distance, *more, count, _FARTHEST_M
    )
    distance[shape < 0] = np.inf
    return Hits(distance, shape, normal.reshape(-1, 3))


def _normals(
    mujoco: ModuleType,
    scene: Tuple[Any, Any],
    origin: np.ndarray,
    directions: np.ndarray,
    groups: np.ndarray,
    hits: Hits,
) -> np.ndarray:
    """Return normals (n, 3) as versions before 3.4 do not tell them: by two rays beside each.

    Where these meet another shape, at an edge, the surface counts as met head on.
    """
    across = np.cross(directions, np.eye(3)[np.argmin(np.abs(directions), axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    edges, is_one = [], hits.shape >= 0
    with np.errstate(invalid="ignore"):
        points = directions * hits.distance[:, None]
        for beside in (across, np.cross(directions, across)):
            moved = directions + _STEP * beside
            moved /= np.linalg.norm(moved, axis=1, keepdims=True)
            there = _cast(mujoco, scene, origin, moved, groups)
            is_one &= there.shape == hits.shape
            edges.append(moved * there.distance[:, None] - points)
        normal = np.cross(*edges)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = normal / np.where(length > 0.0, length, 1.0)
    return np.where(is_one[:, None] & (length > 0.0), normal, -directions)
