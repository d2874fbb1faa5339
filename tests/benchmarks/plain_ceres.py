"""Runs plain_ceres.cpp, the straightforward Ceres program, on a problem of ours."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import NamedTuple, Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION

_SOURCE = Path(__file__).with_suffix(".cpp")
_KINDS = {REPROJECTION: 0, ORTHOGONAL: 1, BORDER: 2}
_COMPILE = ["g++", "-O3", "-march=native", "-std=c++17", "-I/usr/include/eigen3"]
_LIBRARIES = ["-lceres", "-lglog"]


class Outcome(NamedTuple):
    """What the program printed."""

    cost_initial: float
    cost: float
    iterations: int
    seconds: float


class PlainCeres:
    """The program, compiled."""

    def __init__(self, folder: Path):
        """Compile it into a folder, unless it is there already."""
        self._program, self._folder = folder / "plain_ceres", folder
        newer = self._program.exists() and (self._program.stat().st_mtime > _SOURCE.stat().st_mtime)
        if not newer:
            folder.mkdir(parents=True, exist_ok=True)
            command = [*_COMPILE, str(_SOURCE), "-o", str(self._program), *_LIBRARIES]
            subprocess.run(command, check=True)

    def write(self, problem: Problem, sigmas: Sequence[np.ndarray]) -> Path:
        """Write a problem as the program reads it.

        Args:
            problem: with at most one sensor and one board on each chain, plumb_bob cameras.
            sigmas: for each residual block, (n,) in its unit.
        """
        data = self._folder / f"plain_ceres_{os.getpid()}.bin"
        data.write_bytes(_serialised(problem, sigmas))
        return data

    def run(self, data: Path) -> Outcome:
        """Solve a written problem."""
        printed = subprocess.run(
            [str(self._program), str(data)], check=True, capture_output=True, text=True
        )
        initial, cost, iterations, seconds = printed.stdout.split()
        return Outcome(float(initial), float(cost), int(iterations), float(seconds))


def _serialised(problem: Problem, sigmas: Sequence[np.ndarray]) -> bytes:
    """Header, poses of the blocks and a held identity, rows; numbers as in the C++ source."""
    parameters = problem.parameters
    poses = [b.initial for b in parameters.blocks] + [np.eye(4)]
    vectors = [
        np.concatenate([se3.rotation_vector_from_rotation(m[:3, :3]), m[:3, 3]]) for m in poses
    ]
    rows = [_rows(problem, block, sigma) for block, sigma in zip(problem.residual_blocks, sigmas)]
    table = np.concatenate(rows)
    held = len(parameters.blocks)
    header = np.array([held + 1, parameters.shared_count, held, len(table)], dtype=np.int64)
    return header.tobytes() + np.array(vectors).tobytes() + table.tobytes()


def _rows(problem: Problem, block, sigma: np.ndarray) -> np.ndarray:
    chains, held = problem.chains, len(problem.parameters.blocks)
    before = np.array([_flat(c[0]) for c in chains.constants])
    anchored = chains.block[:, 1] < 0  # only the board is free
    sensor = np.where(anchored, held, chains.block[:, 0])
    board = np.where(anchored, chains.block[:, 0], chains.block[:, 1])
    between = np.array(
        [_flat(np.eye(4) if a else c[1]) for a, c in zip(anchored, chains.constants)]
    )
    count, d = block.count, block.detection
    columns = [np.full(count, float(_KINDS[block.kind])), sensor[d], board[d]]
    columns += [before[d], between[d]]
    if block.kind == REPROJECTION:
        columns += [block.corners_in_pattern, block.pixels, np.zeros((count, 4))]
    else:
        size = np.zeros((count, 4))
        if block.kind == BORDER:
            size = np.column_stack([block.centre, block.half_size])
        columns += [block.points, np.zeros((count, 2)), size]
    columns += [sigma, np.tile(_intrinsics(block), (count, 1))]
    return np.column_stack(columns).astype(float)


def _intrinsics(block) -> np.ndarray:
    if block.kind != REPROJECTION:
        return np.zeros(9)
    distortion = np.zeros(5)
    distortion[: len(block.camera.D)] = block.camera.D
    return np.concatenate([block.camera.focal_px, block.camera.centre_px, distortion])


def _flat(matrix: np.ndarray) -> np.ndarray:
    return np.concatenate([matrix[:3, :3].ravel(), matrix[:3, 3]])
