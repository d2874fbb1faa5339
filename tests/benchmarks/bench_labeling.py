"""Speed and accuracy of the labelers on synthetic pictures and depth images.

``python3 tests/benchmarks/bench_labeling.py``; rates are per second of processor time of one core,
by the median over all pictures, so that other programs disturb them little. The goals are those of
two cores; collectors label images on both.
"""

from __future__ import annotations

import argparse
import time
from typing import Callable, List, Tuple

import cv2
import numpy as np

from atom_core.geometry import se3
from atom_core.labeling.charuco import CharucoFinder
from atom_core.labeling.chessboard import ChessboardFinder
from atom_core.labeling.depth import DepthLabeler
from atom_core.labeling.rgb import LEAST_SHARE, RgbLabeler
from atom_core.model.dataset import Dataset
from atom_core.model.dataset import pose as pose_of
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.sensor import DEPTH, RGB
from atom_core.report.tables import text_table
from atom_core.synthetic import Noise, paper_cell, scenes
from atom_core.synthetic.board_pictures import charuco_pictures, chessboard_pictures, corner_errors

PATTERN = "pattern_1"
WRONG_PX = 5.0  # a corner farther off is another one
GOALS = {RGB: 15.0, DEPTH: 60.0}  # images a second


def main() -> None:
    """Run all benchmarks and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--chessboards", type=int, default=500, help="pictures, also of ChArUcos")
    args = parser.parse_args()
    cv2.setNumThreads(1)
    synthetic = paper_cell(args.seed, noise=Noise(corner_px=0.0))
    dataset = synthetic.dataset
    boards = {key: pose for (_, key), pose in synthetic.truth.boards.items()}
    rows = [
        rgb(dataset, boards, args.repeat),
        depth(dataset, True, args.repeat),
        depth(dataset, False, 1),
        chessboards(args.chessboards, args.seed),
        charucos(args.chessboards, args.seed),
        without_board(args.repeat),
    ]
    columns = ["labeler", "images", "found", "images / core s", "goal", "accuracy"]
    print(text_table(columns, rows))


def rgb(dataset: Dataset, boards: dict, repeat: int) -> List[str]:
    """Label the cameras' pictures, with noise of two grey levels."""
    pattern, config = dataset.patterns[PATTERN], dataset.config.calibration_patterns[PATTERN]
    rng = np.random.default_rng(0)
    seconds, errors, found, count = [], [], 0, 0
    for key, label in dataset.detections():
        sensor = dataset.sensors[key.sensor]
        if not isinstance(label, RgbLabel) or sensor.camera is None:
            continue
        clean = dataset.data.read(key.collection, key.sensor)
        noise = 2.0 * rng.standard_normal(clean.shape)
        image = np.clip(np.rint(clean * 0.85 + 10 + noise), 0, 255).astype(np.uint8)
        labeler = RgbLabeler(sensor, pattern, config)
        result, spent = timed(lambda: labeler.label(image), repeat)  # noqa: B023
        seconds.append(spent)
        count, found = count + 1, found + result.detected
        collection = dataset.collections[key.collection]
        sensor_T_world = pose_of(collection, dataset.graph, sensor.frame, dataset.world)
        in_camera = sensor_T_world @ boards[key.collection]
        corners = se3.apply(in_camera, pattern.corners_of(result.label.ids))
        errors.append(result.label.pixels - sensor.camera.project(corners))
    error = np.concatenate(errors)
    rms, bias = np.sqrt(np.mean(error**2, axis=0)), error.mean(axis=0)
    accuracy = f"rms {rms[0]:.3f} {rms[1]:.3f} px, bias {bias[0]:+.4f} {bias[1]:+.4f} px"
    return row("rgb 1280x800 charuco", count, found, seconds, GOALS[RGB], accuracy)


def chessboards(count: int, seed: int) -> List[str]:
    """Label chessboards of all sizes, polarities and turns, blurred, noisy, of 8 px and more."""
    seconds, errors, mild, found, wrong = [], [], [], 0, 0
    for picture in chessboard_pictures(scenes.COLOUR_CAMERA, count, seed):
        finder = ChessboardFinder(*picture.config.dimension)
        result, spent = timed(lambda: finder.find(picture.image), 1)  # noqa: B023
        seconds.append(spent)
        if result.corners is None:
            continue
        error, ordered = corner_errors(picture, result.corners.pixels)
        found, wrong = found + 1, wrong + (not ordered)
        errors.append(error)
        if picture.blur_px == 1.0:
            mild.append(error)
    bias = np.concatenate(errors).mean(axis=0)
    rms = np.sqrt(np.mean(np.concatenate(mild) ** 2, axis=0))
    accuracy = (
        f"rms {rms[0]:.3f} {rms[1]:.3f} px at blur 1, bias {bias[0]:+.4f} {bias[1]:+.4f} px, "
        f"{wrong} in wrong order, mean {1000.0 * np.mean(seconds):.0f} ms"
    )
    return row("rgb 1280x800 chessboard", count, found, seconds, float("nan"), accuracy)


def charucos(count: int, seed: int) -> List[str]:
    """Label ChArUcos of all sizes and polarities; those with small squares show no markers."""
    seconds, errors, found, wrong = [], [], 0, 0
    for picture in charuco_pictures(scenes.COLOUR_CAMERA, count, seed):
        config = picture.config
        assert config.inner_size is not None and config.dictionary is not None
        share = config.inner_size / config.size
        finder = CharucoFinder(*config.dimension, share, config.dictionary)
        camera = scenes.COLOUR_CAMERA
        result, spent = timed(lambda: finder.find(picture.image, camera), 1)  # noqa: B023
        seconds.append(spent)
        if len(result.ids) < LEAST_SHARE * len(picture.corners_px):
            continue
        error = result.corners.pixels - picture.corners_px[result.ids]
        found, wrong = found + 1, wrong + bool(np.abs(error).max() > WRONG_PX)
        errors.append(error)
    error = np.concatenate(errors)
    rms, bias = np.sqrt(np.mean(error**2, axis=0)), error.mean(axis=0)
    accuracy = (
        f"rms {rms[0]:.3f} {rms[1]:.3f} px, bias {bias[0]:+.4f} {bias[1]:+.4f} px, "
        f"{wrong} wrong, mean {1000.0 * np.mean(seconds):.0f} ms"
    )
    return row("rgb 1280x800 charuco, any", count, found, seconds, float("nan"), accuracy)


def without_board(repeat: int) -> List[str]:
    """Look for a ChArUco where there is none: a wall, noise of 0 to 12 grey values; boxes."""
    rng, seconds, found = np.random.default_rng(0), [], 0
    finder = CharucoFinder(11, 8, 0.75, "DICT_5X5_100")
    for noise in (0.0, 2.0, 4.0, 8.0, 12.0):
        for boxes in (0, 120):
            image = np.full((720, 1280), 128.0)
            for _ in range(boxes):
                (x, y), (width, height) = rng.integers(0, (1280, 720)), rng.integers(8, 150, 2)
                image[y : y + height, x : x + width] = rng.uniform(20.0, 235.0)
            image = cv2.GaussianBlur(image, (0, 0), 0.7) + noise * rng.standard_normal(image.shape)
            picture = np.clip(np.rint(image), 0, 255).astype(np.uint8)
            result, spent = timed(lambda: finder.find(picture), repeat)  # noqa: B023
            seconds.append(spent)
            found += len(result.ids) > 0
    times = ", ".join(f"{1000.0 * spent:.0f}" for spent in seconds)
    accuracy = f"wall, boxes by noise: {times} ms"
    return row("rgb 1280x720 no charuco", len(seconds), found, seconds, float("nan"), accuracy)


def depth(dataset: Dataset, with_seed: bool, repeat: int) -> List[str]:
    """Label the depth images, from a seed on the board or by a search."""
    pattern = dataset.patterns[PATTERN]
    seconds, errors, found, count = [], [], 0, 0
    for key, label in dataset.detections():
        sensor = dataset.sensors[key.sensor]
        if not isinstance(label, RangeLabel) or sensor.modality != DEPTH:
            continue
        image = dataset.data.read(key.collection, key.sensor)
        rows, columns = np.divmod(label.indices, image.shape[1])
        seed = np.array([columns.mean(), rows.mean()]) if with_seed else None
        labeler = DepthLabeler(sensor, pattern)
        result, spent = timed(lambda: labeler.label(image, seed), repeat)  # noqa: B023
        seconds.append(spent)
        count, found = count + 1, found + result.detected
        if result.detected:
            errors.append(np.linalg.norm(result.next_seed - [columns.mean(), rows.mean()]))
    how = "seed" if with_seed else "search"
    goal = GOALS[DEPTH] if with_seed else float("nan")
    accuracy = f"centroid within {np.max(errors):.1f} px"
    return row(f"depth 640x480 {how}", count, found, seconds, goal, accuracy)


def timed(call: Callable, repeat: int) -> Tuple:
    """Return the call's result and its shortest processor time [s]."""
    spent = []
    for _ in range(repeat):
        start = time.process_time()
        result = call()
        spent.append(time.process_time() - start)
    return result, min(spent)


def row(
    name: str, count: int, found: int, seconds: List[float], goal: float, accuracy: str
) -> List[str]:
    """Return a row of the table."""
    aim = "" if np.isnan(goal) else f"{goal:.0f}"
    return [name, str(count), str(found), f"{1.0 / np.median(seconds):.0f}", aim, accuracy]


if __name__ == "__main__":
    main()
