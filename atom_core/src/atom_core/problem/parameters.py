"""Parameter blocks: one pose each, packed into the solver's vector.

A block holds six numbers relative to its initial value: a rotation vector r [rad] and a
translation t [m], with ``parent_T_child = (R0 exp(r), t0 + t)``. What is held still is no
block and not in the vector.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.transforms import Edge

SENSOR, ADDITIONAL_TF, PATTERN = "sensor", "additional_tf", "pattern"
COMPONENTS = ("r1", "r2", "r3", "x", "y", "z")


@dataclass(frozen=True)
class ParameterBlock:
    """One pose to estimate.

    Attributes:
        edge: the edge of the tree.
        kind: sensor, additional_tf or pattern.
        collection: whose value it is; None when one value holds for all collections.
        initial: (4, 4) ``parent_T_child`` to start from.
        names: sensors (or the pattern) that it belongs to.
    """

    edge: Edge
    kind: str
    collection: Optional[str]
    initial: np.ndarray
    names: Tuple[str, ...]

    @property
    def label(self) -> str:
        """A name for messages."""
        within = f" in collection {self.collection}" if self.collection is not None else ""
        return f"{self.kind} {'+'.join(self.names)} ({self.edge}){within}"


class Parameters:
    """The ordered blocks: shared ones first, then those of each collection."""

    def __init__(self, blocks: Sequence[ParameterBlock]):
        """Order the blocks; no edge may stand twice for one collection."""
        shared = [b for b in blocks if b.collection is None]
        local = sorted((b for b in blocks if b.collection is not None), key=_collection_of)
        self.blocks: Tuple[ParameterBlock, ...] = tuple(shared + local)
        self.shared_count = len(shared)
        self._index: Dict[Tuple[Edge, Optional[str]], int] = {
            (b.edge, b.collection): i for i, b in enumerate(self.blocks)
        }
        if len(self._index) != len(self.blocks):
            raise ValueError("two parameter blocks hold the same edge")
        self._initial = np.array([b.initial for b in self.blocks]).reshape(-1, 4, 4)

    @property
    def size(self) -> int:
        """Length of the vector."""
        return 6 * len(self.blocks)

    def with_initial(self, poses: Mapping[int, np.ndarray]) -> Parameters:
        """Return the same blocks with other initial values (4, 4), by index."""
        return Parameters(
            [replace(b, initial=poses.get(i, b.initial)) for i, b in enumerate(self.blocks)]
        )

    def find(self, edge: Edge, collection: str) -> int:
        """Return the index of the block that holds the edge in the collection, or -1."""
        found = self._index.get((edge, None))
        return self._index.get((edge, collection), -1) if found is None else found

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
        return se3.transform(rotation, self._initial[:, :3, 3] + steps[:, 3:])

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
        return result


def _collection_of(block: ParameterBlock) -> str:
    return str(block.collection)
