"""Encoded images (JPEG, PNG ...): decoded by OpenCV, once nothing is known to be wrong with them.

Its decoders fill up what was cut off with grey and say nothing, and reserve as much memory as the
header asks for.
"""

from __future__ import annotations

import struct
import zlib
from typing import Optional, Tuple

import numpy as np

from atom_core import opencv as cv2

MOST_PIXELS = 200_000_000  # of an image that is decoded: 600 MB in colour
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_START, _JPEG_SCAN, _JPEG_END = b"\xff\xd8\xff", b"\xff\xda", b"\xff\xd9"
_JPEG_FRAMES = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # markers with the size behind them


def decode_image(data: bytes, flags: int, any_encoding: bool = True) -> np.ndarray:
    """Return an image as `cv2.imdecode` makes it with these flags.

    Args:
        data: as in a file.
        flags: of OpenCV.
        any_encoding: whatever OpenCV reads; else JPEG and PNG alone, whose damage is known
            beforehand (a damaged BMP has crashed OpenCV 4.6).

    Raises:
        ValueError: it is empty, cut off, damaged, larger than `MOST_PIXELS`, or no image; a few
            words that can follow the name of a file.
    """
    if data and not any_encoding and not data.startswith((_PNG_SIGNATURE, _JPEG_START)):
        raise ValueError("it is neither JPEG nor PNG")
    flaw = _flaw(data)
    if flaw:
        raise ValueError(flaw)
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags)
    except cv2.error as error:
        raise ValueError(f"OpenCV cannot read this image ({error.err})") from error
    if image is None:
        raise ValueError("it is no image that OpenCV can read")
    return image


def _flaw(data: bytes) -> str:
    if not data:
        return "it is empty"
    flaw = too_many_pixels(*(encoded_image_size(data) or (0, 0)))
    if flaw:
        return flaw
    if data.startswith(_PNG_SIGNATURE):
        return _png_damage(data)
    # After the last scan nothing but the end mark may look like one: 0xff is escaped in a scan.
    if data.startswith(_JPEG_START) and data.rfind(_JPEG_END) < data.rfind(_JPEG_SCAN):
        return "the JPEG is cut off"
    return ""


def too_many_pixels(width: int, height: int) -> str:
    """Return what is wrong with a size [pixels] that a header claims; empty: nothing."""
    if width * height <= MOST_PIXELS:
        return ""
    return (
        f"it says that it has {width} x {height} pixels; "
        f"at most {MOST_PIXELS // 1_000_000} million are read"
    )


def encoded_image_size(data: bytes) -> Optional[Tuple[int, int]]:
    """Return (width, height) [pixels] as the header of a JPEG or PNG has them; None without one."""
    if data.startswith(_PNG_SIGNATURE) and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return width, height
    if not data.startswith(_JPEG_START):
        return None
    position = 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        if marker == 0xFF:  # padding before a marker
            position += 1
        else:
            position += 2 + int(struct.unpack_from(">H", data, position + 2)[0])
    return None


def _png_damage(data: bytes) -> str:
    position = len(_PNG_SIGNATURE)
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        name, end = data[position + 4 : position + 8], position + 8 + length
        if end + 4 > len(data):
            break
        if struct.unpack_from(">I", data, end)[0] != zlib.crc32(data[position + 4 : end]):
            return f"the PNG is damaged at byte {position} (checksum)"
        if name == b"IEND":
            return ""
        position = end + 4
    return f"the PNG is cut off after {len(data)} bytes"
