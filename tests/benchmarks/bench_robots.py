"""Errors of the example robots against the truth, over several seeds.

``python3 tests/benchmarks/bench_robots.py [--robots NAME...] [--seeds 5] [--keep docs/results]``.
Each seed is recorded, labeled and calibrated from 0.1 m and 0.1 rad off, as ``make demo
EXAMPLE=NAME`` does it; folders of demos that have run already can be read instead (``--demos``).
Sensors are compared relative to the reference, and by their own edge where they are estimated in a
world that is known, other edges by themselves; joints that a prior holds are not counted. With
``--keep`` every run is written down at once: robots.json has all of them, of a robot and a seed the
last one, and robots.md is the page of it. Exit code 1: a limit is exceeded, or nothing was
determined.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple

import numpy as np
from robots_page import COLUMNS, largest_of, page, within_limits

from atom_core import cli
from atom_core.io.atomic import write_json_atomically, write_text_atomically
from atom_core.model.sensor import RGB
from atom_core.report.tables import text_table
from atom_examples import robot_demo
from atom_examples.robot_simulator.robots import robot_named, robot_names
from atom_examples.robot_simulator.scenario import read_scenario

CAMERA, RANGE, EDGE = "camera", "range", "edge"
ROOT = Path(__file__).resolve().parents[2]


class Run(NamedTuple):
    """What became of a robot and a seed.

    Attributes:
        robot, seed: which.
        largest: the largest errors by column of the table.
        status: of the answer.
        commit: state of the programs.
        date: of the run.
    """

    robot: str
    seed: int
    largest: Dict[str, float]
    status: str
    commit: str
    date: str


def main() -> int:
    """Print the table; return the exit code."""
    args = _parser().parse_args()
    runs: List[Run] = []
    for run in _runs(args):
        runs.append(run)
        print(run.robot, run.seed, run.largest, run.status, flush=True)
        if args.keep:
            keep(args.keep, run)
    rows = [_row(name, [r for r in runs if r.robot == name]) for name in {r.robot: 0 for r in runs}]
    print(text_table(["robot", "seeds", *COLUMNS, "status"], rows))
    if args.output:
        write_json_atomically(args.output, [run._asdict() for run in runs], indent=1)
    return 0 if all(within_limits(run._asdict()) for run in runs) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", default=robot_names(), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, help="0, 1, ...")
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--demos", nargs="+", type=Path, metavar="DIR", help="read these instead")
    parser.add_argument("--output", type=Path, metavar="FILE", help="all errors as JSON")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="write them down there")
    return parser


def _runs(args: argparse.Namespace) -> Iterator[Run]:
    if args.demos:
        for folder in args.demos:
            yield run_of_demo(folder)
        return
    for name in args.robots:
        for seed in range(args.first, args.first + args.seeds):
            yield run(name, seed)


def _row(name: str, runs: List[Run]) -> List[str]:
    largest = largest_of([run._asdict() for run in runs])
    shown = [
        f"{np.median(values):.4f} (at most {max(values):.4f})" if values else "---"
        for values in largest.values()
    ]
    return [name, str(len(runs)), *shown, ", ".join(sorted({run.status for run in runs}))]


def run(name: str, seed: int) -> Run:
    """Record, label and calibrate; return the errors."""
    robot = robot_named(name)
    with tempfile.TemporaryDirectory() as text, contextlib.redirect_stdout(io.StringIO()):
        folder = Path(text)
        with contextlib.redirect_stderr(io.StringIO()):
            robot_demo.simulate(robot, folder, "train", seed)
            robot_demo.collect(robot, folder, "train")
        words = ["--dataset", str(folder / "train" / "dataset.json"), "--overwrite", "--no_report"]
        words += ["--output", str(folder / "out"), *read_scenario(robot.scenario).calibrate]
        words += ["--truth", str(folder / "train.truth.json")]
        with contextlib.redirect_stderr(io.StringIO()):
            cli.main(["calibrate", *words])
        document = json.loads((folder / "out" / "calibration.json").read_text())
        return _run_of(name, seed, document)


def run_of_demo(folder: Path) -> Run:
    """Return the errors of a demo that has been run, from its folder."""
    made = json.loads((folder / "train.truth.json").read_text())
    document = json.loads((folder / "calibration" / "calibration.json").read_text())
    return _run_of(made["robot"], made["seed"], document)


def _run_of(name: str, seed: int, document: Mapping[str, Any]) -> Run:
    git = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    date = time.strftime("%Y-%m-%d")
    return Run(name, seed, errors_of(document), document["status"], commit, date)


def errors_of(document: Mapping[str, Any]) -> Dict[str, float]:
    """Return the largest errors of a calibration, by column of the table."""
    found = [*_sensors(document), *_other_edges(document), *_joints(document)]
    return {c: max(v for n, v in found if n == c) for c in COLUMNS if c in dict(found)}


def _sensors(document: Mapping[str, Any]) -> Iterator[tuple]:
    for name, sensor in document["sensors"].items():
        kind = CAMERA if sensor["modality"] == RGB else RANGE
        error = document["ground_truth"][name]
        yield f"{kind} mm", 1000.0 * error["translation_error_m"]
        yield f"{kind} deg", error["rotation_error_deg"]


def _other_edges(document: Mapping[str, Any]) -> Iterator[tuple]:
    """Yield the errors of estimated edges that carry no sensor, as that of a robot's base."""
    for error in document["truth_comparison"]["edges"]:
        edge = document["edges"].get(f"{error['parent']}-{error['child']}")
        if (
            edge is not None
            and error["name"] not in document["sensors"]
            and "," not in error["name"]
        ):
            after = error["after"]
            yield f"{EDGE} mm", 1000.0 * after["translation_error_m"]
            yield f"{EDGE} deg", float(np.degrees(after["rotation_error_rad"]))


def _joints(document: Mapping[str, Any]) -> Iterator[tuple]:
    for joint in document["truth_comparison"].get("joints", []):
        if document["joints"][joint["joint"]][joint["parameter"]]["held_by_prior"]:
            continue  # no data tell it
        if joint["unit"] == "rad":
            yield "joint deg", float(np.degrees(abs(joint["after"])))
        else:
            yield "joint mm", 1000.0 * abs(joint["after"])


def keep(folder: Path, run: Run) -> None:
    """Write a run down in robots.json, in place of an earlier one, and the page anew."""
    path = folder / "robots.json"
    before = json.loads(path.read_text()) if path.is_file() else []
    others = [r for r in before if (r["robot"], r["seed"]) != (run.robot, run.seed)]
    runs = sorted([*others, run._asdict()], key=lambda r: (r["robot"], r["seed"]))
    write_json_atomically(path, runs, indent=1)
    write_text_atomically(folder / "robots.md", page(runs))


if __name__ == "__main__":
    sys.exit(main())
