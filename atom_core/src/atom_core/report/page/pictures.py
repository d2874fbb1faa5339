"""Images of sensors with labels, boards and clouds drawn on them: arrays in, images out."""

from __future__ import annotations

from typing import Optional, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2

WIDTH_PX = 720  # of a picture in the report
_FOUND, _EXPECTED, _OUTLINE = (0, 140, 255), (60, 20, 220), (255, 220, 0)  # blue green red
_DARKER = 0.55
_QUALITY = 80
_SHEET_COLUMNS, _THUMB = 6, (150, 112)  # columns; width and height of a picture [px]


def as_picture(data: np.ndarray) -> np.ndarray:
    """Return (height, width, 3) uint8 of a colour, grey or depth image.

    Args:
        data: uint8 with or without three channels, or depths (height, width) [m] with NaN.
    """
    if data.dtype == np.uint8:
        return data if data.ndim == 3 else cv2.cvtColor(data, cv2.COLOR_GRAY2BGR)
    low, high = depth_span(data)
    share = np.clip((data.astype(float) - low) / max(high - low, 1e-9), 0.0, 1.0)
    grey = np.where(np.isfinite(share), 40.0 + 200.0 * (1.0 - share), 0.0).astype(np.uint8)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


def depth_span(distances_m: np.ndarray) -> Tuple[float, float]:
    """Return between which distances [m] nearly all finite ones lie."""
    finite = distances_m[np.isfinite(distances_m)]
    if not len(finite):
        return 0.0, 1.0
    low, high = np.quantile(finite, (0.02, 0.98))
    return float(low), float(max(high, low + 1e-3))


def reduced(image: np.ndarray, width: int = WIDTH_PX) -> Tuple[np.ndarray, float]:
    """Return an image no wider than that, and by which factor it was reduced."""
    factor = min(1.0, width / image.shape[1])
    if factor == 1.0:
        return image.copy(), 1.0
    size = (int(round(factor * image.shape[1])), max(1, int(round(factor * image.shape[0]))))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA), factor


def with_cloud(
    image: np.ndarray, pixels: np.ndarray, distances_m: np.ndarray, span_m: Tuple[float, float]
) -> np.ndarray:
    """Return an image, darker and grey, with points coloured by their distance.

    Args:
        image: (height, width, 3) uint8.
        pixels: (n, 2) where the points lie in it [px].
        distances_m: (n,) how far they are [m].
        span_m: what is yellow (near) and what is violet (far).
    """
    small, factor = reduced(image)
    grey = cv2.cvtColor(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    drawn = (_DARKER * grey).astype(np.uint8)
    order = np.argsort(-distances_m)  # near ones cover far ones
    places = np.rint(factor * (pixels[order] + 0.5) - 0.5).astype(int)
    share = (distances_m[order] - span_m[0]) / max(span_m[1] - span_m[0], 1e-9)
    value = np.clip(255.0 * (1.0 - share), 0, 255).astype(np.uint8)
    if not len(value):
        return drawn
    colours = cv2.applyColorMap(value[:, None], cv2.COLORMAP_VIRIDIS)[:, 0]
    height, width = drawn.shape[:2]
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            x, y = (places + (dx, dy)).T
            inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
            drawn[y[inside], x[inside]] = colours[inside]
    return drawn


def with_board(
    image: np.ndarray,
    found: np.ndarray,
    expected: Optional[np.ndarray],
    outline: Optional[np.ndarray],
    width: int = WIDTH_PX // 2,
    ring_px: float = 4.0,
) -> np.ndarray:
    """Return the part of an image around a board, with what was found and what was expected.

    Args:
        image: (height, width, 3) uint8.
        found: (n, 2) labeled pixels: rings.
        expected: (n, 2) where the calibration has them: crosses; None: not drawn.
        outline: (m, 2) of the board's border; None: not drawn.
        width: of the picture [px].
        ring_px: radius of the rings.
    """
    parts = [part for part in (found, outline) if part is not None and len(part)]
    corner, part = _cut_out(image, np.concatenate(parts)) if parts else (np.zeros(2), image)
    factor = width / part.shape[1]
    way = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_LINEAR
    drawn = cv2.resize(part, (width, max(1, int(round(factor * part.shape[0])))), interpolation=way)

    def place(pixels: np.ndarray) -> np.ndarray:
        return np.rint(8.0 * (factor * (pixels - corner + 0.5) - 0.5)).astype(int)

    precise = {"lineType": cv2.LINE_AA, "shift": 3}
    if outline is not None and len(outline):
        cv2.polylines(drawn, [place(outline)], True, _OUTLINE, 1, **precise)
    for x, y in place(found) if len(found) <= 400 else []:
        cv2.circle(drawn, (int(x), int(y)), int(8.0 * ring_px), _FOUND, 1, **precise)
    for x, y in place(expected) if expected is not None else []:
        for dx, dy in ((24, 24), (24, -24)):
            ends = (int(x - dx), int(y - dy)), (int(x + dx), int(y + dy))
            cv2.line(drawn, *ends, _EXPECTED, 1, **precise)
    return drawn


def with_marks(
    image: np.ndarray, inside: np.ndarray, border: Optional[np.ndarray], width: int
) -> np.ndarray:
    """Return the part of an image around a label, its pixels tinted, those of its border bright."""
    marked = image.copy()
    for pixels, colour in ((inside, _FOUND), (border, _OUTLINE)):
        if pixels is not None and len(pixels):
            x, y = np.rint(pixels).astype(int).T
            tint = np.array(colour, dtype=float)
            marked[y, x] = (0.5 * marked[y, x] + 0.5 * tint).astype(np.uint8)
    parts = [part for part in (inside, border) if part is not None and len(part)]
    part = _cut_out(marked, np.concatenate(parts))[1]
    factor = width / part.shape[1]
    size = (width, max(1, int(round(factor * part.shape[0]))))
    return cv2.resize(part, size, interpolation=cv2.INTER_NEAREST)


def board_plot(points: np.ndarray, border: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Return a small picture of a board's plane with the points that a LiDAR labeled.

    Args:
        points: (n, 2) on it [m].
        border: (m, 2) those of its border [m].
        outline: (4, 2) of the board [m].
    """
    width, height = _THUMB
    drawn = np.full((height, width, 3), 255, dtype=np.uint8)
    low, high = outline.min(axis=0), outline.max(axis=0)
    scale = 0.8 * float(np.min(np.array([width, height]) / (high - low)))

    def place(values: np.ndarray) -> np.ndarray:
        middle = 0.5 * np.array([width, height])
        return np.rint(middle + scale * (values - 0.5 * (low + high))).astype(int)

    cv2.polylines(drawn, [place(outline)], True, (120, 120, 120), 1, cv2.LINE_AA)
    for values, colour in ((points, (178, 114, 0)), (border, (0, 80, 178))):
        for x, y in place(values):
            cv2.circle(drawn, (int(x), int(y)), 1, colour, -1)
    return drawn


def contact_sheet(pictures: Sequence[np.ndarray], names: Sequence[str]) -> np.ndarray:
    """Return pictures in rows, each with its name below."""
    width, height = _THUMB
    line = 16
    columns = min(_SHEET_COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = np.full((rows * (height + line), columns * (width + 4), 3), 255, dtype=np.uint8)
    for i, (picture, name) in enumerate(zip(pictures, names)):
        factor = min(width / picture.shape[1], height / picture.shape[0])
        size = tuple(max(1, int(factor * length)) for length in picture.shape[1::-1])
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        top, left = (i // columns) * (height + line), (i % columns) * (width + 4)
        sheet[top : top + size[1], left : left + size[0]] = small
        where = (left + 2, top + height + line - 4)
        cv2.putText(sheet, name, where, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (40, 40, 40), 1, cv2.LINE_AA)
    return sheet


def jpeg(image: np.ndarray) -> bytes:
    """Return the image as a JPEG file."""
    return bytes(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])


def _cut_out(image: np.ndarray, pixels: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the upper left corner (2,) of the part around some pixels, and the part."""
    limits = np.array(image.shape[1::-1])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = 0.2 * (high - low) + 8.0
    low = np.clip(np.floor(low - margin), 0, limits - 2).astype(int)
    high = np.clip(np.ceil(high + margin), low + 2, limits).astype(int)
    return low.astype(float), image[low[1] : high[1], low[0] : high[0]]
