"""Poses of a robot's hand in the text files of published hand-eye data: RWHE's and Tabb's.

RWHE (Ali et al.): line n holds ``base_T_hand``, 16 numbers, row by row, in metres. Tabb, Ahmad
Yousef: the number of poses, then ``hand_T_base`` in 4 lines of 4 numbers each, in millimetres.
"""

from __future__ import annotations

from pathlib import Path
from typing import List, Sequence

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.geometry.units import MM_PER_M
from atom_core.io.paths import unread

_ROUNDED = 1e-3  # entries of a rotation that was written with few digits
_DIGITS = ".17g"
# A robot's hand moves farther than the shorter, and stays within the longer, of these [m].
_LEAST_REACH_M, _MOST_REACH_M = 0.01, 50.0


def read_rwhe_poses(path: Path) -> List[np.ndarray]:
    """Return ``base_T_hand`` (4, 4) [m] of each line; tabs or spaces between the numbers.

    Raises:
        DatasetError: the file is absent, or a line is no pose.
    """
    lines = [line for line in _text(path).splitlines() if line.strip()]
    if not lines:
        raise DatasetError(f"{path}: holds no pose; it must have a line of 16 numbers for each")
    poses = [_pose(_numbers(line, path), f"{path}:{i + 1}") for i, line in enumerate(lines)]
    reach = _reach_m(poses)
    if reach > _MOST_REACH_M:
        raise DatasetError(
            f"{path}: the hand is up to {reach:.4g} m from the robot's base, so that its lengths "
            f"seem to be in millimetres; write them in metres"
        )
    return poses


def rwhe_text(base_T_hand: Sequence[np.ndarray]) -> str:
    """Return the text of such a file of poses (4, 4) [m]."""
    return "".join(_line(pose.ravel()) for pose in base_T_hand)


def read_tabb_poses(path: Path) -> List[np.ndarray]:
    """Return ``base_T_hand`` (4, 4) [m], the inverses of what the file holds.

    Raises:
        DatasetError: the file is absent, its number of poses is another, or one is no pose.
    """
    numbers = _numbers(_text(path), path)
    count = int(numbers[0]) if len(numbers) and float(numbers[0]).is_integer() else 0
    if count < 1 or len(numbers) != 1 + 16 * count:
        raise DatasetError(
            f"{path}: {len(numbers)} numbers, where a count and 16 numbers for each pose are "
            f"expected; restore the file"
        )
    poses = []
    for index, values in enumerate(numbers[1:].reshape(count, 16)):
        matrix = values.reshape(4, 4).copy()
        matrix[:3, 3] /= MM_PER_M
        poses.append(se3.inverse(_pose(matrix.ravel(), f"{path}, pose {index}")))
    reach = _reach_m(poses)
    if 0.0 < reach < _LEAST_REACH_M:
        raise DatasetError(
            f"{path}: the hand is never more than {MM_PER_M * reach:.3g} mm from the robot's "
            f"base, so that its lengths seem to be in metres; write them in millimetres"
        )
    return poses


def tabb_text(base_T_hand: Sequence[np.ndarray]) -> str:
    """Return the text of such a file of poses (4, 4) [m]."""
    text = f"{len(base_T_hand)}\n"
    for pose in base_T_hand:
        matrix = se3.inverse(pose)
        matrix[:3, 3] *= MM_PER_M
        text += "".join(_line(row) for row in matrix) + "\n"
    return text


def _reach_m(base_T_hand: Sequence[np.ndarray]) -> float:
    return max(float(np.linalg.norm(pose[:3, 3])) for pose in base_T_hand)


def _line(values: np.ndarray) -> str:
    return " ".join(format(float(value), _DIGITS) for value in values) + "\n"


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")  # as editors on Windows begin a file
    except OSError as error:
        reason = unread(path, error)
        raise DatasetError(f"{path}: the robot's poses cannot be read ({reason})") from None
    except UnicodeDecodeError:
        raise DatasetError(f"{path}: is no text; the robot's poses are expected") from None


def _numbers(text: str, path: Path) -> np.ndarray:
    try:
        return np.array([float(word) for word in text.replace(",", " ").split()])
    except ValueError as error:
        raise DatasetError(f"{path}: holds what is no number ({error}); restore the file") from None


def _pose(values: np.ndarray, where: str) -> np.ndarray:
    """Return a pose (4, 4) of 16 numbers, its rotation without the rounding of its digits."""
    if len(values) != 16 or not np.all(np.isfinite(values)):
        raise DatasetError(
            f"{where}: {len(values)} numbers, where the 16 of a pose (4 x 4) are expected"
        )
    matrix = values.reshape(4, 4)
    left, _, right = np.linalg.svd(matrix[:3, :3])
    rotation = left @ right
    off = np.max(np.abs(rotation - matrix[:3, :3]))
    bottom = np.max(np.abs(matrix[3] - [0.0, 0.0, 0.0, 1.0]))
    if off > _ROUNDED or bottom > _ROUNDED or np.linalg.det(rotation) < 0:
        raise DatasetError(f"{where}: is no pose: its rotation or its last row is wrong")
    return se3.transform(rotation, matrix[:3, 3])
