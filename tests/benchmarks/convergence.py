"""Does every start lead to the same answer? A hundred cells and a hundred rigs of other kinds.

Each is calibrated from the exact start, from a start moved by 0.5 m and 0.5 rad, and with no
guess at all, its description moved by 3 m and 2 rad. A run counts when it converges to the answer
that the exact start gives, to a micrometre, and that answer is near the truth. Prints a table and
writes convergence.csv; alone: `python3 tests/benchmarks/convergence.py --count 100`.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Dict, List

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.commands.progress import watched
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED
from atom_core.synthetic import disturbed, paper_cell, scenes
from atom_core.synthetic.dataset import SyntheticDataset

NEAR, FAR = (0.5, 0.5), (3.0, 2.0)  # metres, radians
SAME_M, NEAR_TRUTH_M = 1e-6, 0.03
KINDS = (
    scenes.random_scene,
    scenes.lidar_only,
    scenes.shared_edge,
    scenes.two_patterns,
    scenes.two_cameras,
    scenes.hand_eye,
    scenes.board_on_arm,
)


def convergence(output: Path, count: int) -> None:
    """Run `count` cells and as many other rigs."""
    rows = []
    for seed in watched(range(count), count, "starts of cells", "cells"):
        rows += _three_starts("paper_cell", seed, paper_cell(seed))
    for i in watched(range(count), count, "starts of other rigs", "rigs"):
        kind, seed = KINDS[i % len(KINDS)], i // len(KINDS)
        rows += _three_starts(kind.__name__, seed, kind(seed, collections=12))
    output.mkdir(parents=True, exist_ok=True)
    with (output / "convergence.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    _print(rows)


def _three_starts(kind: str, seed: int, exact: SyntheticDataset) -> List[Dict[str, object]]:
    far = disturbed(exact, FAR, np.random.default_rng([seed, 900]))
    reference = calibrate(exact.dataset)
    starts = {
        "0.5 m, 0.5 rad": (exact, CalibrationOptions(noisy_initial_guess=NEAR, seed=seed)),
        "no guess": (far, CalibrationOptions(initial_guess="none")),
        "3 m, 2 rad": (far, CalibrationOptions()),
    }
    rows = []
    for name, (scene, options) in starts.items():
        result = calibrate(scene.dataset, options)
        apart, wrong = 0.0, 0.0
        for edge, true in exact.truth.edges.items():
            found = result.dataset.first_value(edge)[:3, 3]
            apart = max(apart, float(np.linalg.norm(found - _place(reference, edge))))
            wrong = max(wrong, float(np.linalg.norm(found - true[:3, 3])))
        good = result.status == CONVERGED and apart < SAME_M and wrong < NEAR_TRUTH_M
        rows.append(
            {
                "start": name,
                "rig": kind,
                "seed": seed,
                "status": result.status,
                "good": good,
                "apart_mm": 1e3 * apart,
                "worst_edge_mm": 1e3 * wrong,
                "iterations": result.summary.iterations,
                "seconds": sum(result.seconds.values()),
            }
        )
    return rows


def _place(calibration, edge) -> np.ndarray:
    return calibration.dataset.first_value(edge)[:3, 3]


def _print(rows: List[Dict[str, object]]) -> None:
    table = []
    for start in dict.fromkeys(row["start"] for row in rows):
        for cell in (True, False):
            mine = [r for r in rows if r["start"] == start and (r["rig"] == "paper_cell") == cell]
            table.append(
                [
                    start,
                    "paper's cell" if cell else "other rigs",
                    f"{sum(bool(r['good']) for r in mine)} of {len(mine)}",
                    max(float(r["apart_mm"]) for r in mine),
                    max(float(r["worst_edge_mm"]) for r in mine),
                    float(np.median([r["seconds"] for r in mine])),
                ]
            )
    headers = [
        "start",
        "rigs",
        "to the truth",
        "from the exact start's answer, at most [mm]",
        "from the truth, at most [mm]",
        "median [s]",
    ]
    print(text_table(headers, table, "Convergence", 4))
    for row in rows:
        if not row["good"]:
            print(f"missed: {row}")
    print()


def main() -> None:
    """Run alone."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench_output"))
    parser.add_argument("--count", type=int, default=100)
    args = parser.parse_args()
    convergence(args.output, args.count)


if __name__ == "__main__":
    main()
