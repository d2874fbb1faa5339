"""What a camera's shutter, exposure and a shiny board do to a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from atom_core import opencv as cv2

_STEP_PX = 0.25  # of a picture that moves while it is exposed


@dataclass(frozen=True)
class Exposure:
    """How a picture is taken. Corners are where they are in the middle of their own exposure.

    Attributes:
        motion_px: how far the picture moves (x, y) while it is exposed.
        rolling_px: how far it moves (x, y) from the exposure of the first row to that of the last.
        gain: factor on the light; what is brighter than white is white.
        glare: light of a lamp that the board reflects, as a share of white, at ``glare_at_px``;
            it fades with ``glare_size_px``, a standard deviation.
        blur_px: of the lens, standard deviation.
        noise: standard deviation [grey values].
    """

    motion_px: Tuple[float, float] = (0.0, 0.0)
    rolling_px: Tuple[float, float] = (0.0, 0.0)
    gain: float = 1.0
    glare: float = 0.0
    glare_at_px: Tuple[float, float] = (0.0, 0.0)
    glare_size_px: float = 1.0
    blur_px: float = 0.0
    noise: float = 0.0


def exposed(picture: np.ndarray, how: Exposure, rng: np.random.Generator) -> np.ndarray:
    """Return a picture (height, width) uint8 as it is taken."""
    light = _rolled(picture.astype(np.float32), how.rolling_px)
    if how.glare > 0.0:
        height, width = light.shape
        x, y = np.arange(width) - how.glare_at_px[0], np.arange(height) - how.glare_at_px[1]
        away = (y[:, None] ** 2 + x**2) / how.glare_size_px**2
        light = light + 255.0 * how.glare * np.exp(-0.5 * away)
    light = _moved(light, how.motion_px)
    if how.blur_px > 0.0:
        light = cv2.GaussianBlur(light, (0, 0), how.blur_px)
    taken = how.gain * light + how.noise * rng.standard_normal(light.shape)
    return np.clip(np.rint(taken), 0, 255).astype(np.uint8)


def rolled(pixels: np.ndarray, how: Exposure, height: int) -> np.ndarray:
    """Return where pixels (n, 2) of the picture are in the one with a rolling shutter."""
    # a pixel at row y goes to y + late * shift, and is late by its new row
    per_row = np.array(how.rolling_px) / height
    y = (pixels[:, 1] - 0.5 * height * per_row[1]) / (1.0 - per_row[1])
    return pixels + (y - 0.5 * height)[:, None] * per_row


def _rolled(light: np.ndarray, rolling_px: Tuple[float, float]) -> np.ndarray:
    if not any(rolling_px):
        return light
    height, width = light.shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    late = y / height - 0.5
    return cv2.remap(
        light,
        (x - late * rolling_px[0]).astype(np.float32),
        (y - late * rolling_px[1]).astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )


def _moved(light: np.ndarray, motion_px: Tuple[float, float]) -> np.ndarray:
    """Return the mean of a picture over the way that it moves."""
    length = float(np.hypot(*motion_px))
    if length == 0.0:
        return light
    steps = int(np.ceil(length / _STEP_PX)) | 1
    half = np.ceil(np.abs(motion_px) / 2.0).astype(int) + 1
    kernel = np.zeros(2 * half[::-1] + 1, np.float32)
    for part in (np.arange(steps) + 0.5) / steps - 0.5:
        x, y = half + part * np.array(motion_px)
        left, top = int(np.floor(x)), int(np.floor(y))
        for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = (1 - abs(y - top - row)) * (1 - abs(x - left - column))
            kernel[top + row, left + column] += share
    return cv2.filter2D(light, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
