"""The problem: how rows depend on parameters, through the chains of transforms.

The pose of a detection is a product over the chain from the sensor's frame to the pattern's:
``sensor_T_pattern = C0 X1 C1 X2 C2 ...`` with constants C and parameter blocks X, some of them
inverted. All detections are evaluated at once, as arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Iterator, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.labels import DetectionKey
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.camera_blocks import STATE_SIZE, TWIST_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.problem.parameters import Parameters
from atom_core.problem.residuals import (
    BorderBlock,
    ReprojectionBlock,
    ResidualBlock,
)

if TYPE_CHECKING:
    from scipy import sparse


@dataclass(frozen=True)
class PoseChains:
    """The chains of d detections with at most k parameter blocks each.

    Attributes:
        constants: (d, k + 1, 4, 4) products of what is held still between the blocks.
        block: (d, k) index of the parameter block, -1 where a chain is shorter.
        inverted: (d, k) True where the block is walked from child to parent.
    """

    constants: np.ndarray
    block: np.ndarray
    inverted: np.ndarray

    def poses(self, block_poses: np.ndarray) -> np.ndarray:
        """Return ``sensor_T_pattern`` (d, 4, 4) at the blocks' poses (b, 4, 4)."""
        return self._walk(block_poses)[-1]

    def poses_and_jacobians(
        self, block_poses: np.ndarray, block_jacobians: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return poses (d, 4, 4) and J (d, k, 6, 6): left twist in the sensor by the numbers.

        Args:
            block_poses: (b, 4, 4) of the parameter blocks.
            block_jacobians: (b, 6, 6) their left twists by their numbers.
        """
        prefixes = self._walk(block_poses)
        jacobians = np.zeros(self.block.shape + (6, 6))
        if len(block_poses) == 0:
            return prefixes[-1], jacobians
        for k in range(self.block.shape[1]):
            used, inverted = self.block[:, k] >= 0, self.inverted[:, k]
            # An inverted block's change acts after it: its prefix includes the block itself.
            before, after = prefixes[2 * k], prefixes[2 * k + 1]
            prefix = np.where(inverted[:, None, None], after, before)
            sign = np.where(inverted, -1.0, 1.0)[:, None, None]
            twist = sign * (se3.adjoint(prefix) @ block_jacobians[self.block[:, k]])
            jacobians[:, k] = np.where(used[:, None, None], twist, 0.0)
        return prefixes[-1], jacobians

    def around(
        self, block_poses: np.ndarray, detection: int, block: int
    ) -> Tuple[np.ndarray, np.ndarray, bool]:
        """Return what stands before and after a block in a detection's chain, and its direction."""
        (k,) = np.flatnonzero(self.block[detection] == block)
        mine = PoseChains(
            *(part[[detection]] for part in (self.constants, self.block, self.inverted))
        )
        prefixes = mine._walk(block_poses)
        before, through, whole = prefixes[2 * k][0], prefixes[2 * k + 1][0], prefixes[-1][0]
        return before, se3.inverse(through) @ whole, bool(self.inverted[detection, k])

    def _walk(self, block_poses: np.ndarray) -> List[np.ndarray]:
        """Return the products before and after each block, and the whole product last."""
        product = self.constants[:, 0]
        prefixes = []
        for k in range(self.block.shape[1]):
            prefixes.append(product)
            used = self.block[:, k] >= 0
            if np.any(used):
                step = np.broadcast_to(np.eye(4), product.shape).copy()
                chosen = block_poses[self.block[used, k]]
                turned = self.inverted[used, k][:, None, None]
                step[used] = np.where(turned, se3.inverse(chosen), chosen)
                product = product @ step
            prefixes.append(product)
            product = product @ self.constants[:, k + 1]
        return prefixes + [product]


class Linearisation(NamedTuple):
    """Rows of all residual blocks at one vector, differentiated in two steps.

    The rows of a detection depend on its state: six numbers of the twist of its pose, and twelve
    of its camera's intrinsics where any intrinsics are estimated. The state depends on the numbers
    of the detection's blocks.

    Attributes:
        residuals: for each residual block, (n, dimension) in its unit.
        by_state: for each residual block, (n, dimension, 6), or (n, dimension, 18) where the
            intrinsics of its camera are estimated.
        state_jacobians: (d, k, 6, 6) state of each detection by the numbers of its blocks
            (``Problem.dependencies``); (d, k, 18, 6) where any intrinsics are estimated.
    """

    residuals: List[np.ndarray]
    by_state: List[np.ndarray]
    state_jacobians: np.ndarray


@dataclass(frozen=True)
class Problem:
    """A calibration problem, ready to be solved.

    Attributes:
        parameters: what is estimated.
        detections: which detection each chain belongs to.
        chains: how the detections' poses follow from the parameters.
        residual_blocks: the rows, corrected by the model errors.
        model_errors: what they are corrected by (`corrections.py`).
    """

    parameters: Parameters
    detections: Tuple[DetectionKey, ...]
    chains: PoseChains
    residual_blocks: Tuple[ResidualBlock, ...]
    model_errors: Mapping[ModelError, float] = field(default_factory=dict)

    @cached_property
    def patterns(self) -> np.ndarray:
        """(d,) names of the detections' patterns."""
        return np.array([key.pattern for key in self.detections])

    @cached_property
    def intrinsics_blocks(self) -> np.ndarray:
        """(d, c) the parameter blocks of each detection's camera, -1 for none."""
        cameras = self.parameters.cameras
        width = max((len(blocks) for blocks in cameras.values()), default=0)
        padded = {name: blocks + [-1] * (width - len(blocks)) for name, blocks in cameras.items()}
        none = [-1] * width
        rows = [padded.get(key.sensor, none) for key in self.detections]
        return np.array(rows, dtype=int).reshape(len(rows), width)

    @cached_property
    def dependencies(self) -> np.ndarray:
        """(d, k) the parameter blocks that each detection's rows depend on, -1 for none.

        Those of its chain, and right after them those of its camera's intrinsics.
        """
        if not self.parameters.cameras:
            return self.chains.block
        both = np.concatenate([self.chains.block, self.intrinsics_blocks], axis=1)
        order = np.argsort(both < 0, axis=1, kind="stable")
        width = max(int(np.max(np.sum(both >= 0, axis=1))), self.chains.block.shape[1])
        return np.take_along_axis(both, order, axis=1)[:, :width]

    @property
    def initial_sigmas(self) -> Tuple[np.ndarray, ...]:
        """Of each residual block, (n,) what its items are expected to deviate, in its unit."""
        return tuple(block.sigma for block in self.residual_blocks)

    @property
    def row_count(self) -> int:
        """Number of scalar residuals."""
        return sum(b.count * b.dimension for b in self.residual_blocks)

    def poses(self, x: np.ndarray) -> np.ndarray:
        """Return ``sensor_T_pattern`` (d, 4, 4) of the detections at the vector x."""
        return self.chains.poses(self.parameters.poses(x))

    def with_insets(self, insets: Mapping[int, np.ndarray]) -> Problem:
        """Return the problem with other insets (n, 2) [m] of border blocks, by their index."""
        blocks = list(self.residual_blocks)
        for i, inset in insets.items():
            block = blocks[i]
            assert isinstance(block, BorderBlock), "only limit points have an inset"
            blocks[i] = replace(block, inset=inset)
        return replace(self, residual_blocks=tuple(blocks))

    def without_priors(self) -> Problem:
        """Return the problem without what the user knows of edges and joints beforehand."""
        return replace(self, parameters=self.parameters.without_priors())

    def with_cameras(self, x: np.ndarray) -> Problem:
        """Return the problem with the cameras of the vector x in its rows, to be held there."""
        return replace(self, residual_blocks=self._blocks_at(x))

    def residuals(self, x: np.ndarray) -> List[np.ndarray]:
        """Return, for each residual block, (n, dimension) in its unit."""
        poses = self.poses(x)
        return [block.residuals(poses) for block in self._blocks_at(x)]

    def poses_and_jacobians(self, x: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the detections' poses (d, 4, 4) and ``Linearisation.state_jacobians``."""
        block_poses = self.parameters.poses(x)
        twists = self.parameters.twist_jacobians(x, block_poses)
        poses, jacobians = self.chains.poses_and_jacobians(block_poses, twists)
        return poses, self.state_jacobians(jacobians)

    def state_jacobians(self, by_chain: np.ndarray) -> np.ndarray:
        """Return ``Linearisation.state_jacobians`` of the chains' (d, k, 6, 6)."""
        if not self.parameters.cameras:
            return by_chain
        index = self.dependencies
        result = np.zeros(index.shape + (STATE_SIZE, BLOCK_SIZE))
        result[:, : by_chain.shape[1], :TWIST_SIZE] = by_chain
        for i, block in self.parameters.camera_blocks():
            result[index == i, block.columns] = np.diag(block.free.astype(float))
        return result

    def linearise(self, x: np.ndarray) -> Linearisation:
        """Return residuals and their derivatives at the vector x."""
        poses, jacobians = self.poses_and_jacobians(x)
        pairs = list(self.linearised_blocks(x, poses))
        return Linearisation([p[0] for p in pairs], [p[1] for p in pairs], jacobians)

    def linearised_blocks(
        self, x: np.ndarray, poses: np.ndarray
    ) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
        """Yield residuals and ``Linearisation.by_state`` of one block after the other.

        Args:
            x: the vector.
            poses: (d, 4, 4) of the detections at it.
        """
        starts = {name: pair[0] for name, pair in self.parameters.cameras_at(x).items()}
        for block in self._blocks_at(x):
            if isinstance(block, ReprojectionBlock) and block.sensor in starts:
                yield block.linearise_with_intrinsics(poses, starts[block.sensor])
            else:
                yield block.linearise(poses)

    def _blocks_at(self, x: np.ndarray) -> Tuple[ResidualBlock, ...]:
        cameras = self.parameters.cameras_at(x)
        return tuple(
            replace(block, camera=cameras[block.sensor][1])
            if isinstance(block, ReprojectionBlock) and block.sensor in cameras
            else block
            for block in self.residual_blocks
        )

    def jacobian(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> sparse.csr_matrix:
        """Return d(rows / sigma)/dx as a sparse (rows, parameters) matrix.

        Args:
            x: the vector.
            sigmas: for each residual block, (n,) in its unit.
        """
        from scipy import sparse  # slow to load, and no solver needs it

        linearisation = self.linearise(x)
        parts = [
            self._rows(block, by_state / sigma[:, None, None], linearisation.state_jacobians)
            for block, by_state, sigma in zip(self.residual_blocks, linearisation.by_state, sigmas)
        ]
        return sparse.vstack(parts, format="csr")

    def _rows(
        self, block: ResidualBlock, by_state: np.ndarray, state_jacobians: np.ndarray
    ) -> sparse.csr_matrix:
        from scipy import sparse

        rows = block.count * block.dimension
        reached = state_jacobians[block.detection][:, :, : by_state.shape[2]]
        values = np.einsum("nrt,nktp->nrkp", by_state, reached)
        columns = self.parameters.columns(self.dependencies[block.detection])[:, None]
        columns = np.broadcast_to(columns, values.shape)
        row = np.broadcast_to(
            np.arange(rows).reshape(block.count, block.dimension, 1, 1), values.shape
        )
        used = columns >= 0
        shape = (rows, self.parameters.size)
        return sparse.csr_matrix((values[used], (row[used], columns[used])), shape=shape)
