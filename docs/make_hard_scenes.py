"""Contact sheets of hard scenes with their labels, ``docs/pictures/hard_{lidar3d,depth}.jpg``.

``python3 docs/make_hard_scenes.py``: the first frames of each difficulty and kind of sensor of
the tests, searched without a seed but where the view cuts the board. Inside green, border red;
brighter is nearer. LiDARs' pictures are what the sensor sees, by azimuth and elevation.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import List, Tuple

import cv2
import numpy as np
from make_label_sheets import FOLDER, _sheet, _write

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "atom_core" / "tests" / "labeling"))
from hard_labels import CAMERA, Measured, judged, measured, world_T_sensor  # noqa: E402
from hard_scenes import DIFFICULTIES, IMAGES, KINDS, Frame, hard_frame, middle_of  # noqa: E402

from atom_core.geometry import se3  # noqa: E402

WIDTH, HEIGHT, LINE = 200, 166, 16  # of a tile [px]
SCALE = 4  # tiles are drawn larger
CUT = "cut by the view"
OUTSIDE = 0.35  # of the board's size, shown around it
LIDARS = [kind for kind in KINDS if kind not in IMAGES]


def main() -> None:
    """Write both sheets."""
    lidar, depth = [], []
    for difficulty in DIFFICULTIES:
        if difficulty == "another one, cut":
            continue
        if difficulty != "sun":
            lidar += [_tile(difficulty, kind, 0) for kind in LIDARS]
        depth += [_tile(difficulty, "depth", number) for number in range(2)]
    _write(FOLDER / "hard_lidar3d.jpg", _rows(lidar, len(LIDARS)))
    _write(FOLDER / "hard_depth.jpg", _sheet(depth))


def _rows(tiles: List[np.ndarray], columns: int) -> np.ndarray:
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    return np.vstack(rows)


def _tile(difficulty: str, kind: str, number: int) -> np.ndarray:
    frame = hard_frame(difficulty, kind, number)
    seen = measured(frame)
    at_seed, searched = judged(frame, seen)
    is_cut = difficulty == CUT and at_seed is not None
    labeled = (at_seed if is_cut else searched).labeled
    label = labeled.label
    size = (WIDTH * SCALE, (HEIGHT - LINE) * SCALE)
    pixels, away = _pixels(frame, seen, size)
    picture = _drawn(pixels, away, size, kind)
    for indices, colour in ((label.indices, (0, 200, 0)), (label.limit_indices, (0, 0, 255))):
        for x, y in np.rint(pixels[indices]).astype(int):
            cv2.circle(picture, (x, y), SCALE, colour, -1)
    small = cv2.resize(picture, (WIDTH, HEIGHT - LINE), interpolation=cv2.INTER_AREA)
    tile = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    tile[LINE:] = small
    caption = f"{difficulty}, {kind}" + ("" if labeled.detected else ": none")
    cv2.putText(
        tile, caption, (3, 11), cv2.FONT_HERSHEY_SIMPLEX, 0.34, (255, 255, 255), 1, cv2.LINE_AA
    )
    return tile


def _pixels(frame: Frame, seen: Measured, size: Tuple[int, int]) -> Tuple[np.ndarray, np.ndarray]:
    """Return where points appear in a picture around the board, and how far they are [m]."""
    board = frame.scene.world_T_board
    plate = frame.other if board is None else None
    border = frame.border if plate is None else plate.border
    middle = middle_of(board, border) if plate is None else middle_of(*plate)
    sensor_T_world = se3.inverse(world_T_sensor(frame))
    centre = _angles(frame, se3.apply(sensor_T_world, middle[None]))[0]
    away = np.linalg.norm(se3.apply(sensor_T_world, middle[None])[0])
    reach = (0.5 + OUTSIDE) * 2.0 * float(np.hypot(*border.half_size)) / away
    scale = size[1] / (2.0 * reach)
    pixels = (_angles(frame, seen.points) - centre) * scale + np.array(size) / 2.0
    return np.where(np.isfinite(pixels), pixels, -1e4), np.linalg.norm(seen.points, axis=1)


def _angles(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Return how far right and down of ahead points (n, 3) are seen [rad]."""
    if frame.kind == "depth":
        return (CAMERA.project(points) - CAMERA.K[:2, 2]) / CAMERA.focal_px.mean()
    flat = np.hypot(points[:, 0], points[:, 1])
    right = -np.arctan2(points[:, 1], points[:, 0])
    return np.column_stack([right, -np.arctan2(points[:, 2], flat)])


def _drawn(pixels: np.ndarray, away: np.ndarray, size: Tuple[int, int], kind: str) -> np.ndarray:
    picture = np.zeros((size[1], size[0], 3), np.uint8)
    inside = np.all((pixels >= 0) & (pixels < size), axis=1) & np.isfinite(away)
    if not inside.any():
        return picture
    near, far = np.quantile(away[inside], [0.02, 0.98])
    grey = 230.0 - 170.0 * np.clip((away - near) / max(far - near, 0.05), 0.0, 1.0)
    radius = SCALE // 2 + 1 if kind != "depth" else SCALE
    for i in np.flatnonzero(inside):
        x, y = (int(v) for v in pixels[i])
        cv2.circle(picture, (x, y), radius, (int(grey[i]),) * 3, -1)
    return picture


if __name__ == "__main__":
    main()
