"""Labels of real pictures and clouds, from the folder of $ATOM_TEST_DATA.

``charuco_real``: 28 pictures of a ChArUco; ``acfr_fisheye``, ``visp_eye_in_hand``: 20 and 8 of a
chessboard; ``ouster_board``: 4 clouds with a square board of
1.016 m, found without a seed. The Ouster's returns reach about two centimetres beyond the board
on each side; only the width of its beams, two azimuth steps, accounts for that, and no cloud
tells it.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import List

import cv2
import numpy as np

from atom_core.geometry.rectangle import Rectangle
from atom_core.io.pcd import read_pcd
from atom_core.labeling.beam_width import estimate_beam_width
from atom_core.labeling.charuco import CharucoFinder
from atom_core.labeling.chessboard import ChessboardFinder
from atom_core.labeling.lidar3d import Cloud, Lidar3dOptions, find_boards
from atom_core.report.tables import text_table

DATA = Path(os.environ.get("ATOM_TEST_DATA", Path(__file__).resolve().parents[3] / "shared/data"))
COLUMNS, ROWS, SQUARE_M, MARKER_M = 6, 4, 0.030, 0.022  # inner corners
OUSTER_SIDE_M, OUSTER_STEP_RAD = 1.016, 2.0 * np.pi / 1024


def main() -> None:
    """Print one table."""
    rows = charuco(DATA / "charuco_real") + fisheye(DATA / "acfr_fisheye")
    rows += chessboards(DATA / "visp_eye_in_hand") + ouster(DATA / "ouster_board")
    print(text_table(["", "measured", "goal"], rows, "Real data"))


def charuco(folder: Path) -> List[List[str]]:
    """Find the corners of all pictures, calibrate the camera, compare with OpenCV's corners."""
    finder = CharucoFinder(COLUMNS, ROWS, MARKER_M / SQUARE_M, "DICT_4X4_50")
    row, column = np.mgrid[1 : ROWS + 1, 1 : COLUMNS + 1]
    board = SQUARE_M * np.column_stack([column.ravel(), row.ravel(), np.zeros(row.size)])
    objects, corners, differences = [], [], []
    paths = sorted(folder.glob("*.png"))
    for path in paths:
        image = cv2.imread(str(path))
        found = finder.find(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
        if len(found.ids):
            objects.append(board[found.ids].astype(np.float32))
            corners.append(found.corners.pixels.astype(np.float32))
            differences.append(_beyond_opencv(image, found))
    if not paths:
        return [["charuco_real", "absent", ""]]
    rms, *_ = cv2.calibrateCamera(objects, corners, (1280, 720), None, None)
    shift = np.concatenate(differences).mean(axis=0)
    return [
        ["charuco_real: found", f"{len(objects)} / {len(paths)}", "all"],
        ["charuco_real: RMS after calibration", f"{rms:.3f} px", "<= 0.65 px"],
        [
            "charuco_real: corners minus OpenCV's",
            f"{shift[0]:+.3f}, {shift[1]:+.3f} px",
            "-0.5 +- 0.05 px",
        ],
    ]


def _beyond_opencv(image: np.ndarray, found) -> np.ndarray:
    """Return (n, 2) by how much our corners differ from OpenCV's own, where it has them (4.6)."""
    if not hasattr(cv2.aruco, "CharucoBoard_create"):
        return np.full((1, 2), np.nan)
    markers = cv2.aruco.Dictionary_get(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard_create(COLUMNS + 1, ROWS + 1, SQUARE_M, MARKER_M, markers)
    outlines, ids, _ = cv2.aruco.detectMarkers(image, markers)
    _, raw, raw_ids = cv2.aruco.interpolateCornersCharuco(outlines, ids, image, board)
    _, ours, theirs = np.intersect1d(found.ids, raw_ids.ravel(), return_indices=True)
    return found.corners.pixels[ours] - raw[theirs, 0]


def fisheye(folder: Path) -> List[List[str]]:
    """Find the chessboard 7 x 5 in fisheye pictures, and fit a fisheye camera to its corners."""
    row, column = np.mgrid[0:5, 0:7]
    board = 0.095 * np.column_stack([column.ravel(), row.ravel(), np.zeros(row.size)])
    paths, corners, seconds = sorted(folder.glob("*.png")), [], []
    if not paths:
        return [["acfr_fisheye", "absent", ""]]
    for path in paths:
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        start = time.process_time()
        found = ChessboardFinder(7, 5).find(image).corners
        seconds.append(time.process_time() - start)
        if found is not None:
            corners.append(found.pixels[None])
    flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    rms, *_ = cv2.fisheye.calibrate(
        [board[None]] * len(corners),
        corners,
        (1920, 1208),
        np.eye(3),
        np.zeros((4, 1)),
        flags=flags,
    )
    return [
        ["acfr_fisheye: found", f"{len(corners)} / {len(paths)}", "all"],
        ["acfr_fisheye: RMS of a fisheye camera", f"{rms:.3f} px", "<= 0.14 px"],
        ["acfr_fisheye: processor time", f"{1000.0 * np.mean(seconds):.0f} ms", ""],
    ]


def chessboards(folder: Path) -> List[List[str]]:
    """Find the chessboard 9 x 6 in the pictures of a camera on an arm."""
    paths = sorted(folder.glob("*.png"))
    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths]
    found = sum(ChessboardFinder(9, 6).find(image).corners is not None for image in images)
    return [["visp_eye_in_hand: found", f"{found} / {len(paths)}" if paths else "absent", "all"]]


def ouster(folder: Path) -> List[List[str]]:
    """Search the board in each cloud, with point-like beams and with the Ouster's."""
    half = OUSTER_SIDE_M / 2.0
    border = Rectangle(-half, -half, half, half)
    paths = sorted(folder.glob("*.pcd"))
    rows = []
    files = [read_pcd(path) for path in paths]
    clouds = [Cloud(file.xyz, file.fields["ring"], file.width, file.height) for file in files]
    first = [(cloud, find_boards(cloud, border)) for cloud in clouds]
    seeded = [(cloud, found[0].sensor_T_centre[:3, 3]) for cloud, found in first if found]
    estimated = estimate_beam_width(seeded, border)
    if estimated is None:
        return [["ouster_board, estimated beam width", "none" if paths else "absent", "16 / 16"]]
    widths = {
        "point-like beams": 0.0,
        "beams of two azimuth steps": 2.0 * OUSTER_STEP_RAD,
        f"estimated, {1e3 * estimated.width_rad:.1f} +- {1e3 * estimated.sigma_rad:.1f} mrad from "
        f"{estimated.boards} boards": estimated.width_rad,
    }
    for name, width in widths.items():
        sides, several = [], 0
        for cloud in clouds:
            found = find_boards(cloud, border, Lidar3dOptions(beam_width_rad=width))
            several += len(found) > 1
            if len(found) == 1:
                quality = found[0].labeled.quality
                known = [quality.get(f"measured_{side}_m", np.nan) for side in ("width", "height")]
                sides.append(float(np.nanmean(known)))
        off = ", ".join(f"{100.0 * (side / OUSTER_SIDE_M - 1.0):+.1f}" for side in sides)
        rows.append([f"ouster_board, {name}: found", f"{len(sides)} / {len(paths)}", "16 / 16"])
        rows.append([f"ouster_board, {name}: with a second board", f"{several}", "0"])
        rows.append([f"ouster_board, {name}: side against 1.016 m", f"{off} %", "+- 2 %"])
    return rows


if __name__ == "__main__":
    main()
