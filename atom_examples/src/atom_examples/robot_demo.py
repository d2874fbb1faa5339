"""The main job on an example robot: recordings, collections, calibration, errors."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional

import numpy as np

from atom_calibration.nodes.collecting import collect_from_bag
from atom_core.commands import calibrate, evaluate
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_writer import DATASET_FILE
from atom_core.report.ground_truth_document import MEAN
from atom_examples.demo_steps import DONE, NOT_ACCEPTABLE, SETS, core, refusing, report, title
from atom_examples.robot_simulator import main as robot_simulator
from atom_examples.robot_simulator.robots import Robot, robot_named
from atom_examples.robot_simulator.scenario import read_scenario

Counts = Dict[str, Optional[int]]


def run(args: argparse.Namespace) -> int:
    """Do the five steps with the robot of ``--example``; return the exit code.

    Raises:
        AtomError: there is no such robot, or a step refuses to go on.
    """
    robot = robot_named(args.example)
    scenario = read_scenario(robot.scenario)
    folder = prepare_output_folder(args.output, args.overwrite)
    counts: Counts = dict(zip(SETS, args.collections or (None, None)))
    numbers = " and ".join(str(_stops(robot, name, counts[name])) for name in SETS)
    title(
        1,
        f"simulate {robot.name}: {numbers} stops; every calibrated edge but an anchored one is "
        f"0.1 m and 0.1 rad off",
    )
    for name in SETS:
        simulate(robot, folder, name, args.seed, counts[name])
    title(2, "collect: label the recordings; one collection for each stop")
    for name in SETS:
        collect(robot, folder, name)
    title(3, "check: who sees what, is it enough?")
    core("check", "--dataset", folder / "train" / DATASET_FILE)
    title(4, "calibrate")
    acceptable = _calibrate(folder, scenario.calibrate) == DONE
    title(5, "evaluate on the test recording, against the truth")
    measured = _evaluate(folder, args.verbose) == DONE
    print("\n" + "\n".join(conclusion(folder)), flush=True)
    report(folder)
    return DONE if acceptable and measured else NOT_ACCEPTABLE


def _stops(robot: Robot, name: str, stops: Optional[int]) -> int:
    every = [robot, *(robot.recorded_as(further) for further in robot.further_recordings)]
    return sum(stops or read_scenario(each.scenario).stops[name] for each in every)


def simulate(robot: Robot, folder: Path, name: str, seed: int, stops: Optional[int] = None) -> None:
    """Record all that a robot has to show, as ``NAME.bag`` and ``NAME_RECORDING.bag``.

    Raises:
        StepError: the simulator refused.
    """
    for further in ("", *robot.further_recordings):
        refusing(
            robot_simulator.main,
            *("--robot", robot.folder, "--recording", further),
            *("--bag", _bag(folder, name, further)),
            *("--scenario", name, "--seed", seed, "--overwrite"),
            *(() if stops is None else ("--stops", stops)),
        )


def collect(robot: Robot, folder: Path, name: str) -> None:
    """Label the recordings; what they show becomes one dataset in the folder NAME.

    Raises:
        StepError: a program refused.
    """
    recordings = ("", *robot.further_recordings)
    parts = [folder / f"{name}_{recording or 'first'}" for recording in recordings]
    if len(parts) == 1:
        parts = [folder / name]
    for recording, part in zip(recordings, parts):
        refusing(
            collect_from_bag.main,
            *("--config", robot.config, "--bag", _bag(folder, name, recording)),
            *("--output", part, "--overwrite"),
        )
    merged = parts[0]
    for part in parts[1:]:
        target = folder / name if part == parts[-1] else part.with_name(f"{part.name}_merged")
        both = ("-ds1", merged / DATASET_FILE, "-ds2", part / DATASET_FILE)
        core("merge_atom_datasets", *both, "-dof", target, "--overwrite")
        merged = target


def _bag(folder: Path, name: str, recording: str) -> Path:
    return folder / (f"{name}_{recording}.bag" if recording else f"{name}.bag")


def _calibrate(folder: Path, more: tuple) -> int:
    return core(
        "calibrate",
        *("--dataset", folder / "train" / DATASET_FILE, "--output", folder / "calibration"),
        *("--overwrite", "--no_report", "--truth", folder / "train.truth.json", *more),
    )


def _evaluate(folder: Path, verbose: bool) -> int:
    return core(
        "evaluate",
        *("--train", folder / "calibration" / calibrate.DATASET_FILE),
        *("--test", folder / "test" / DATASET_FILE, "--truth", folder / "test.truth.json"),
        *("--output", folder / "evaluation", "--overwrite", "--no_report"),
        *["--verbose"] * verbose,
    )


def conclusion(folder: Path) -> List[str]:
    """Return what a newcomer wants to know: how good, and where."""
    evaluation = json.loads((folder / "evaluation" / evaluate.RESULT_FILE).read_text("utf-8"))
    sensors = [v for name, v in evaluation["ground_truth"].items() if name != MEAN]
    metres, degrees = (
        max(entry[key] for entry in sensors)
        for key in ("translation_error_m", "rotation_error_deg")
    )
    calibration = json.loads((folder / "calibration" / calibrate.RESULT_FILE).read_text("utf-8"))
    lines = [
        f"sensors against the truth: at most {1000 * metres:.3f} mm and {degrees:.4f} deg off; at "
        f"the start 100 mm and 5.7 deg, where an edge is not held"
    ]
    return [*lines, *_joints(calibration), f"all results: {folder.resolve()}/"]


def _joints(calibration: Mapping[str, Any]) -> List[str]:
    """Return how far the joints are off, those apart that a prior holds."""
    errors = calibration["truth_comparison"].get("joints", [])
    found = calibration.get("joints", {})

    def held(error: Mapping[str, Any]) -> bool:
        entry = found.get(error.get("joint"), {}).get(error.get("parameter"), {})
        return bool(entry.get("held_by_prior"))

    lines = []
    for unit, factor, shown in (("rad", np.degrees(1.0), "deg"), ("m", 1000.0, "mm")):
        for is_held, which in ((False, "joints"), (True, "joints that a prior holds")):
            of_kind = [e for e in errors if e["unit"] == unit and held(e) == is_held]
            if of_kind:
                before, after = (
                    factor * max(abs(e[when]) for e in of_kind) for when in ("before", "after")
                )
                lines.append(
                    f"{which}: at most {after:.4f} {shown} off; at the start {before:.2f} {shown}"
                )
    return lines
