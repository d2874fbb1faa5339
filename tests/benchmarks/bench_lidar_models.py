"""How well boards are found before each model of a LiDAR, and how well it is calibrated with them.

For each model and seed a rig of two colour cameras and one LiDAR sees 24 boards that geometry
allows to be found (`model_scenes.py`): 1.3 to 3.8 m away, up to 60 degrees off, in any roll, a
person, a box and a table around, every second time a wall close behind. A camera has each of them
in view, too, since what the LiDAR alone sees says nothing of where it is. Sensors and board have
the errors of the rough profile. The LiDAR's boards are searched for without a seed.

Against the truth stand calibrations of the cameras and the LiDAR from a disturbed start, with the
defaults and with ``--model_errors auto``: the worst seed, and the RMS of all. *True labels* is what
the same rigs give with labels whose every point is right. *Known to* is what geometry and noise
allow: the RMS of the standard deviations (three axes together) that the rows of these true labels
leave by the inverse of their information (Cramer and Rao), model errors expected as is usual.
Alone: ``python3 tests/benchmarks/bench_lidar_models.py --models ouster_64,tof --seeds 2``.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

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

BOARDS, SEEDS = 24, 5
LEAST_FOUND, MOST_OUTLINE_MM, MOST_MM, MOST_DEG = 0.95, 5.0, 5.0, 0.15
_NOMINAL = pattern_from_config("pattern_1", charuco()).border
_DISTURBANCE = (0.05, 0.05)  # m, rad on each free edge
_HEADERS = [
    *("LiDAR", "points", "found", "false", "outline [mm]", "worst", "search [ms]"),
    *("default [mm, deg]", "auto: worst", "RMS", "true labels: worst", "RMS", "known to"),
]


class Labels(NamedTuple):
    """What was found in the clouds of one rig."""

    labels: Dict[str, Any]
    outline_rms_m: List[float]
    false: int
    seconds: float


class Error(NamedTuple):
    """A LiDAR against the truth, and one standard deviation of what the rows tell of it."""

    millimetres: float
    degrees: float
    known_millimetres: float
    known_degrees: float
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
        return Error(np.nan, np.nan, np.nan, np.nan, np.nan, f"refused: {error}")
    edges = calibration_results(result, default_solver()).edges
    mine = next(error for error in stated_errors(edges, start.truth) if LIDAR in error.sensors)
    known = next(edge.model_sigma for edge in edges if LIDAR in edge.sensors)
    return Error(
        *_in_mm_and_deg(mine.error),
        *_in_mm_and_deg(known),
        *(mine.in_sigmas, result.status),
    )


def _in_mm_and_deg(numbers: np.ndarray) -> Tuple[float, float]:
    """Return the lengths of the shift and of the turn of (6,) turns [rad] and shifts [m]."""
    turn, shift = np.linalg.norm(numbers[:3]), np.linalg.norm(numbers[3:])
    return 1e3 * float(shift), float(np.degrees(turn))


def measure(name: str, seed: int, boards: int) -> Dict[str, Any]:
    """Return all figures of a model and a seed."""
    cell = model_cell(name, seed, boards, shared=True)
    by_truth = calibrated(cell.synthetic, seed, AUTO)  # before the scene's clouds are replaced
    found = search(cell.boards)
    with_labels = labeled(cell, found.labels)
    errors = {mode: calibrated(with_labels, seed, mode) for mode in (SUGGEST, AUTO)}
    errors["truth"] = by_truth
    points = float(np.mean([len(board.cloud.points) for board in cell.boards]))
    return {"found": found, "errors": errors, "points": points}


def row(name: str, results: Sequence[Dict[str, Any]], boards: int) -> List[Any]:
    """Return the line of a model: sums, and of the calibrations the worst seed and the RMS."""
    found = [result["found"] for result in results]
    outlines = 1e3 * np.concatenate([one.outline_rms_m for one in found])
    errors = {mode: [r["errors"][mode] for r in results] for mode in (SUGGEST, AUTO, "truth")}
    off = {mode: np.array([e[:2] for e in of_seeds]) for mode, of_seeds in errors.items()}
    known = np.array([e[2:4] for e in errors["truth"]])
    return [
        name,
        f"{np.mean([result['points'] for result in results]):.0f}",
        f"{len(outlines)} of {boards * len(results)}",
        str(sum(one.false for one in found)),
        f"{_rms(outlines):.1f}",
        f"{outlines.max():.1f}",
        f"{1e3 * sum(one.seconds for one in found) / (boards * len(results)):.0f}",
        _words(_worst(off[SUGGEST])),
        *(_words(of(off[mode])) for mode in (AUTO, "truth") for of in (_worst, _rms)),
        _words(_rms(known)),
    ]


def _worst(values: np.ndarray) -> np.ndarray:
    """Return the largest of each column."""
    return np.max(values, axis=0)


def _rms(values: np.ndarray) -> np.ndarray:
    """Return the root of the mean square of each column."""
    return np.sqrt(np.mean(values**2, axis=0))


def _words(mm_and_deg: np.ndarray) -> str:
    return f"{mm_and_deg[0]:.1f}, {mm_and_deg[1]:.2f}"


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
        print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
        for seed, result in enumerate(results if args.verbose else ()):
            print(name, seed, len(result["found"].outline_rms_m), result["errors"], flush=True)
    title = f"LiDAR models, rough profile, {args.seeds} seeds; calibrations in mm, deg"
    print(text_table(_HEADERS, rows, title, 1))
    print(
        f"required: {LEAST_FOUND:.0%} found, none false, outline within {MOST_OUTLINE_MM} mm RMS, "
        f"calibration within {MOST_MM} mm and {MOST_DEG} deg"
    )


if __name__ == "__main__":
    main()
