"""The vector of the solver: which number stands where, and what it means.

What is held still is no block and not in the vector. Everybody else asks here for slices, columns,
names and units, and for poses, joints and cameras at a vector.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, moved_camera
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import (
    BLOCK_SIZE,
    ParameterBlock,
    PoseBlock,
    TransformBlock,
    pose_at,
    pose_twist_jacobian,
)
from atom_core.problem.camera_blocks import CameraBlock
from atom_core.problem.joint_blocks import JointBlock
from atom_core.problem.moving_blocks import MovingBlock
from atom_core.problem.priors import Prior


class Component(NamedTuple):
    """One number of the vector.

    Attributes:
        block: index of its block.
        place: which of the block's six it is.
        name: for messages, as ``rgb_1 z``.
        unit: of the value that it stands for.
    """

    block: int
    place: int
    name: str
    unit: str


class Parameters:
    """The ordered blocks: shared ones first, then those of each collection.

    Attributes:
        blocks: b of them.
        shared_count: how many of them hold for all collections.
        free: (b, 6) bool: the numbers that are estimated; the others stay zero.
        initial: (b, 4, 4) the blocks' factors of a chain at zero; the identity for intrinsics.
        cameras: indices of the blocks of each camera's intrinsics, by sensor.
        prior_mean, prior_weight: (b, 6) the numbers that are expected, and one over their variance
            about them; 0: anything goes.
        is_transform: (b,) bool: blocks that are factors of chains, all but intrinsics.
        has_prior: whether anything is expected of any number.
        is_board_of_collection: (b,) bool: such blocks never meet in a detection.
        is_eliminated: (b,) bool: those, and where a collection has none, one of its moving parts:
            none of them ever meet in a detection.
    """

    def __init__(self, blocks: Sequence[ParameterBlock]):
        """Order the blocks; no edge may stand twice for one collection."""
        shared = [b for b in blocks if b.collection is None]
        local = sorted((b for b in blocks if b.collection is not None), key=_collection_of)
        self.blocks: Tuple[ParameterBlock, ...] = tuple(shared + local)
        self.shared_count = len(shared)
        self.cameras: Dict[str, List[int]] = {}
        self._index: Dict[Tuple[Edge, Optional[str]], List[int]] = {}
        self._joints: List[Tuple[int, JointBlock]] = []
        self.initial = np.tile(np.eye(4), (len(self.blocks), 1, 1))
        for i, block in enumerate(self.blocks):
            if isinstance(block, CameraBlock):
                self.cameras.setdefault(block.sensor, []).append(i)
            elif isinstance(block, TransformBlock):
                self._add_transform(i, block)
        self.free = np.array([b.free for b in self.blocks], dtype=bool).reshape(-1, BLOCK_SIZE)
        self.prior_mean = np.zeros((len(self.blocks), BLOCK_SIZE))
        self.prior_weight = np.zeros((len(self.blocks), BLOCK_SIZE))
        for i, block in enumerate(self.blocks):
            self.prior_mean[i], self.prior_weight[i] = block.prior_mean, block.prior_weight
        self.has_prior = bool(np.any(self.prior_weight))
        self.is_transform = _flags(isinstance(b, TransformBlock) for b in self.blocks)
        self.is_board_of_collection = _flags(b.is_board_of_collection for b in self.blocks)
        self.is_eliminated = self._eliminated()

    def _add_transform(self, index: int, block: TransformBlock) -> None:
        holders = self._index.setdefault((block.edge, block.collection), [])
        both = [block, *(self.blocks[i] for i in holders)]
        if holders and any(isinstance(b, PoseBlock) for b in both):
            raise ValueError("two parameter blocks hold the same edge")
        holders.append(index)
        self.initial[index] = block.initial if isinstance(block, PoseBlock) else _at_zero(block)
        if isinstance(block, JointBlock):
            self._joints.append((index, block))

    def _eliminated(self) -> np.ndarray:
        result = self.is_board_of_collection.copy()
        taken = {b.collection for b in self.blocks if b.is_board_of_collection}
        for i, block in enumerate(self.blocks):
            if isinstance(block, MovingBlock) and block.collection not in taken:
                result[i] = True
                taken.add(block.collection)
        return result

    # ------------------------------------------------------------------------- layout

    @property
    def size(self) -> int:
        """Length of the vector."""
        return BLOCK_SIZE * len(self.blocks)

    @property
    def free_count(self) -> int:
        """How many numbers of the vector are estimated; the others stay zero."""
        return int(np.sum(self.free))

    @property
    def shared_blocks(self) -> Tuple[ParameterBlock, ...]:
        """The blocks that hold for all collections."""
        return self.blocks[: self.shared_count]

    @staticmethod
    def by_block(x: np.ndarray) -> np.ndarray:
        """Return a vector, or a part of one, as a view (b, 6)."""
        return x.reshape(-1, BLOCK_SIZE)

    @staticmethod
    def slice_of(block: int) -> slice:
        """Return where a block's numbers stand in the vector."""
        return slice(BLOCK_SIZE * block, BLOCK_SIZE * (block + 1))

    @staticmethod
    def columns(blocks: np.ndarray) -> np.ndarray:
        """Return the places (..., 6) of blocks (...) in the vector; negative for -1."""
        return BLOCK_SIZE * blocks[..., None] + np.arange(BLOCK_SIZE)

    def component(self, index: int) -> Component:
        """Return what a number of the vector is."""
        block, place = divmod(index, BLOCK_SIZE)
        owner = self.blocks[block]
        name = f"{owner.title} {owner.components[place]}"
        return Component(block, place, name, owner.units[place])

    def pose_blocks(self) -> Iterator[Tuple[int, PoseBlock]]:
        """Yield the blocks that are poses of edges, with their indices."""
        for i, block in enumerate(self.blocks):
            if isinstance(block, PoseBlock):
                yield i, block

    def joint_blocks(self) -> Iterator[Tuple[int, JointBlock]]:
        """Yield the blocks of joints, with their indices."""
        yield from self._joints

    def camera_blocks(self) -> Iterator[Tuple[int, CameraBlock]]:
        """Yield the blocks of intrinsics, with their indices."""
        for i, block in enumerate(self.shared_blocks):
            if isinstance(block, CameraBlock):
                yield i, block

    def priors(self) -> Iterator[Tuple[int, Prior]]:
        """Yield what the user knows beforehand, with the indices of the blocks it is known of."""
        for i, block in enumerate(self.blocks):
            if block.prior is not None:
                yield i, block.prior

    @property
    def stated_weight(self) -> np.ndarray:
        """(b, 6) the prior weights that are the user's knowledge of an edge or a joint."""
        mine = _flags(block.prior is not None for block in self.blocks)
        return np.where(mine[:, None], self.prior_weight, 0.0)

    def without_priors(self) -> Parameters:
        """Return the same blocks without what the user knows of edges and joints beforehand."""
        return Parameters([block.without_prior() for block in self.blocks])

    def prior_cost(self, x: np.ndarray) -> float:
        """Return half the squared deviation of the vector x from what is expected."""
        off = self.by_block(x) - self.prior_mean
        return 0.5 * float(np.sum(self.prior_weight * off**2))

    def prior_gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the derivative (6 b,) of ``prior_cost`` by all numbers."""
        off = self.by_block(x) - self.prior_mean
        return (self.prior_weight * off).ravel()

    def find(self, edge: Edge, collection: str) -> Sequence[int]:
        """Return the indices of the blocks that hold the edge in the collection, in its order.

        None or one for a pose; of a joint, the origin's before the bias's.
        """
        everywhere: Sequence[int] = self._index.get((edge, None), ())
        return everywhere or self._index.get((edge, collection), ())

    def local_groups(self) -> List[np.ndarray]:
        """Return, for each collection with blocks of its own, their indices."""
        groups: Dict[str, List[int]] = {}
        for i, block in enumerate(self.blocks[self.shared_count :], self.shared_count):
            groups.setdefault(str(block.collection), []).append(i)
        return [np.array(indices) for indices in groups.values()]

    def with_initial(self, poses: Mapping[int, np.ndarray]) -> Parameters:
        """Return the same blocks, some poses (4, 4) with other initial values, by index."""
        return Parameters(
            [
                replace(block, initial=poses[i])
                if i in poses and isinstance(block, PoseBlock)
                else block
                for i, block in enumerate(self.blocks)
            ]
        )

    # ---------------------------------------------------------------------- at a vector

    def poses(self, x: np.ndarray) -> np.ndarray:
        """Return the factors (b, 4, 4) of all blocks at the vector x, mostly parent_T_child."""
        steps = self.by_block(x)
        poses = pose_at(self.initial, steps)
        for i, block in self._joints:
            poses[i] = block.pose(steps[i])
        for indices in self.cameras.values():
            poses[indices] = np.eye(4)
        return poses

    def twist_jacobians(self, x: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return E (b, 6, 6): the left twist (rotation, move) in parent, by the six numbers.

        A change d of a block's numbers moves the points of the child, as seen in parent, by
        ``w x p + v`` with ``(w, v) = E d``. Intrinsics move nothing; theirs has no meaning.
        """
        steps = self.by_block(x)
        result = pose_twist_jacobian(poses, steps)
        for i, block in self._joints:
            result[i] = block.twist_jacobian(steps[i])
        return result

    def edges_at(self, x: np.ndarray) -> Iterator[Tuple[PoseBlock, np.ndarray]]:
        """Yield the blocks that are poses of edges, and ``parent_T_child`` (4, 4) at x."""
        poses = self.poses(x)
        for i, block in self.pose_blocks():
            yield block, poses[i]

    def joints_at(self, x: np.ndarray) -> Dict[str, Dict[str, float]]:
        """Return the estimated values [rad, m] at the vector x, by joint and parameter."""
        steps = self.by_block(x)
        found: Dict[str, Dict[str, float]] = {}
        for i, block in self._joints:
            found.setdefault(block.joint, {}).update(block.free_values(steps[i]))
        return found

    def cameras_at(self, x: np.ndarray) -> Dict[str, Tuple[Camera, Camera]]:
        """Return the camera to start from and the one at the vector x, by sensor."""
        numbers: Dict[str, np.ndarray] = {}
        initial: Dict[str, Camera] = {}
        steps = self.by_block(x)
        for i, block in self.camera_blocks():
            part = slice(block.first, block.first + BLOCK_SIZE)
            of_camera = numbers.setdefault(block.sensor, np.zeros(COUNT))
            of_camera[part] = np.where(self.free[i], steps[i], 0.0)
            initial[block.sensor] = block.camera
        return {s: (camera, moved_camera(camera, numbers[s])) for s, camera in initial.items()}


def _collection_of(block: ParameterBlock) -> str:
    return str(block.collection)


def _flags(values: Iterable[bool]) -> np.ndarray:
    return np.array(list(values), dtype=bool)


def _at_zero(block: TransformBlock) -> np.ndarray:
    return block.pose(np.zeros(BLOCK_SIZE))
