"""The problem: how rows depend on parameters, through the chains of transforms.

The pose of a detection is a product over the chain from the sensor's frame to the pattern's:
``sensor_T_pattern = C0 X1 C1 X2 C2 ...`` with constants C and parameter blocks X, some of them
inverted. All detections are evaluated at once, as arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import DetectionKey
from atom_core.problem.parameters import Parameters
from atom_core.problem.residuals import (
    BorderBlock,
    RangeBlock,
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

    def poses_and_maps(
        self, block_poses: np.ndarray, block_twists: np.ndarray
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return poses (d, 4, 4) and M (d, k, 6, 6): left twist in the sensor by the numbers."""
        prefixes = self._walk(block_poses)
        maps = np.zeros(self.block.shape + (6, 6))
        if len(block_poses) == 0:
            return prefixes[-1], maps
        for k in range(self.block.shape[1]):
            used, inverted = self.block[:, k] >= 0, self.inverted[:, k]
            # An inverted block's change acts after it: its prefix includes the block itself.
            before, after = prefixes[2 * k], prefixes[2 * k + 1]
            prefix = np.where(inverted[:, None, None], after, before)
            sign = np.where(inverted, -1.0, 1.0)[:, None, None]
            twist = sign * (se3.adjoint(prefix) @ block_twists[self.block[:, k]])
            maps[:, k] = np.where(used[:, None, None], twist, 0.0)
        return prefixes[-1], maps

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
    """Rows of all residual blocks at one vector.

    Attributes:
        residuals: for each residual block, (n, dimension) in its unit.
        by_twist: for each residual block, (n, dimension, 6); or by all local columns, (n,
            dimension, 18), where the intrinsics of its camera are estimated.
        maps: (d, k, 6, 6) twist of each detection by the numbers of its blocks; (d, k, 18, 6)
            where any intrinsics are estimated.
    """

    residuals: List[np.ndarray]
    by_twist: List[np.ndarray]
    maps: np.ndarray


@dataclass(frozen=True)
class Problem:
    """A calibration problem, ready to be solved.

    Attributes:
        parameters: what is estimated.
        detections: which detection each chain belongs to.
        chains: how the detections' poses follow from the parameters.
        residual_blocks: the rows.
    """

    parameters: Parameters
    detections: Tuple[DetectionKey, ...]
    chains: PoseChains
    residual_blocks: Tuple[ResidualBlock, ...]

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

    def with_range_offsets(self, offsets_m: Mapping[str, float]) -> Problem:
        """Return the problem with the points of some range sensors moved along their rays."""
        blocks = [
            block.with_range_offset(offsets_m[block.sensor])
            if isinstance(block, RangeBlock) and block.sensor in offsets_m
            else block
            for block in self.residual_blocks
        ]
        return replace(self, residual_blocks=tuple(blocks))

    def with_cameras(self, x: np.ndarray) -> Problem:
        """Return the problem with the cameras of the vector x in its rows, to be held there."""
        return replace(self, residual_blocks=self._blocks_at(x))

    def residuals(self, x: np.ndarray) -> List[np.ndarray]:
        """Return, for each residual block, (n, dimension) in its unit."""
        poses = self.poses(x)
        return [block.residuals(poses) for block in self._blocks_at(x)]

    def poses_and_maps(self, x: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the detections' poses (d, 4, 4) and ``Linearisation.maps``."""
        block_poses = self.parameters.poses(x)
        twists = self.parameters.twists(x, block_poses)
        poses, maps = self.chains.poses_and_maps(block_poses, twists)
        return poses, self.parameters.localised(self.chains.block, maps)

    def linearise(self, x: np.ndarray) -> Linearisation:
        """Return residuals and their derivatives at the vector x."""
        poses, maps = self.poses_and_maps(x)
        starts = {name: pair[0] for name, pair in self.parameters.cameras_at(x).items()}
        pairs = [
            block.linearise_with_intrinsics(poses, starts[block.sensor])
            if isinstance(block, ReprojectionBlock) and block.sensor in starts
            else block.linearise(poses)
            for block in self._blocks_at(x)
        ]
        return Linearisation([p[0] for p in pairs], [p[1] for p in pairs], maps)

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

        line = self.linearise(x)
        parts = [
            self._rows(block, by_twist / sigma[:, None, None], line.maps)
            for block, by_twist, sigma in zip(self.residual_blocks, line.by_twist, sigmas)
        ]
        return sparse.vstack(parts, format="csr")

    def _rows(
        self, block: ResidualBlock, by_twist: np.ndarray, maps: np.ndarray
    ) -> sparse.csr_matrix:
        from scipy import sparse

        rows = block.count * block.dimension
        blocks = self.chains.block[block.detection]
        reached = maps[block.detection][:, :, : by_twist.shape[2]]
        values = np.einsum("nrt,nktp->nrkp", by_twist, reached)
        columns = 6 * blocks[:, None, :, None] + np.arange(6)
        columns = np.broadcast_to(columns, values.shape)
        row = np.broadcast_to(
            np.arange(rows).reshape(block.count, block.dimension, 1, 1), values.shape
        )
        used = columns >= 0
        shape = (rows, self.parameters.size)
        return sparse.csr_matrix((values[used], (row[used], columns[used])), shape=shape)
