"""What a calibration finds of errors that are planted alone, and of all that real sensors have.

Each error is planted alone into the paper's cell, ten times. The first table shows in how many of
them it is named, named first, and estimated to a fifth of its size. The second one has rigs with
the rough profile (`synthetic/realism.py`), where everything is a little wrong: by kind of sensor
the error, how often 95 % intervals hold the truth, and how errors compare with their sigmas. The
third one has intervals of both sorts of sigmas, where errors are there that no check can see.
Alone: `python3 tests/benchmarks/model_errors.py --rigs 20`.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.options import AUTO, SUGGEST, CalibrationOptions
from atom_core.model.dataset import Dataset
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.report.tables import text_table
from atom_core.solvers.base import CONVERGED
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import mistakes, paper_cell, random_scene
from atom_core.synthetic.dataset import SyntheticDataset
from atom_core.synthetic.realism import PLAIN, ROUGH, SLIGHT, Realism

DISTURBANCE = (0.05, 0.05)
_EXACT = 0.2  # part of the planted size
_WRONG_SIGMAS = 5.0
_MEDIAN_OF_NORMAL = 0.6745


class Planted(NamedTuple):
    """An error that is planted alone.

    Attributes:
        title: as it stands in the table.
        realism: how large.
        name: of the model error that is to be found.
        target: which sensor or board.
        value: what must be estimated, in its unit.
        change: what else is done to the dataset.
    """

    title: str
    realism: Realism
    name: str
    target: str
    value: float
    change: Callable[[Dataset], Dataset] = lambda dataset: dataset


def _one(target: str, **sizes: float) -> Realism:
    return replace(PLAIN, sensors=(target,), **sizes)


BOARD, LIDAR, CAMERA, DEPTH = "pattern_1", "lidar_2", "rgb_1", "depth_1"
PLANTED = (
    Planted("LiDAR 15 mm long", _one(LIDAR, lidar_offset_m=0.015), "range_offset", LIDAR, -0.015),
    Planted("LiDAR 0.5 % far", _one(LIDAR, lidar_scale=0.005), "range_scale", LIDAR, -0.005),
    Planted("depth 0.5 % far", _one(DEPTH, depth_scale=0.005), "depth_scale", DEPTH, -0.005),
    Planted("board 0.5 % large", replace(PLAIN, board_scale=0.005), "board_size", BOARD, 0.005),
    Planted(
        "print 10 mm off centre",
        replace(PLAIN, print_shift_m=(0.010, 0.0)),
        *("border_shift_x", BOARD, -0.010),
    ),
    Planted("focal length 0.5 %", _one(CAMERA, focal_scale=0.005), "focal_length", CAMERA, 0.005),
    Planted("board bent by 2 mm", replace(PLAIN, bend_m=0.002), "bend_x", BOARD, 0.002),
    Planted(
        "azimuths 1 % large",
        PLAIN,
        *("azimuth_scale", LIDAR, -0.01),
        lambda d: mistakes.with_turned_rays(d, LIDAR, azimuth_scale=0.01),
    ),
    Planted(
        "elevations 3 % large",
        PLAIN,
        *("elevation_scale", LIDAR, -0.03),
        lambda d: mistakes.with_turned_rays(d, LIDAR, elevation_scale=0.03),
    ),
    Planted(
        "depth 15 mm far",
        PLAIN,
        *("depth_offset", DEPTH, -0.015),
        lambda d: mistakes.with_longer_depths(d, DEPTH, 0.015),
    ),
    Planted(
        "depth focal length 2 % long",
        PLAIN,
        *("depth_focal_length", DEPTH, -0.02),
        lambda d: mistakes.with_scaled_focal_length(d, DEPTH, 1.02),
    ),
    Planted(
        "depth centre 10 px right",
        PLAIN,
        *("depth_centre_x", DEPTH, -10.0 / 554.26),
        lambda d: mistakes.with_shifted_centre(d, DEPTH, 10.0),
    ),
    Planted(
        "print 1 % longer in x",
        PLAIN,
        *("board_aspect", BOARD, 0.005),
        lambda d: mistakes.with_longer_prints(d, 0.01),
    ),
)


SCENES: Dict[str, Callable[[int], SyntheticDataset]] = {
    "cell, noise alone": lambda seed: paper_cell(seed, disturbance=DISTURBANCE),
    "cell, slight": lambda seed: paper_cell(seed, realism=SLIGHT, disturbance=DISTURBANCE),
    "cell, rough": lambda seed: paper_cell(seed, realism=ROUGH, disturbance=DISTURBANCE),
    "16 collections, slight": lambda seed: random_scene(seed, collections=16, realism=SLIGHT),
    "16 collections, rough": lambda seed: random_scene(seed, collections=16, realism=ROUGH),
    "8 collections, slight": lambda seed: random_scene(seed, collections=8, realism=SLIGHT),
}


def planted_table(rigs: int) -> List[Dict[str, object]]:
    """Plant each error into some rigs; return a row for each."""
    rows = []
    for planted in PLANTED:
        outcomes = [_outcome(planted, seed) for seed in range(rigs)]
        rows.append(
            {
                "error": planted.title,
                "rigs": rigs,
                **{key: sum(o[key] for o in outcomes) for key in ("named", "first", "exact")},
                "others": sum(o["others"] for o in outcomes),
            }
        )
    return rows


def _outcome(planted: Planted, seed: int) -> Dict[str, int]:
    scene = paper_cell(seed, realism=planted.realism, disturbance=DISTURBANCE)
    dataset = planted.change(scene.dataset)
    checks = calibrate(dataset).checks
    names = [(check.error.name, check.error.target) for check in checks]
    true = (planted.name, planted.target)
    auto = calibrate(dataset, CalibrationOptions(model_errors=AUTO))
    found = {(e.name, e.target): value for e, value in auto.summary.model_errors.items()}
    return {
        "named": int(true in names),
        "first": int(names[:1] == [true]),
        "exact": int(abs(found.get(true, 0.0) / planted.value - 1.0) < _EXACT),
        "others": len(set(names) - {true}),
    }


def rough_table(rigs: int, mode: str) -> Tuple[List[Dict[str, object]], Dict[str, int]]:
    """Calibrate rigs of the rough profile; return a row by kind of sensor, and counts."""
    errors: Dict[str, List[np.ndarray]] = {}
    sigmas: Dict[str, List[np.ndarray]] = {}
    counts = {"rigs": rigs, "far off": 0, "far off and converged": 0, "converged": 0}
    for seed in range(rigs):
        scene = paper_cell(seed, realism=ROUGH, disturbance=DISTURBANCE)
        result = calibrate(scene.dataset, CalibrationOptions(model_errors=mode))
        largest = _collect(result, scene, errors, sigmas)
        counts["converged"] += result.status == CONVERGED
        counts["far off"] += largest > _WRONG_SIGMAS
        counts["far off and converged"] += largest > _WRONG_SIGMAS and result.status == CONVERGED
    rows = []
    for modality in errors:
        error, sigma = np.array(errors[modality]), np.array(sigmas[modality])
        length = np.linalg.norm(error[:, 3:], axis=1), np.linalg.norm(error[:, :3], axis=1)
        rows.append(
            {
                "mode": mode,
                "modality": modality,
                "mean [mm]": 1e3 * float(np.mean(length[0])),
                "mean [deg]": float(np.degrees(np.mean(length[1]))),
                "within 95 % [%]": 100.0 * float(np.mean(np.abs(error) < 1.96 * sigma)),
                "error / sigma": float(np.median(np.abs(error) / sigma) / _MEDIAN_OF_NORMAL),
            }
        )
    return rows, counts


def combined_table(rigs: int) -> List[Dict[str, object]]:
    """Calibrate rigs of each profile with the defaults; return a row for each."""
    rows = []
    for name, scene_of in SCENES.items():
        found, converged = [], 0
        for seed in range(rigs):
            scene = scene_of(seed)
            result = calibrate(scene.dataset)
            converged += result.status == CONVERGED
            edges = calibration_results(result, default_solver()).edges
            found += stated_errors(edges, scene.truth)
        row: Dict[str, object] = {"rigs": name, "converged": f"{converged} of {rigs}"}
        for which in ("sigma", "combined_sigma"):
            ratio = np.array([np.abs(e.error) / getattr(e, which) for e in found])
            row[f"within 95 % of {which} [%]"] = 100.0 * float(np.mean(ratio < 1.96))
            row[f"largest in {which}s"] = float(np.max(ratio))
        rows.append(row)
    return rows


def _collect(
    result: Calibration,
    scene: SyntheticDataset,
    errors: Dict[str, List[np.ndarray]],
    sigmas: Dict[str, List[np.ndarray]],
) -> float:
    """Add the errors of all sensors; return the largest in sigmas."""
    found = stated_errors(calibration_results(result, default_solver()).edges, scene.truth)
    for one in found:
        modality = result.dataset.sensors[one.sensors[0]].modality
        errors.setdefault(modality, []).append(one.error)
        sigmas.setdefault(modality, []).append(one.sigma)
    return max(one.in_sigmas for one in found)


def model_errors(output: Path, rigs: int) -> None:
    """Print the tables; write planted.csv, rough.csv and combined.csv."""
    planted = planted_table(max(rigs // 2, 1))
    _write(output / "planted.csv", planted)
    headers = list(planted[0])
    print(text_table(headers, [list(row.values()) for row in planted], "Errors planted alone", 1))
    rough: List[Dict[str, object]] = []
    for mode in (SUGGEST, AUTO):
        rows, counts = rough_table(rigs, mode)
        rough += rows
        told = ", ".join(f"{key} {value}" for key, value in counts.items())
        print(f"rough profile, --model_errors {mode}: {told}")
    _write(output / "rough.csv", rough)
    print(text_table(list(rough[0]), [list(row.values()) for row in rough], "Rough profile", 2))
    combined = combined_table(max(rigs // 2, 1))
    _write(output / "combined.csv", combined)
    title = "Intervals of sigmas, and of combined ones"
    print(text_table(list(combined[0]), [list(row.values()) for row in combined], title, 1))


def _write(path: Path, rows: Sequence[Dict[str, object]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench_output"))
    parser.add_argument("--rigs", type=int, default=20)
    arguments = parser.parse_args()
    model_errors(arguments.output, arguments.rigs)
