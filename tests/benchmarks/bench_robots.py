"""Errors of the example robots against the truth, over several seeds.

``python3 tests/benchmarks/bench_robots.py [--robots NAME...] [--seeds 5] [--output FILE]``. Each
seed is recorded, labeled and calibrated from 0.1 m and 0.1 rad off, as ``make demo EXAMPLE=NAME``
does it. Sensors are compared relative to the reference, and by their own edge where they are
estimated in a world that is known; joints that a prior holds are not counted. Exit code 1: a limit
is exceeded, or nothing was determined.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from typing import Dict, List, NamedTuple

import numpy as np

from atom_core import cli
from atom_core.model.sensor import RGB
from atom_core.report.tables import text_table
from atom_examples import robot_demo
from atom_examples.robot_simulator.robots import robot_named, robot_names
from atom_examples.robot_simulator.scenario import read_scenario

CAMERA, RANGE = "camera", "range"
COLUMNS = ("camera mm", "camera deg", "range mm", "range deg", "joint deg", "joint mm")
LIMITS = dict(zip(COLUMNS, (1.0, 0.05, 1.0, 0.05, 0.02, 1.0)))
LIMITS_OF = {"collab_cell_at_work": dict(zip(COLUMNS, (0.5, 0.02, 1.5, np.inf, 0.02, 1.0)))}


class Errors(NamedTuple):
    """The largest errors of a run by column of the table, and the status of its answer."""

    largest: Dict[str, float]
    status: str


def main() -> int:
    """Print the table; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=robot_names(), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, help="0, 1, ...")
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--output", type=Path, metavar="FILE", help="all errors as JSON")
    args = parser.parse_args()
    found: Dict[str, List[Errors]] = {}
    for name in args.robots:
        for seed in range(args.first, args.first + args.seeds):
            found.setdefault(name, []).append(run(name, seed))
            print(name, seed, found[name][-1], flush=True)
    print(
        text_table(["robot", "seeds", *LIMITS, "status"], [_row(*item) for item in found.items()])
    )
    if args.output:
        document = {name: [e._asdict() for e in errors] for name, errors in found.items()}
        args.output.write_text(json.dumps(document, indent=1) + "\n")
    judged = [_is_good(name, error) for name, errors in found.items() for error in errors]
    return 0 if all(judged) else 1


def _is_good(robot: str, error: Errors) -> bool:
    limits = LIMITS_OF.get(robot, LIMITS)
    within = all(value <= limits[name] for name, value in error.largest.items())
    return within and error.status == "converged"


def _row(name: str, errors: List[Errors]) -> List[str]:
    largest = {c: [e.largest[c] for e in errors if c in e.largest] for c in COLUMNS}
    shown = [
        f"{np.median(values):.4f} (at most {max(values):.4f})" if values else "---"
        for values in largest.values()
    ]
    return [name, str(len(errors)), *shown, ", ".join(sorted({e.status for e in errors}))]


def run(name: str, seed: int) -> Errors:
    """Record, label and calibrate; return the errors."""
    robot = robot_named(name)
    with tempfile.TemporaryDirectory() as text, contextlib.redirect_stdout(io.StringIO()):
        folder = Path(text)
        with contextlib.redirect_stderr(io.StringIO()):
            robot_demo.simulate(robot, folder, "train", seed)
            robot_demo.collect(robot, folder, "train")
        words = ["--dataset", str(folder / "train" / "dataset.json"), "--overwrite"]
        words += ["--output", str(folder / "out"), *read_scenario(robot.scenario).calibrate]
        words += ["--truth", str(folder / "train.truth.json")]
        with contextlib.redirect_stderr(io.StringIO()):
            cli.main(["calibrate", *words])
        return _errors(json.loads((folder / "out" / "calibration.json").read_text()))


def _errors(document: dict) -> Errors:
    largest: Dict[str, float] = {}
    for name, sensor in document["sensors"].items():
        kind = CAMERA if sensor["modality"] == RGB else RANGE
        error = document["ground_truth"][name]
        for column, value in (
            (f"{kind} mm", 1000.0 * error["translation_error_m"]),
            (f"{kind} deg", error["rotation_error_deg"]),
        ):
            largest[column] = max(largest.get(column, 0.0), value)
    for joint in document["truth_comparison"].get("joints", []):
        if document["joints"][joint["joint"]][joint["parameter"]]["held_by_prior"]:
            continue  # no data tell it
        column, factor = "joint mm", 1000.0
        if joint["unit"] == "rad":
            column, factor = "joint deg", float(np.degrees(1.0))
        largest[column] = max(largest.get(column, 0.0), factor * abs(joint["after"]))
    return Errors(largest, document["status"])


if __name__ == "__main__":
    sys.exit(main())
