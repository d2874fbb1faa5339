"""Ours against OpenCV's seven hand-eye methods on the same labels, over many simulated rigs.

``python3 tests/benchmarks/bench_hand_eye.py [--seeds 20] [--keep docs/results]``: a camera on an
arm before a board that stands still, and a board on an arm before a camera that stands still; 15
collections with boards that are partly out of the image, 5 % of the corners lost, corners wrong by
0.3 px, and the poses that the arm reports wrong by nothing, by a little, or as those of a worn or
badly described arm are. Ours starts 0.1 m and 0.1 rad off; the methods need no start. Where the
real arm's pictures are at hand (../shared/data or $ATOM_TEST_DATA), they are tried as well.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import cv2
import numpy as np
from hand_eye_page import page

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.hand_eye_baselines import METHODS, hand_eye_baselines
from atom_core.evaluation.hand_eye_comparison import compare_hand_eye, hand_eye_score
from atom_core.geometry.se3 import pose_difference
from atom_core.io.atomic import write_text_atomically
from atom_core.model.dataset import Dataset
from atom_core.report.calibration_results import calibration_results
from atom_core.report.stated_errors import stated_errors
from atom_core.report.tables import text_table
from atom_core.solvers.choice import default_solver
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.dataset import SyntheticDataset
from atom_core.synthetic.realism import PLAIN

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "atom_core" / "tests" / "calibration"))
from real_arm import EYE, FOLDER, PUBLISHED, real_arm  # noqa: E402

CAMERA, FLANGE = "rgb_1", "flange"
COLLECTIONS, DISTURBANCE = 15, (0.1, 0.1)
DEFAULTS, WITH_ARM = "defaults", "--moving_edge_sigma flange"
OURS = {
    DEFAULTS: CalibrationOptions(),
    WITH_ARM: CalibrationOptions(moving_edge_sigma={FLANGE: None}),
}
RIGS = {
    "camera on the arm": lambda seed, **more: scenes.hand_eye(seed, aim_m=0.5, **more),
    "board on the arm": lambda seed, **more: scenes.board_on_arm(seed, spread_m=0.6, **more),
}
NO_ANSWER, HUGE = float("inf"), 1e6


class Arm(NamedTuple):
    """How wrong the reported poses of an arm are, along and about each axis; what has to win."""

    mm: float
    deg: float
    to_win: Tuple[str, ...]


ARMS = {
    "exact": Arm(0.0, 0.0, (DEFAULTS, WITH_ARM)),
    "0.1 mm, 0.01 deg": Arm(0.1, 0.01, (DEFAULTS, WITH_ARM)),
    "0.5 mm, 0.03 deg": Arm(0.5, 0.03, (DEFAULTS, WITH_ARM)),
}


def main() -> None:
    """Run all rigs; print tables, write the page where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write hand_eye.md there")
    args = parser.parse_args()
    document: Dict[str, Any] = {
        "seeds": args.seeds,
        "date": time.strftime("%Y-%m-%d"),
        "opencv": cv2.__version__,
        "rows": [row_of(rig, arm, args.seeds) for rig in RIGS for arm in ARMS],
        "real": real_rows(),
    }
    for row in document["rows"]:
        title = f"{row['rig']}, poses of the arm: {row['arm']}; ours says {row['said']}"
        figures = [[name, *values.values()] for name, values in row["methods"].items()]
        print(text_table(["method", *next(iter(row["methods"].values()))], figures, title), "\n")
    if document["real"]:
        print(text_table(list(document["real"][0]), [list(r.values()) for r in document["real"]]))
    if args.keep:
        write_text_atomically(args.keep / "hand_eye.md", page(document))


def row_of(rig: str, arm: str, seeds: int) -> Dict[str, Any]:
    """Return the figures of every method on a kind of rig."""
    errors: Dict[str, List[Tuple[float, float]]] = {}
    said: Dict[str, List[str]] = {}
    sigmas: Dict[str, List[float]] = {}
    for seed in range(seeds):
        scene = simulated(rig, ARMS[arm], seed)
        for name, options in OURS.items():
            result = calibrate(scene.dataset, options)
            errors.setdefault(name, []).append(error_of(scene, result.dataset))
            said.setdefault(name, []).append(result.status)
            edges = calibration_results(result, default_solver()).edges
            worst = max(error.in_sigmas for error in stated_errors(edges, scene.truth))
            sigmas.setdefault(name, []).append(worst)
        for baseline in hand_eye_baselines(scene.dataset)[0]:
            found = (NO_ANSWER, NO_ANSWER)
            if baseline.dataset is not None:
                found = error_of(scene, baseline.dataset)
            errors.setdefault(baseline.method, []).append(found)
    words = {
        name: f"{counted(said[name])}; {np.median(worst):.1f}, {np.max(worst):.1f} sigma"
        for name, worst in sigmas.items()
    }
    methods = {name: figures(values) for name, values in errors.items()}
    wins = {name: ratios(methods, name) for name in OURS}
    row = {"rig": rig, "arm": arm, "said": words, "methods": methods, "ratios": wins}
    return {**row, "has_to_win": ARMS[arm].to_win}


def simulated(rig: str, arm: Arm, seed: int) -> SyntheticDataset:
    """Return a rig with its labels, its camera's edge off at the start."""
    realism = replace(
        PLAIN, moving_edge_sigma_m=1e-3 * arm.mm, moving_edge_sigma_rad=float(np.radians(arm.deg))
    )
    more = {"collections": COLLECTIONS, "noise": Noise(dropout=0.05), "realism": realism}
    return RIGS[rig](seed, disturbance=DISTURBANCE, **more)


def error_of(scene: SyntheticDataset, dataset: Dataset) -> Tuple[float, float]:
    """Return how far the camera's edge is from the truth [mm, deg]."""
    edge = dataset.sensors[CAMERA].edge
    move, turn = pose_difference(scene.truth.edges[edge], dataset.first_value(edge))
    return 1e3 * move, float(np.degrees(turn))


def figures(values: Sequence[Tuple[float, float]]) -> Dict[str, float]:
    """Return median and 90th percentile; a missing answer is the worst."""
    found = {}
    for name, share in (("median", 50.0), ("90 %", 90.0)):
        mm, deg = np.percentile(np.minimum(values, 1e3 * HUGE), share, axis=0)
        found.update({f"{name} [mm]": float(mm), f"{name} [deg]": float(deg)})
    return {name: value if value < HUGE else NO_ANSWER for name, value in found.items()}


def ratios(methods: Mapping[str, Mapping[str, float]], ours: str) -> Dict[str, float]:
    """Return, by figure, that of the best of the seven over ours: above 1 ours is better."""
    return {
        name: min(methods[method][name] for method in METHODS) / value
        for name, value in methods[ours].items()
    }


def counted(statuses: Sequence[str]) -> str:
    """Return how often each status came."""
    return ", ".join(f"{statuses.count(s)} {s}" for s in dict.fromkeys(statuses))


def real_rows() -> List[Dict[str, Any]]:
    """Return what ours and the seven methods make of the real arm; empty where it is absent."""
    data = Path(os.environ.get("ATOM_TEST_DATA", ROOT.parent / "shared" / "data")) / FOLDER
    if not data.is_dir():
        print(f"{data} is absent: no real arm")
        return []
    dataset = real_arm(data)
    answers, said = {}, {}
    for name, options in OURS.items():
        result = calibrate(dataset, replace(options, initial_guess="none"))
        answers[name], said[name] = result.dataset, result.status
    compared = compare_hand_eye(dataset, dataset, evaluate(dataset, dataset))
    answers.update({b.method: b.dataset for b in compared.baselines if b.dataset is not None})
    rows = []
    for name, answer in answers.items():
        score = hand_eye_score("camera", answer, evaluate(answer, dataset))
        move, turn = pose_difference(PUBLISHED, answer.first_value(EYE))
        rows.append(
            {
                "method": name,
                "reprojection [px]": score.reprojection_px,
                "spread [px]": score.spread_px,
                "spread [mm]": score.spread_mm,
                "spread [deg]": score.spread_deg,
                "from the published [mm]": 1e3 * move,
                "from the published [deg]": float(np.degrees(turn)),
                "says": said.get(name, ""),
            }
        )
    return rows


if __name__ == "__main__":
    main()
