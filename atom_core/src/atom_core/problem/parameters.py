"""Parameter blocks: mostly one pose each, packed into the solver's vector.

A block holds six numbers relative to its initial value: a rotation vector r [rad] and a
translation t [m], with ``parent_T_child = (R0 exp(r), t0 + t)``. What is held still is no
block and not in the vector. A block of a joint says itself what its numbers mean
(``joint_blocks.py``), and which of the six are estimated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import COUNT, moved_camera
from atom_core.model.transforms import Edge
from atom_core.problem.camera_blocks import LOCAL, TWIST, CameraNumbers
from atom_core.problem.joint_blocks import BiasNumbers, Numbers, OriginNumbers

SENSOR, ADDITIONAL_TF, PATTERN = "sensor", "additional_tf", "pattern"
JOINT, INTRINSICS = "joint", "intrinsics"
COMPONENTS = ("r1", "r2", "r3", "x", "y", "z")


@dataclass(frozen=True)
class ParameterBlock:
    """One pose to estimate, or a part of a joint or of a camera's intrinsics.

    Attributes:
        edge: the edge of the tree; of intrinsics, that of the camera.
        kind: sensor, additional_tf, pattern, joint or intrinsics.
        collection: whose value it is; None when one value holds for all collections.
        initial: (4, 4) ``parent_T_child`` to start from; of a joint, its part of it.
        names: sensors (or the pattern, or the joint) that it belongs to.
        numbers: what the six numbers mean; None: a pose.
    """

    edge: Edge
    kind: str
    collection: Optional[str]
    initial: np.ndarray
    names: Tuple[str, ...]
    numbers: Optional[Numbers] = None

    @property
    def label(self) -> str:
        """A name for messages."""
        within = f" in collection {self.collection}" if self.collection is not None else ""
        return f"{self.kind} {'+'.join(self.names)} ({self.edge}){within}"

    @property
    def title(self) -> str:
        """The name that stands before those of its numbers."""
        return ("joint " if self.kind == JOINT else "") + "+".join(self.names)

    @property
    def components(self) -> Tuple[str, ...]:
        """Names of the six numbers."""
        return COMPONENTS if self.numbers is None else self.numbers.names


class Parameters:
    """The ordered blocks: shared ones first, then those of each collection."""

    def __init__(self, blocks: Sequence[ParameterBlock]):
        """Order the blocks; no edge may stand twice for one collection."""
        shared = [b for b in blocks if b.collection is None]
        local = sorted((b for b in blocks if b.collection is not None), key=_collection_of)
        self.blocks: Tuple[ParameterBlock, ...] = tuple(shared + local)
        self.shared_count = len(shared)
        self._index: Dict[Tuple[Edge, Optional[str]], List[int]] = {}
        self.cameras: Dict[str, List[int]] = {}  # blocks of a sensor's intrinsics
        # Where a block's columns begin among those that a detection's rows have.
        self.local_start = np.zeros(len(self.blocks), dtype=int)
        for i, block in enumerate(self.blocks):
            if isinstance(block.numbers, CameraNumbers):
                self.cameras.setdefault(block.names[0], []).append(i)
                self.local_start[i] = TWIST + block.numbers.first
                continue
            holders = self._index.setdefault((block.edge, block.collection), [])
            if holders and None in (block.numbers, self.blocks[holders[0]].numbers):
                raise ValueError("two parameter blocks hold the same edge")
            holders.append(i)
        self._initial = np.array([b.initial for b in self.blocks]).reshape(-1, 4, 4)
        self._special = [(i, b.numbers) for i, b in enumerate(self.blocks) if b.numbers is not None]
        self.free = np.ones((len(self.blocks), 6), dtype=bool)
        for i, numbers in self._special:
            self.free[i] = numbers.free

    @property
    def size(self) -> int:
        """Length of the vector."""
        return 6 * len(self.blocks)

    @property
    def local_size(self) -> int:
        """How many columns a detection's rows have: its twist's, and a camera's numbers."""
        return LOCAL if self.cameras else TWIST

    def localised(self, block: np.ndarray, maps: np.ndarray) -> np.ndarray:
        """Return maps to all local columns (d, k, local_size, 6).

        Args:
            block: (d, k) indices of blocks, -1 where there is none.
            maps: (d, k, 6, 6) to the twist; of a camera's blocks it has no meaning.
        """
        if not self.cameras:
            return maps
        result = np.zeros(maps.shape[:2] + (LOCAL, 6))
        start = np.where(block >= 0, self.local_start[block], 0)
        result[:, :, :TWIST] = np.where((start == 0)[:, :, None, None], maps, 0.0)
        for i in np.flatnonzero(self.local_start):
            first = self.local_start[i]
            result[block == i, first : first + 6] = np.diag(self.free[i].astype(float))
        return result

    def cameras_at(self, x: np.ndarray) -> Dict[str, Tuple[Camera, Camera]]:
        """Return the camera to start from and the one at the vector x, by sensor."""
        found: Dict[str, Tuple[Camera, Camera]] = {}
        for sensor, indices in self.cameras.items():
            all_numbers, cameras = np.zeros(COUNT), []
            for i in indices:
                numbers = self.blocks[i].numbers
                assert isinstance(numbers, CameraNumbers)
                part = np.where(numbers.free, x[6 * i : 6 * i + 6], 0.0)
                all_numbers[numbers.first : numbers.first + 6] = part
                cameras.append(numbers.camera)
            found[sensor] = (cameras[0], moved_camera(cameras[0], all_numbers))
        return found

    @property
    def free_count(self) -> int:
        """How many numbers of the vector are estimated; the others stay zero."""
        return int(np.sum(self.free))

    def with_initial(self, poses: Mapping[int, np.ndarray]) -> Parameters:
        """Return the same blocks with other initial values (4, 4), by index."""
        return Parameters(
            [replace(b, initial=poses.get(i, b.initial)) for i, b in enumerate(self.blocks)]
        )

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

    def poses(self, x: np.ndarray) -> np.ndarray:
        """Return ``parent_T_child`` (b, 4, 4) of all blocks at the vector x."""
        steps = x.reshape(-1, 6)
        rotation = self._initial[:, :3, :3] @ se3.rotation_from_rotation_vector(steps[:, :3])
        poses = se3.transform(rotation, self._initial[:, :3, 3] + steps[:, 3:])
        for i, numbers in self._special:
            poses[i] = numbers.pose(steps[i])
        return poses

    def twists(self, x: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return E (b, 6, 6): the left twist (rotation, move) in parent, by the six numbers.

        A change d of a block's numbers moves the points of the child, as seen in parent, by
        ``w x p + v`` with ``(w, v) = E d``.
        """
        rotation = poses[:, :3, :3]
        turn = rotation @ se3.right_jacobian(x.reshape(-1, 6)[:, :3])
        result = np.zeros((len(poses), 6, 6))
        result[:, :3, :3] = turn
        result[:, 3:, :3] = se3.skew(poses[:, :3, 3]) @ turn
        result[:, 3:, 3:] = np.eye(3)
        for i, numbers in self._special:
            result[i] = numbers.twist(x.reshape(-1, 6)[i])
        return result


def _collection_of(block: ParameterBlock) -> str:
    return str(block.collection)


def joint_parameters(parameters: Parameters, x: np.ndarray) -> Dict[str, Dict[str, float]]:
    """Return the estimated values [rad, m] at the vector x, by joint and parameter."""
    found: Dict[str, Dict[str, float]] = {}
    for block, numbers in zip(parameters.blocks, x.reshape(-1, 6)):
        if isinstance(block.numbers, (OriginNumbers, BiasNumbers)):
            values = block.numbers.values(numbers)
            found.setdefault(block.names[0], {}).update(
                {
                    name: float(value)
                    for name, value, free in zip(block.components, values, block.numbers.free)
                    if free
                }
            )
    return found
