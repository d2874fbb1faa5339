"""Directions that the data leave open, found in the covariance and named by their parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import chain_transform
from atom_core.problem.parameters import COMPONENTS, ParameterBlock, Parameters
from atom_core.solvers.covariance import Covariance

_NAMED_SHARE = 0.5  # parameters are named when they move at least this part of the largest
_MOST_REPORTED = 12
_LARGEST_SIGMA = 1e6  # what is not seen at all is reported with this (JSON has no infinity)


@dataclass(frozen=True)
class WeakDirection:
    """One direction in the space of the parameters.

    Attributes:
        parameters: the named ones move together along it, e.g. ``rgb_1 z``.
        sigma: predicted standard deviation of the one that moves most.
        unit: m or rad.
        why: one sentence.
    """

    parameters: Tuple[str, ...]
    sigma: float
    unit: str
    why: str


def edge_covariance(block: ParameterBlock, x: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the (6, 6) covariance of rotation [rad] and translation [m] in the parent's axes.

    Args:
        block: the parameter block.
        x: (6,) its numbers at the solution.
        covariance: (6, 6) of its numbers.
    """
    rotation = block.initial[:3, :3] @ se3.rotation_from_rotation_vector(x[:3])
    to_parent = np.eye(6)
    to_parent[:3, :3] = rotation @ se3.right_jacobian(x[:3])
    return to_parent @ covariance @ to_parent.T


def weak_directions(
    dataset: Dataset,
    parameters: Parameters,
    x: np.ndarray,
    covariance: Covariance,
    limit_m: float,
    limit_rad: float,
) -> List[WeakDirection]:
    """Return the undetermined directions of the shared parameters, weakest first.

    A parameter is undetermined when its predicted sigma exceeds the limit. The directions that
    make it so are the leading eigenvectors of the covariance in units of the limits.
    """
    blocks = parameters.blocks[: parameters.shared_count]
    if not blocks:
        return []
    limits = np.tile([limit_rad] * 3 + [limit_m] * 3, len(blocks))
    scaled = _in_parent_axes(blocks, x, covariance.shared) / limits[:, None] / limits
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
    left = np.diagonal(scaled).copy()
    found: List[WeakDirection] = []
    for value, vector in zip(values[::-1], vectors.T[::-1]):
        if np.max(left) <= 1.0 or value <= 1.0 or len(found) == _MOST_REPORTED:
            break
        found.append(_describe(dataset, blocks, np.sqrt(value) * vector, limits))
        left = left - value * vector**2
    return found


def _in_parent_axes(
    blocks: Sequence[ParameterBlock], x: np.ndarray, shared: np.ndarray
) -> np.ndarray:
    to_parent = np.eye(len(shared))
    for i, block in enumerate(blocks):
        at = slice(6 * i, 6 * i + 3)
        steps = x[at]
        rotation = block.initial[:3, :3] @ se3.rotation_from_rotation_vector(steps)
        to_parent[at, at] = rotation @ se3.right_jacobian(steps)
    return to_parent @ shared @ to_parent.T


def _describe(
    dataset: Dataset, blocks: Sequence[ParameterBlock], spread: np.ndarray, limits: np.ndarray
) -> WeakDirection:
    """Name a direction; ``spread`` is one sigma along it, in units of the limits."""
    largest = int(np.argmax(np.abs(spread)))
    named = np.flatnonzero(np.abs(spread) >= _NAMED_SHARE * abs(spread[largest]))
    names = tuple(f"{'+'.join(blocks[i // 6].names)} {COMPONENTS[i % 6]}" for i in named)
    unit = "rad" if largest % 6 < 3 else "m"
    sigma = min(float(abs(spread[largest]) * limits[largest]), _LARGEST_SIGMA)
    motion = "turns" if unit == "rad" else "shifts"
    who = sorted({"+".join(blocks[i // 6].names) for i in named})
    direction = _world_direction(dataset, blocks[largest // 6], spread, largest)
    why = (
        f"the data hardly change when {', '.join(who)} {motion if len(who) == 1 else motion[:-1]} "
        f"{'about' if unit == 'rad' else 'along'} ({direction}) of {dataset.world}"
    )
    if len(who) > 1:
        why += " together"
    return WeakDirection(names, sigma, unit, why)


def _world_direction(
    dataset: Dataset, block: ParameterBlock, spread: np.ndarray, largest: int
) -> str:
    """Return the direction of the strongest part in world, as text."""
    start = 6 * (largest // 6) + (0 if largest % 6 < 3 else 3)
    part = spread[start : start + 3]
    chain = dataset.graph.chain(dataset.world, block.edge.parent)
    collection = next(iter(dataset.collections.values()))
    direction = chain_transform(chain, collection.transforms)[:3, :3] @ part
    direction = direction / np.linalg.norm(direction)
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    return ", ".join(f"{v + 0.0:.2f}" for v in direction)
