"""What a calibration says when its assumptions do not hold.

Each fault of `synthetic/faults.py` is planted into scenes that start beside the truth, and
calibrated with the defaults. The table shows the worst sensor against the truth, in millimetres
and in stated sigmas (of the six numbers of a pose the worst), the verdict, and what was seen before
model checks, misfits and robust sigmas. An answer is *confidently wrong* where it is called
`converged`, and a sensor is more than three sigmas and three millimetres off. Prints a table and
writes trust.csv; alone: `python3 tests/benchmarks/trust.py --seeds 3`.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any, Dict, List, Mapping, Sequence

import numpy as np

from atom_core.calibration.calibrate import calibrate
from atom_core.errors import AtomError
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED
from atom_core.solvers.choice import default_solver
from atom_core.synthetic.faults import FAULTS

SIGMAS, WRONG_M = 3.0, 0.003
# What users' data of this kind gave in November 2026, before anything of it was said.
# Every one was called `converged`. Scenes and sizes of the faults are alike, not the same.
BEFORE_DATE = "2026-11"
BEFORE = {
    "every LiDAR reads 30 mm long": "33-36 mm, sigma 0.8 mm",
    "blur, LiDARs noisy and 20 mm long, depth ripples": "22-27 mm, 15 sigma",
    "depth in steps, 5 % holes, waves of 10 mm": "3 mm, 10 sigma",
    "no ids, rgb_2 upside down": "245 mm, 179.5 deg",
    "print 20 mm off centre, camera and depth": "150 mm, sigma 0.84 mm",
    "board 3 % large, camera and LiDAR": "116 mm",
    "board 10 % large, two cameras and LiDAR": "218 and 302 mm",
    "board 5 % large": "mean 86 mm",
    "lidar_1: labels of others in 40 %": "metres (mean of sensors 361 mm)",
    "lidar_1: mirrored in y": "mean of sensors 171 mm",
    "lidar_1: exchanged in 20 %": "20-40 %: 16 of 27 0.2-3.1 m, 15 converged",
    "lidar_1: exchanged in 30 %": "see 20 %",
    "lidar_1: exchanged in 40 %": "see 20 %",
    "rgb_1: exchanged in 30 %": "0 of 24 wrong",
    "depth ten times too far": "mean 1,087 mm",
    "K of two cameras swapped": "mean 129 mm",
    "rgb_1: focal length 2 % long": "mean 6.6 mm",
    "rgb_1: focal length 10 % long": "mean 32 mm",
    "camera on an arm, arm 5 mm and 1 deg off": "148 mm, sigma 6 mm",
}


def trust(output: Path, seeds: int) -> None:
    """Plant every fault into a scene of each seed; print the table, write trust.csv."""
    rows = [_row(fault, seed) for fault in FAULTS for seed in range(seeds)]
    output.mkdir(parents=True, exist_ok=True)
    with (output / "trust.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    headers = ["fault", "wrong", "confidently", "worst [mm]", "worst [sigma]", "verdicts"]
    headers.append(f"before ({BEFORE_DATE})")
    print(text_table(headers, [_summary(fault, rows) for fault in FAULTS], "Planted faults", 1))
    wrong = sum(bool(row["confidently_wrong"]) for row in rows)
    print(f"confidently wrong: {wrong} of {len(rows)}, to reach 0")


def _row(fault: str, seed: int) -> Dict[str, object]:
    scene = FAULTS[fault](seed)
    row: Dict[str, object] = {"fault": fault, "seed": seed}
    try:
        result = calibrate(scene.dataset)
    except AtomError as error:
        figures = {"worst_mm": float("nan"), "worst_sigmas": float("nan")}
        said = {"status": "refused", "message": str(error), "warnings": ""}
        return {**row, **figures, "wrong": False, "confidently_wrong": False, **said}
    errors = stated_errors(calibration_results(result, default_solver()).edges, scene.truth)
    wrong = any(e.translation_m > WRONG_M and e.in_sigmas > SIGMAS for e in errors)
    return {
        **row,
        "worst_mm": 1000.0 * max(error.translation_m for error in errors),
        "worst_sigmas": max(error.in_sigmas for error in errors),
        "wrong": wrong,
        "confidently_wrong": wrong and result.status == CONVERGED,
        "status": result.status,
        "message": result.message,
        "warnings": " | ".join(result.warnings),
    }


def _summary(fault: str, rows: Sequence[Mapping[str, Any]]) -> List[object]:
    mine = [row for row in rows if row["fault"] == fault]
    statuses = [str(row["status"]) for row in mine]
    verdicts = ", ".join(f"{statuses.count(s)} {s}" for s in dict.fromkeys(statuses))
    worst = [np.nanmax([row[key] for row in mine] + [0.0]) for key in ("worst_mm", "worst_sigmas")]
    counts = [sum(bool(row[key]) for row in mine) for key in ("wrong", "confidently_wrong")]
    said = [*(f"{count} of {len(mine)}" for count in counts), *worst, verdicts]
    return [fault, *said, BEFORE.get(fault, "")]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench_output"))
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    trust(arguments.output, arguments.seeds)
