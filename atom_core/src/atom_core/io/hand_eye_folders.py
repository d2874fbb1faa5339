"""Published layouts of hand-eye data, RWHE's and Tabb's: images and robot poses in a folder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Collection, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry.units import MM_PER_M
from atom_core.io.robot_poses import read_rwhe_poses, read_tabb_poses
from atom_core.model.pattern import Pattern

RWHE_POSES, RWHE_SQUARE = "RobotPosesVec.txt", "squaresize.txt"
RWHE_MATLAB, RWHE_MATLAB_NAME = "RobotPoses.mat", "handposes"
RWHE_CORNERS = "detections"
TABB_POSES, TABB_BOARD, TABB_DETAILS = (
    "robot_cali.txt",
    "calibration_object.txt",
    "ExperimentDetails.txt",
)
TABB_IMAGES = "images"
_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm")
_PER_M = {"mm": MM_PER_M, "cm": 100.0, "m": 1.0}


class ToldBoard(NamedTuple):
    """The board as a file beside the images has it.

    Attributes:
        path: the file.
        sides_m: of a square.
        corners: inner ones along its two sides, the fewer first; empty where it does not tell.
    """

    path: Path
    sides_m: Tuple[float, ...]
    corners: Tuple[int, ...] = ()


class RobotImages(NamedTuple):
    """Images of cameras, and where the robot's hand was.

    Attributes:
        images: files by camera and by the number in their names.
        base_T_hand: (4, 4) [m] by the same numbers.
        board: what the folder says of it; None where it says nothing.
    """

    images: Mapping[str, Mapping[int, Path]]
    base_T_hand: Mapping[int, np.ndarray]
    board: Optional[ToldBoard] = None


def read_rwhe_folder(folder: Path, camera: str) -> RobotImages:
    """Read images with a number in their names, and ``RobotPosesVec.txt``.

    As many images as poses belong together in the order of their numbers; otherwise image n to
    line n.

    Raises:
        DatasetError: there are no images, or one has no pose.
    """
    images = numbered_images(folder)
    poses, board = read_rwhe_poses(folder / RWHE_POSES), _rwhe_board(folder / RWHE_SQUARE)
    if len(images) == len(poses):
        return RobotImages({camera: images}, dict(zip(images, poses)), board)
    without = [number for number in images if not 1 <= number <= len(poses)]
    if without:
        raise DatasetError(
            f"{images[without[0]]}: {RWHE_POSES} has {len(poses)} lines, and none for image "
            f"{without[0]}; image n belongs to line n"
        )
    return RobotImages({camera: images}, {n: poses[n - 1] for n in images}, board)


def read_tabb_folder(folder: Path) -> RobotImages:
    """Read ``images/<camera>/`` and ``robot_cali.txt``; poses are in the order of the numbers.

    Raises:
        DatasetError: there are no images, or not as many poses as numbers.
    """
    above = folder / TABB_IMAGES
    cameras = sorted(path for path in above.iterdir() if path.is_dir()) if above.is_dir() else []
    if not cameras:
        raise DatasetError(f"{above}: no folder of a camera is in it, so there are no images")
    images = {path.name: numbered_images(path) for path in cameras}
    numbers = sorted({number for of_camera in images.values() for number in of_camera})
    poses = read_tabb_poses(folder / TABB_POSES)
    if len(poses) != len(numbers):
        raise DatasetError(
            f"{folder / TABB_POSES}: {len(poses)} poses for {len(numbers)} numbers of images; each "
            f"number needs one"
        )
    return RobotImages(images, dict(zip(numbers, poses)), _tabb_board(folder / TABB_BOARD))


def _rwhe_board(path: Path) -> Optional[ToldBoard]:
    """Return the board of ``squaresize.txt``: a length with its unit.

    Where it has none it is in metres, or in millimetres where no square is as many metres large.
    """
    words = re.fullmatch(r"([\d.eE+-]+)\s*(mm|cm|m|)", _text_of(path).strip())
    try:
        length = float(words[1]) if words else 0.0
    except ValueError:
        return None
    if words is None or length <= 0.0:
        return None
    unit = words[2] or ("m" if length < 1.0 else "mm")
    return ToldBoard(path, (length / _PER_M[unit],))


def _tabb_board(path: Path) -> Optional[ToldBoard]:
    """Return the board of ``calibration_object.txt``, as `tabb_board_text` writes it."""
    words = _text_of(path).split()
    told = dict(zip(words[::2], words[1::2]))
    try:
        sides_m = [float(told[f"chess_mm_{side}"]) / MM_PER_M for side in ("height", "width")]
        corners = sorted(int(told[f"chess_{side}"]) for side in ("height", "width"))
    except (KeyError, ValueError):
        return None
    return ToldBoard(path, tuple(sides_m), tuple(corners))


def _text_of(path: Path) -> str:
    """Return the text of a file that may be absent; nothing where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return ""


def numbered_images(folder: Path) -> Dict[int, Path]:
    """Return the images of a folder by the last number in their names, in its order.

    Raises:
        DatasetError: there is none, one has no number, or two have the same.
    """
    files = sorted(folder.iterdir()) if folder.is_dir() else []
    found: Dict[int, Path] = {}
    for path in files:
        if path.suffix.lower() not in _ENDINGS:
            continue
        numbers = re.findall(r"\d+", path.stem)
        if not numbers:
            raise DatasetError(f"{path}: has no number in its name, which tells its pose")
        number = int(numbers[-1])
        if number in found:
            raise DatasetError(f"{path}: has the number of {found[number].name}; rename one")
        found[number] = path
    if not found:
        raise DatasetError(f"{folder}: there are no images in it")
    return dict(sorted(found.items()))


def of_other_images(folder: Path, written: Collection[Path]) -> List[Path]:
    """Return images and corners in a folder of a layout that are not those to be written.

    Programs take all that lie there for one set, image by image with the poses.
    """
    below = (folder, folder / RWHE_CORNERS, *sorted((folder / TABB_IMAGES).glob("*")))
    files = [path for place in below if place.is_dir() for path in sorted(place.iterdir())]
    return [
        path
        for path in files
        if path not in written
        and (path.suffix.lower() in _ENDINGS or path.parent.name == RWHE_CORNERS)
    ]


def tabb_board_text(pattern: Pattern) -> str:
    """Return ``calibration_object.txt``: sides of a square in mm, numbers of inner corners."""
    side_mm = MM_PER_M * pattern.square_m
    return (
        f"chess_mm_height {side_mm:g}\nchess_mm_width {side_mm:g}\n"
        f"chess_height {pattern.rows}\nchess_width {pattern.columns}\n"
    )


def matlab_poses(base_T_hand: Sequence[np.ndarray]) -> Dict[str, np.ndarray]:
    """Return what ``RobotPoses.mat`` holds: poses (n, 16), row by row."""
    rows: List[np.ndarray] = [pose.ravel() for pose in base_T_hand]
    return {RWHE_MATLAB_NAME: np.array(rows)}
