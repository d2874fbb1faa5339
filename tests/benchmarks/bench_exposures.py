"""Corners in pictures that moved, rolled, were exposed badly or shine.

``python3 tests/benchmarks/bench_exposures.py [--pictures 12]``: a chessboard of 8 x 6 corners and a
ChArUco of 11 x 8, 1.0 to 2.2 m before a camera of 900 px, tilted by up to 35 degrees in any roll,
with a lens' blur of 0.7 px and a noise of four grey values. What moves does so in any direction.
"""

from __future__ import annotations

import argparse
from typing import Callable, Dict, List, NamedTuple

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.labeling.rgb import RgbLabeler
from atom_core.labeling.view_quality import clear_squares, corner_view
from atom_core.model.config import PatternConfig
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import RGB, Sensor
from atom_core.model.transforms import Edge
from atom_core.report.tables import text_table
from atom_core.synthetic.board import charuco, chessboard
from atom_core.synthetic.board_image import render
from atom_core.synthetic.exposure import Exposure, exposed, rolled

CAMERA = Camera(
    960, 720, np.array([[900.0, 0.0, 480.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]), model="none"
)
BOARDS = {"chessboard": chessboard(dimension=(8, 6), size=0.06), "charuco": charuco()}
BLUR_PX, NOISE = 0.7, 4.0
GLARE_SIZE_PX = 60.0
WRONG_PX = 5.0  # a corner farther off is another one
Taking = Callable[[np.random.Generator, np.ndarray], Exposure]


class Result(NamedTuple):
    """A picture with its label: errors (n, 2) [px], none where nothing is found."""

    errors: np.ndarray
    smear_px: float
    reason: str


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=12, help="of each case and board")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for board, config in BOARDS.items():
        for case, taking in cases().items():
            results = [labeled(config, taking, seed) for seed in range(args.pictures)]
            rows.append([board, case, *summary(results)])
    columns = ["board", "picture", "found", "wrong order", "bias", "RMS", "smear", "not found"]
    print(text_table(columns, rows))


def cases() -> Dict[str, Taking]:
    """Return how pictures are taken."""
    found: Dict[str, Taking] = {f"moves {px} px": moving(px) for px in (0, 4, 8, 12, 16, 24)}
    found["rolls by up to 20 px"] = lambda rng, _: usual(rolling_px=tuple(rng.uniform(-20, 20, 2)))
    for gain in (0.05, 0.1, 0.2, 1.6, 2.5):
        found[f"{gain} of the light"] = lambda rng, _, gain=gain: usual(gain=gain)
    for glare in (0.4, 0.8, 1.5, 3.0):
        found[f"a lamp, {glare} of white"] = shining(glare)
    return found


def usual(**more) -> Exposure:
    """Return an exposure with usual blur and noise."""
    return Exposure(blur_px=BLUR_PX, noise=NOISE, **more)


def moving(length_px: float) -> Taking:
    """Return a motion in any direction."""

    def taking(rng: np.random.Generator, _: np.ndarray) -> Exposure:
        angle = rng.uniform(0.0, np.pi)
        return usual(motion_px=(length_px * np.cos(angle), length_px * np.sin(angle)))

    return taking


def shining(glare: float) -> Taking:
    """Return a reflection at one of the corners."""

    def taking(rng: np.random.Generator, corners: np.ndarray) -> Exposure:
        at = tuple(corners[rng.integers(len(corners))])
        return usual(glare=glare, glare_at_px=at, glare_size_px=GLARE_SIZE_PX)

    return taking


def labeled(config: PatternConfig, taking: Taking, seed: int) -> Result:
    """Take a picture and label it."""
    rng, pattern = np.random.default_rng(seed), pattern_from_config("board", config)
    pose = drawn_pose(rng, pattern)
    everywhere = CAMERA.project(
        se3.apply(pose, pattern.corners_of(np.arange(pattern.corner_count)))
    )
    clean = render(CAMERA, [((pattern, config), pose)], border_grey=230)[..., 0]
    how = taking(rng, everywhere)
    picture = exposed((0.75 * clean + 25.0).astype(np.uint8), how, rng)
    sensor = Sensor("camera", RGB, "camera", Edge("world", "camera"), CAMERA)
    found = RgbLabeler(sensor, pattern, config).label(picture)
    if not found.detected:
        return Result(np.zeros((0, 2)), np.nan, found.reason)
    truth = rolled(everywhere[found.label.ids], how, CAMERA.height)
    figures = corner_view(picture, pattern, found.label, clear_squares(config), pose)
    return Result(found.label.pixels - truth, figures.get("smear_px", np.nan), "")


def drawn_pose(rng: np.random.Generator, pattern: Pattern) -> np.ndarray:
    """Return ``camera_T_pattern`` of a board in the middle of the picture."""
    distance_m = rng.uniform(1.0, 2.2)
    pose = se3.from_rpy(np.zeros(3), np.radians([*rng.uniform(-35.0, 35.0, 2), 0.0]))
    roll = np.array([0.0, 0.0, np.radians(rng.uniform(-40.0, 40.0))])
    pose = pose @ se3.from_rpy(np.zeros(3), roll)
    middle = np.append(pattern.border.centre, 0.0)
    pose[:3, 3] = [0.0, 0.0, distance_m] - pose[:3, :3] @ middle
    return pose


def summary(results: List[Result]) -> List[str]:
    """Return the cells of a row."""
    seen = [result for result in results if len(result.errors)]
    reasons = sorted({result.reason for result in results if result.reason})
    found = f"{len(seen)} of {len(results)}"
    if not seen:
        return [found, "", "", "", "", "; ".join(reasons)]
    errors = np.concatenate([result.errors for result in seen])
    wrong = sum(bool(np.abs(result.errors).max() > WRONG_PX) for result in seen)
    bias, rms = np.linalg.norm(errors.mean(axis=0)), np.sqrt(np.mean(errors**2))
    smear = np.nanmedian([result.smear_px for result in seen])
    figures = [f"{bias:.3f} px", f"{rms:.3f} px", f"{smear:.1f} px"]
    return [found, str(wrong), *figures, "; ".join(reasons)]


if __name__ == "__main__":
    main()
