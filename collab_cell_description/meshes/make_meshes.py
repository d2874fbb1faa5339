#!/usr/bin/env python3
"""Makes the files beside it: the printed board, and the grooves of aluminium profiles.

The board (OBJ, with a texture) is what ATOM's ``mesh_file`` asks for and what RViz shows. The
grooves are dark strips, 1 m long along z, to be scaled along a beam.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import List, Tuple

import cv2
import numpy as np

from atom_core.model.pattern import pattern_from_config
from atom_core.synthetic.board import charuco
from atom_core.synthetic.board_image import printed

BOARD = "charuco_800x600"
THICKNESS_M = 0.001
PIXELS_PER_SQUARE = 140  # 15 for each field of a marker
MARGIN_PX = 96  # white around the squares, more than the board's border
GROOVE_M, PROUD_M = 0.012, 0.001
Strip = Tuple[Tuple[float, float], Tuple[float, float]]  # low and high corner, across the beam


def main() -> None:
    """Write all files, or with ``--print-only`` the print, which the build asks for."""
    folder = Path(__file__).resolve().parent
    write_print(folder)
    if "--print-only" in sys.argv[1:]:
        return
    write_board(folder)
    offset, half, flat = 0.0225, 0.045, 0.0225
    wide = [strip for side in (-1, 1) for strip in _pair(side * half, offset)]
    turned = [((y0, x0), (y1, x1)) for (x0, y0), (x1, y1) in wide]
    write_strips(folder / "grooves_90x90.stl", wide + turned)
    on_wide = [strip for side in (-1, 1) for strip in _pair(side * flat, offset)]
    on_narrow = [_strip((0.0, side * half), along_x=True) for side in (-1, 1)]
    write_strips(folder / "grooves_45x90.stl", on_wide + on_narrow)


def write_print(folder: Path) -> None:
    """Write what is printed on the board as PNG."""
    settings = [cv2.IMWRITE_PNG_BILEVEL, 1]
    cv2.imwrite(str(folder / f"{BOARD}.png"), board_print(), settings)


def board_print() -> np.ndarray:
    """Return the squares and a white margin, (height, width) uint8."""
    config = charuco()
    squares = printed(pattern_from_config("pattern_1", config), config, PIXELS_PER_SQUARE)
    return np.pad(squares, MARGIN_PX, constant_values=255)


def write_board(folder: Path) -> None:
    """Write the board as OBJ and MTL, in the frame of the pattern."""
    pattern, picture = pattern_from_config("pattern_1", charuco()), board_print()
    corners = pattern.border.corners  # upper left, upper right, lower right, lower left
    pixels = corners * PIXELS_PER_SQUARE / pattern.square_m + MARGIN_PX
    height, width = picture.shape
    on_print = [(u / width, 1.0 - v / height) for u, v in pixels]
    places = [*on_print, (0.001, 0.001)]  # the last is white
    points = [(x, y, z) for z in (0.0, THICKNESS_M) for x, y in corners]
    # Seen from outside each face runs counter-clockwise; the print is seen from -z.
    front = [(1, 1), (4, 4), (3, 3), (2, 2)]
    white = [[5, 6, 7, 8], [1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8]]
    normals = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]
    faces = [front, *[[(corner, 5) for corner in face] for face in white]]
    lines = [f"mtllib {BOARD}.mtl", f"o {BOARD}", "usemtl print"]
    lines += ["v {:.6f} {:.6f} {:.6f}".format(*point) for point in points]
    lines += ["vt {:.8f} {:.8f}".format(*place) for place in places]
    lines += ["vn {} {} {}".format(*normal) for normal in normals]
    lines += [
        "f " + " ".join(f"{corner}/{place}/{number}" for corner, place in face)
        for number, face in enumerate(faces, start=1)
    ]
    (folder / f"{BOARD}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    material = ["newmtl print", "Ka 1 1 1", "Kd 1 1 1", "Ks 0 0 0", f"map_Kd {BOARD}.png"]
    (folder / f"{BOARD}.mtl").write_text("\n".join(material) + "\n", encoding="utf-8")


def write_strips(path: Path, strips: List[Strip]) -> None:
    """Write boxes from z = 0 to 1 as binary STL."""
    triangles = np.array([t for strip in strips for t in _box(strip)], dtype="<f4")
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
    records = np.zeros(len(triangles), dtype=record)
    records["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    records["corners"] = triangles
    header = b"dark strips of an aluminium profile".ljust(80)
    path.write_bytes(header + np.uint32(len(records)).astype("<u4").tobytes() + records.tobytes())


def _pair(x: float, offset: float) -> List[Strip]:
    """Return the two grooves of a face at x."""
    return [_strip((x, y), along_x=False) for y in (-offset, offset)]


def _strip(middle: Tuple[float, float], along_x: bool) -> Strip:
    half = np.array([GROOVE_M, 2 * PROUD_M] if along_x else [2 * PROUD_M, GROOVE_M]) / 2
    low, high = np.array(middle) - half, np.array(middle) + half
    return (low[0], low[1]), (high[0], high[1])


def _box(strip: Strip) -> np.ndarray:
    """Return the triangles (12, 3, 3) of a box, outside counter-clockwise."""
    low, high = np.array([*strip[0], 0.0]), np.array([*strip[1], 1.0])
    bits = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
    corners = low + bits * (high - low)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return np.array([corners[[a, b, c]] for q in quads for a, b, c in [q[:3], (q[0], *q[2:])]])


if __name__ == "__main__":
    main()
