"""Images in files: colour as JPEG or PNG, depth as 16-bit PNG of tenths of a millimetre."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import PathLike, write_bytes_atomically
from atom_core.io.encoded_images import decode_image
from atom_core.io.paths import unread

DEPTH_UNITS_PER_M = 10_000  # the unit of a depth file is 0.1 mm
MAX_DEPTH_M = np.iinfo(np.uint16).max / DEPTH_UNITS_PER_M
_JPEG_QUALITY = 95
_JPEG, _PNG = (".jpg", ".jpeg"), (".png",)


@dataclass(frozen=True)
class DepthWriteReport:
    """What became of a depth image on its way to a file.

    Attributes:
        pixels: number of pixels.
        valid: pixels with a depth in the file.
        out_of_range: pixels with a finite depth above `MAX_DEPTH_M`, made invalid.
    """

    pixels: int
    valid: int
    out_of_range: int

    @property
    def warning(self) -> str:
        """One line for the user, empty when nothing was lost."""
        if not self.out_of_range:
            return ""
        return (
            f"{self.out_of_range} of {self.pixels} depth pixels are farther than {MAX_DEPTH_M} m, "
            f"which a 16-bit file of 0.1 mm cannot hold; they were made invalid"
        )


def read_image(path: PathLike, expected_size: Optional[Tuple[int, int]] = None) -> np.ndarray:
    """Read a colour or grey image.

    Pixels come in the order of the file: a note of the camera's orientation (EXIF) is ignored,
    because labels and intrinsics belong to the pixels as they were recorded.

    Args:
        path: a JPEG, PNG or whatever OpenCV reads.
        expected_size: (height, width) that it must have.

    Returns:
        (height, width, 3) uint8, blue green red.

    Raises:
        DatasetError: the file is absent, cut off, no image, or has another size.
    """
    image = _decode(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    _check_size(path, image, expected_size)
    return image


def write_image(path: PathLike, image: np.ndarray) -> None:
    """Write an image; the ending .jpg, .jpeg (quality 95) or .png chooses the format.

    Args:
        path: the file.
        image: (height, width, 3) blue green red, or (height, width) grey; uint8.

    Raises:
        OutputError: the ending is another, or the file cannot be written.
        ValueError: the array is no image.
    """
    image = np.asarray(image)
    ending = Path(path).suffix.lower()
    if image.dtype != np.uint8 or image.size == 0 or image.shape[2:] not in ((), (3,)):
        raise ValueError(
            f"an image is (height, width[, 3]) uint8, not {image.shape} {image.dtype.name}"
        )
    if ending in _JPEG:
        write_bytes_atomically(
            path, _encode(ending, image, cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY)
        )
    elif ending in _PNG:
        write_bytes_atomically(path, _encode(ending, image))
    else:
        raise OutputError(f"{path}: images are written as .jpg or .png, not '{ending}'")


def read_depth_png(path: PathLike, expected_size: Optional[Tuple[int, int]] = None) -> np.ndarray:
    """Read a depth image.

    Args:
        path: a PNG of one channel and 16 bits, unit 0.1 mm, 0 where there is no depth.
        expected_size: (height, width) that it must have.

    Returns:
        (height, width) float32 [m], NaN where there is no depth.

    Raises:
        DatasetError: the file is absent, cut off, of another type or size.
    """
    stored = _decode(path, cv2.IMREAD_UNCHANGED)
    if stored.dtype != np.uint16 or stored.ndim != 2:
        channels = stored.shape[2] if stored.ndim == 3 else 1
        raise DatasetError(
            f"{path}: {channels} channel(s) of {8 * stored.dtype.itemsize} bits; a depth image "
            f"has one of 16 bits (0.1 mm, 0 = no depth): is this another sensor's image?"
        )
    _check_size(path, stored, expected_size)
    depth_m = stored / np.float32(DEPTH_UNITS_PER_M)
    depth_m[stored == 0] = np.nan
    return depth_m


def quantise_depth(depth_m: np.ndarray) -> Tuple[np.ndarray, DepthWriteReport]:
    """Turn depths into the numbers of a depth file.

    Args:
        depth_m: (height, width) [m]; NaN, infinite, zero or negative where there is none.

    Returns:
        (height, width) uint16 [0.1 mm], 0 where there is none or it is too far: a value never
        wraps around; and the report.
    """
    depth_m = np.asarray(depth_m)
    if depth_m.ndim != 2:
        raise ValueError(f"a depth image is (height, width), not {depth_m.shape}")
    with np.errstate(invalid="ignore", over="ignore"):
        units = np.rint(depth_m.astype(np.float64) * DEPTH_UNITS_PER_M)
        too_far = np.isfinite(depth_m) & (units > np.iinfo(np.uint16).max)
        valid = np.isfinite(units) & (units >= 1) & ~too_far
    stored = np.where(valid, units, 0).astype(np.uint16)
    report = DepthWriteReport(depth_m.size, int(valid.sum()), int(too_far.sum()))
    return stored, report


def encode_depth_png(depth_m: np.ndarray) -> Tuple[bytes, DepthWriteReport]:
    """Return the bytes of a depth PNG and the report; see `quantise_depth`."""
    stored, report = quantise_depth(depth_m)
    return _encode(".png", stored), report


def write_depth_png(path: PathLike, depth_m: np.ndarray) -> DepthWriteReport:
    """Write a depth image (height, width) [m]; see `quantise_depth`.

    Returns:
        The report; show its ``warning`` to the user.

    Raises:
        OutputError: the file cannot be written, or is not named .png (JPEG would change depths).
    """
    if Path(path).suffix.lower() not in _PNG:
        raise OutputError(f"{path}: depth images are written as .png")
    data, report = encode_depth_png(depth_m)
    write_bytes_atomically(path, data)
    return report


def _encode(ending: str, image: np.ndarray, *options: int) -> bytes:
    done, data = cv2.imencode(ending, image, list(options))
    if not done:
        raise ValueError(f"OpenCV cannot write {image.shape} {image.dtype.name} as {ending}")
    return data.tobytes()


def _decode(path: PathLike, flags: int) -> np.ndarray:
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: the image cannot be read ({unread(path, error)})") from error
    try:
        return decode_image(data, flags)
    except ValueError as error:
        raise DatasetError(f"{path}: {error}; copy or record it again") from error


def _check_size(path: PathLike, image: np.ndarray, expected: Optional[Tuple[int, int]]) -> None:
    if expected is not None and image.shape[:2] != tuple(expected):
        height, width = image.shape[:2]
        raise DatasetError(
            f"{path}: the image is {width} x {height} pixels, expected are "
            f"{expected[1]} x {expected[0]}; the file does not belong here"
        )
