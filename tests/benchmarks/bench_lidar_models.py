"""How well boards are found before each model of a LiDAR, and how well it is calibrated with them.

For each model and seed a rig of two colour cameras and one LiDAR sees twelve boards that geometry
allows to be found (`model_scenes.py`): 1.3 to 3.8 m away, up to 60 degrees off, in any roll, a
person, a box and a table around, every second time a wall close behind. Sensors and board have the
errors of the rough profile. The LiDAR's boards are searched for without a seed.

`calibrated` has the LiDAR against the truth, cameras included in the problem, with the defaults
and with ``--model_errors auto``; `as labeled by the truth` is what the same rig gives with the
scene's own labels, whose every point is right. Alone:
``python3 tests/benchmarks/bench_lidar_models.py --models ouster_64,tof --seeds 2``.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Sequence

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import AUTO, SUGGEST, CalibrationOptions
from atom_core.errors import AtomError
from atom_core.labeling.lidar3d import FoundBoard, find_boards
from atom_core.model.pattern import pattern_from_config
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.report.tables import text_table
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import SyntheticDataset, charuco, disturbed
from atom_core.synthetic.lidar_models import LIDAR_MODELS

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "atom_core" / "tests" / "labeling"))
from model_scenes import LIDAR, Board, labeled, model_cell, outline_errors_m  # noqa: E402

BOARDS, SEEDS = 12, 5
LEAST_FOUND, MOST_OUTLINE_MM, MOST_MM, MOST_DEG = 0.95, 5.0, 5.0, 0.15
_NOMINAL = pattern_from_config("pattern_1", charuco()).border
_DISTURBANCE = (0.05, 0.05)  # m, rad on each free edge
_HEADERS = [
    *("LiDAR", "points", "found", "false", "outline [mm]", "worst", "search [s]"),
    *("default [mm]", "[deg]", "auto [mm]", "[deg]", "true labels [mm]", "[deg]"),
]


class Labels(NamedTuple):
    """What was found in the clouds of one rig."""

    labels: Dict[str, Any]
    outline_rms_m: List[float]
    false: int
    seconds: float


class Error(NamedTuple):
    """A LiDAR against the truth."""

    millimetres: float
    degrees: float
    sigmas: float
    status: str


def is_true(board: Board, found: FoundBoard) -> bool:
    """Tell whether most of what was found is on the board."""
    return bool(board.cloud.on_board[found.labeled.label.indices].mean() > 0.5)


def search(boards: Sequence[Board]) -> Labels:
    """Search all clouds without a seed; the first board found in a cloud is its label."""
    labels, outlines, false = {}, [], 0
    start = time.process_time()
    everything = [find_boards(board.data, _NOMINAL) for board in boards]
    seconds = time.process_time() - start
    for board, found in zip(boards, everything):
        false += sum(not is_true(board, one) for one in found)
        if found:
            labels[board.collection] = found[0].labeled.label
        right = [one for one in found if is_true(board, one)]
        if right:
            errors = outline_errors_m(board, right[0].sensor_T_centre, _NOMINAL)
            outlines.append(float(np.sqrt(np.mean(errors**2))))
    return Labels(labels, outlines, false, seconds)


def calibrated(synthetic: SyntheticDataset, seed: int, model_errors: str) -> Error:
    """Return the error of the LiDAR after a calibration from a disturbed start."""
    start = disturbed(synthetic, _DISTURBANCE, np.random.default_rng([seed, 62]))
    try:
        result = calibrate(start.dataset, CalibrationOptions(model_errors=model_errors))
    except AtomError as error:
        return Error(np.nan, np.nan, np.nan, f"refused: {error}")
    errors = stated_errors(calibration_results(result, default_solver()).edges, start.truth)
    mine = next(error for error in errors if LIDAR in error.sensors)
    degrees = float(np.degrees(np.linalg.norm(mine.error[:3])))
    return Error(1e3 * mine.translation_m, degrees, mine.in_sigmas, result.status)


def measure(name: str, seed: int, boards: int) -> Dict[str, Any]:
    """Return all figures of a model and a seed."""
    cell = model_cell(name, seed, boards)
    by_truth = calibrated(cell.synthetic, seed, AUTO)  # before the scene's clouds are replaced
    found = search(cell.boards)
    with_labels = labeled(cell, found.labels)
    errors = {mode: calibrated(with_labels, seed, mode) for mode in (SUGGEST, AUTO)}
    errors["truth"] = by_truth
    points = float(np.mean([len(board.cloud.points) for board in cell.boards]))
    return {"found": found, "errors": errors, "points": points}


def row(name: str, results: Sequence[Dict[str, Any]], boards: int) -> List[Any]:
    """Return the line of a model: sums, RMS and, of the calibrations, the worst seed."""
    found = [result["found"] for result in results]
    outlines = 1e3 * np.concatenate([one.outline_rms_m for one in found])
    worst: List[float] = []
    for mode in (SUGGEST, AUTO, "truth"):
        errors = [result["errors"][mode] for result in results]
        worst += [max(e.millimetres for e in errors), max(e.degrees for e in errors)]
    return [
        name,
        f"{np.mean([result['points'] for result in results]):.0f}",
        f"{len(outlines)} of {boards * len(results)}",
        str(sum(one.false for one in found)),
        f"{np.sqrt(np.mean(outlines**2)):.1f}",
        f"{outlines.max():.1f}",
        f"{sum(one.seconds for one in found) / (boards * len(results)):.2f}",
        *(f"{value:.{1 + k % 2}f}" for k, value in enumerate(worst)),
    ]


def main() -> None:
    """Print a table by model."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default=",".join(LIDAR_MODELS), help="separated by commas")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--boards", type=int, default=BOARDS, help="of each seed")
    parser.add_argument("--verbose", action="store_true", help="a line for each seed")
    args = parser.parse_args()
    rows = []
    for name in args.models.split(","):
        results = [measure(name, seed, args.boards) for seed in range(args.seeds)]
        rows.append(row(name, results, args.boards))
        for seed, result in enumerate(results if args.verbose else ()):
            print(name, seed, len(result["found"].outline_rms_m), result["errors"], flush=True)
    title = f"LiDAR models, rough profile, {args.seeds} seeds; calibrations: the worst seed"
    print(text_table(_HEADERS, rows, title, 1))
    print(
        f"required: {LEAST_FOUND:.0%} found, none false, outline within {MOST_OUTLINE_MM} mm RMS, "
        f"calibration within {MOST_MM} mm and {MOST_DEG} deg"
    )


if __name__ == "__main__":
    main()
