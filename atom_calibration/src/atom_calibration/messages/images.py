"""Images and depth images: messages to arrays and back.

Messages out of a bag have types generated on the fly, so a message is known by its ``_type`` and
read by its fields; nothing here needs a master.
"""

from __future__ import annotations

import logging
from functools import lru_cache
from typing import Any, Dict, Optional, Tuple

import numpy as np
from sensor_msgs.msg import Image

from atom_calibration.errors import MessageError
from atom_core import opencv as cv2
from atom_core.io.encoded_images import decode_image, encoded_image_size
from atom_core.io.rvl import decode_rvl, rvl_image_size

IMAGE, COMPRESSED_IMAGE = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
_CHANNEL_TYPES = {
    "8U": "u1",
    "8S": "i1",
    "16U": "u2",
    "16S": "i2",
    "32S": "i4",
    "32F": "f4",
    "64F": "f8",
}
# Kind and number of channels, and the code by which OpenCV makes blue, green, red of them, without
# the fourth: it is full where the colours fill ten or twelve bits of 16, and would hide that.
_COLOURS: Dict[str, Tuple[str, int, Optional[str]]] = {
    "bgr8": ("u1", 3, None),
    "rgb8": ("u1", 3, "COLOR_RGB2BGR"),
    "bgra8": ("u1", 4, None),
    "rgba8": ("u1", 4, "COLOR_RGB2BGR"),
    "mono8": ("u1", 1, "COLOR_GRAY2BGR"),
    "8UC1": ("u1", 1, "COLOR_GRAY2BGR"),
    "8UC3": ("u1", 3, None),
    "8UC4": ("u1", 4, None),
    "bgr16": ("u2", 3, None),
    "rgb16": ("u2", 3, "COLOR_RGB2BGR"),
    "bgra16": ("u2", 4, None),
    "rgba16": ("u2", 4, "COLOR_RGB2BGR"),
    "16UC3": ("u2", 3, None),
    "16UC4": ("u2", 4, None),
    "mono16": ("u2", 1, "COLOR_GRAY2BGR"),
    "yuv422": ("u1", 2, "COLOR_YUV2BGR_UYVY"),
    "yuv422_yuy2": ("u1", 2, "COLOR_YUV2BGR_YUYV"),
    # OpenCV names a Bayer pattern by its second row, ROS by its first.
    "bayer_rggb8": ("u1", 1, "COLOR_BayerBG2BGR"),
    "bayer_bggr8": ("u1", 1, "COLOR_BayerRG2BGR"),
    "bayer_gbrg8": ("u1", 1, "COLOR_BayerGR2BGR"),
    "bayer_grbg8": ("u1", 1, "COLOR_BayerGB2BGR"),
    "bayer_rggb16": ("u2", 1, "COLOR_BayerBG2BGR"),
    "bayer_bggr16": ("u2", 1, "COLOR_BayerRG2BGR"),
    "bayer_gbrg16": ("u2", 1, "COLOR_BayerGR2BGR"),
    "bayer_grbg16": ("u2", 1, "COLOR_BayerGB2BGR"),
}
_PIXELS_FOR_A_HOT_ONE = 10_000  # which is as bright as 16 bits can tell, whatever was measured
_DEPTHS = (8, 10, 12, 16)  # bits in which cameras measure
_MILLIMETRE = 0.001  # REP 118: depths of whole numbers are millimetres
_DEPTH_ENCODINGS = ("16UC1", "32FC1", "64FC1")  # encodings that depth cameras use
_COMPRESSED_DEPTH_HEADER = 12  # bytes of compressed_depth_image_transport before the image


def colour_image(message: Any) -> np.ndarray:
    """Return an Image or CompressedImage as (height, width, 3) uint8, blue green red.

    Raises:
        MessageError: the image is empty, cut off, or in an encoding that is not known.
    """
    if message._type == COMPRESSED_IMAGE:
        encoding = message.format.split(";")[0].strip()
        _refuse_depth(encoding)
        # With all bits, since OpenCV takes the upper eight of 16, where a camera of 12 has four.
        as_stored = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
        image = _eight_bits(_decompressed(message, as_stored))
        # compressed_image_transport packs the pixels of a Bayer pattern as if they were grey
        of_one = encoding if encoding.startswith("bayer_") and encoding in _COLOURS else "mono8"
        return image if image.ndim == 3 else _converted(image, _COLOURS[of_one][2])
    _refuse_depth(message.encoding)
    if message.encoding not in _COLOURS:
        raise MessageError(
            f"encoding '{message.encoding}' is no colour or grey image that is known; use one of "
            f"{', '.join(_COLOURS)}"
        )
    kind, channels, conversion = _COLOURS[message.encoding]
    if message.encoding.startswith("yuv422") and message.width % 2:
        raise MessageError(  # OpenCV would read and write beyond its end
            f"the image has {message.width} columns; {message.encoding} has one colour for two "
            f"pixels side by side, so their number is even; correct the driver's width"
        )
    pixels = _pixels(message, kind, channels)
    image = _eight_bits(np.ascontiguousarray(pixels[..., :3]) if channels == 4 else pixels)
    return _converted(image, conversion)


def _converted(image: np.ndarray, conversion: Optional[str]) -> np.ndarray:
    return image if conversion is None else cv2.cvtColor(image, getattr(cv2, conversion))


def _refuse_depth(encoding: str) -> None:
    if encoding in _DEPTH_ENCODINGS:
        raise MessageError(
            f"encoding '{encoding}' is no colour or grey image, but a depth image; set `modality: "
            f"depth` for this sensor, or name the topic of its colour images"
        )


def depth_image(message: Any) -> np.ndarray:
    """Return a depth Image or CompressedImage as (height, width) float32 [m], NaN where none.

    Whole numbers are millimetres and 0 is no depth (REP 118); other numbers are metres.

    Raises:
        MessageError: the image is empty, cut off, or no depth image.
    """
    if message._type == COMPRESSED_IMAGE:
        stored = _decompressed_depth(message)
    elif message.encoding in ("16UC1", "mono16"):
        stored = _pixels(message, "u2", 1)
    elif message.encoding in ("32FC1", "64FC1"):
        stored = _pixels(message, _CHANNEL_TYPES[message.encoding[:-2]], 1)
    else:
        raise MessageError(
            f"encoding '{message.encoding}' is no depth image; use 16UC1 (millimetres) or 32FC1 "
            f"(metres)"
        )
    scale = _MILLIMETRE if stored.dtype.kind == "u" else 1.0
    with np.errstate(invalid="ignore", over="ignore"):
        depth_m = (stored * np.float32(scale)).astype(np.float32)
        depth_m[~(np.isfinite(depth_m) & (depth_m > 0))] = np.nan
    return depth_m


def image_size(message: Any) -> Optional[Tuple[int, int]]:
    """Return width and height of an Image or CompressedImage [px], None where it does not tell."""
    if hasattr(message, "width"):
        return int(message.width), int(message.height)
    size = rvl_image_size if _is_rvl(message) else encoded_image_size
    return size(bytes(message.data[_depth_header_bytes(message) :]))


def _pixels(message: Any, kind: str, channels: int) -> np.ndarray:
    """Return the pixels (height, width[, channels]) without the padding of the rows."""
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = message.height, message.width, message.step
    row = width * channels * dtype.itemsize
    if not height or not width or not len(message.data):
        raise MessageError(
            f"the image is empty ({width} x {height} pixels, {len(message.data)} bytes); record "
            f"it again, or leave the sensor out"
        )
    if step < row or len(message.data) < step * (height - 1) + row:
        raise MessageError(
            f"the image is cut off: {len(message.data)} bytes in rows of {step} are too few for "
            f"{width} x {height} pixels of {message.encoding}; record it again"
        )
    data = np.frombuffer(message.data, dtype=np.uint8)
    shape, strides = (height, row), (step, 1)
    rows = np.ascontiguousarray(np.lib.stride_tricks.as_strided(data, shape, strides))
    image = rows.view(dtype).astype(dtype.newbyteorder("="), copy=False)
    return image.reshape((height, width) if channels == 1 else (height, width, channels))


def _decompressed(message: Any, flags: int, header_bytes: int = 0) -> np.ndarray:
    data = bytes(message.data[header_bytes:])
    try:
        if _is_rvl(message):
            return decode_rvl(data)
        return decode_image(data, flags, any_encoding=False)
    except ValueError as error:
        raise MessageError(
            f"the compressed image (format '{message.format}', {len(message.data)} bytes) cannot "
            f"be decoded: {error}; record it again"
        ) from error


def _depth_header_bytes(message: Any) -> int:
    """Return how many bytes compressed_depth_image_transport puts before an image, if it did."""
    return _COMPRESSED_DEPTH_HEADER if "compressedDepth" in message.format else 0


def _is_rvl(message: Any) -> bool:
    return "compressedDepth rvl" in message.format


def _decompressed_depth(message: Any) -> np.ndarray:
    """Return what compressed_image_transport or compressed_depth_image_transport packed."""
    header_bytes = _depth_header_bytes(message)
    stored = _decompressed(message, cv2.IMREAD_UNCHANGED, header_bytes)
    if stored.ndim != 2 or stored.dtype != np.uint16:
        raise MessageError(
            f"the compressed image (format '{message.format}') is no depth of 16 bits; is it "
            f"another sensor's, or was it packed as JPEG?"
        )
    if header_bytes and message.format.startswith("32FC1"):
        return _depth_of_inverse(stored, *np.frombuffer(message.data, dtype="<f4", count=3)[1:])
    return stored


def _depth_of_inverse(stored: np.ndarray, a: float, b: float) -> np.ndarray:
    """Return depths [m] of which compressed_depth_image_transport stores ``a / depth + b``.

    It rounds down, so the depth is taken from the middle of the step: with its usual
    ``depth_quantization`` of 100, depths would else be half a millimetre too far at 3 m.
    """
    with np.errstate(divide="ignore"):
        return np.where(stored > 0, a / (stored + np.float32(0.5) - b), np.nan).astype(np.float32)


def _eight_bits(image: np.ndarray) -> np.ndarray:
    """Return an image in 8 bits; drivers put 8, 10, 12 or all 16 bits into 16."""
    if image.dtype == np.uint8:
        return image
    hot = image.size // _PIXELS_FOR_A_HOT_ONE
    highest = int(np.partition(image, image.size - 1 - hot, axis=None)[-1 - hot])
    bits = next(bits for bits in _DEPTHS if highest < 2**bits)
    if bits < _DEPTHS[-1]:
        _say_depth(bits)
    return (np.minimum(image, 2**bits - 1) >> (bits - 8)).astype(np.uint8)


@lru_cache(maxsize=None)  # once for each depth
def _say_depth(bits: int) -> None:
    logging.getLogger(__name__).warning(
        "an image of 16 bits holds values below %d only; they are taken as values of %d bits",
        2**bits,
        bits,
    )


def image_message(array: np.ndarray, encoding: str) -> Image:
    """Return an array (height, width[, channels]) as an Image, without its header."""
    array = np.ascontiguousarray(array)
    height, width = array.shape[:2]
    return Image(
        height=height,
        width=width,
        encoding=encoding,
        step=array.strides[0],
        data=array.tobytes(),
    )
