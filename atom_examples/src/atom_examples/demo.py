"""``rosrun atom_examples demo``: the main job on the simulated cell, from recordings to figures."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import List, Optional, Sequence

from atom_calibration.nodes.collecting import collect_from_bag
from atom_core.commands import calibrate, evaluate
from atom_core.commands.common import add_option, add_output_options
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.errors import AtomError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_writer import DATASET_FILE
from atom_core.io.paths import package_folder
from atom_core.synthetic.cell import SCENARIOS
from atom_examples import robot_demo
from atom_examples.cell_simulator import main as cell_simulator
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE, ROUGH_PROFILE
from atom_examples.demo_steps import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    NOT_ACCEPTABLE,
    SETS,
    core,
    refusing,
    report,
    title,
)

PROGRAM = "demo"
EXAMPLE = """
rosrun atom_examples demo --output demo_output --overwrite
rosrun atom_examples demo --example rihbot --output demo_output/rihbot
"""
_CONFIGS = {False: "config.yml", True: "config_with_scanners.yml"}


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the demo; return the exit code: 0, 1 for an answer that is not acceptable, 2, 130."""
    args = build_parser().parse_args(sys.argv[1:] if argv is None else argv)
    try:
        return run(args) if args.example is None else _example(args)
    except AtomError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted; what is finished is kept in {args.output}", file=sys.stderr)
        return INTERRUPTED


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = OptionParser(
        prog=PROGRAM,
        description="Simulate the collaborative cell, label the recordings, calibrate from a start "
        "that is off by 0.1 m and 0.1 rad, evaluate on a test set and against the truth. "
        "Recordings of an earlier run are used again while they would be the same.",
        epilog=examples(EXAMPLE),
    )
    add_output_options(parser)
    add_option(parser, "seed", type=int, default=0, metavar="N", help="of rig, boards and noise")
    add_option(
        parser,
        "collections",
        type=int,
        nargs=2,
        metavar=("TRAIN", "TEST"),
        help="number of stops in each recording (default: 23 17, or the example's)",
    )
    add_option(
        parser, "example", metavar="NAME", help="one of the example robots, in place of the cell"
    )
    add_option(parser, "scanners", action="store_true", help="with two 2D LiDARs beside the cell")
    add_option(
        parser,
        "realism",
        choices=(PLAIN_PROFILE, ROUGH_PROFILE),
        default=PLAIN_PROFILE,
        help="rough: sensors, board and robot have the systematic errors of real ones",
    )
    return parser


def _example(args: argparse.Namespace) -> int:
    if args.scanners or args.realism != PLAIN_PROFILE:
        raise AtomError("--scanners and --realism are of the cell; leave them out with --example")
    return robot_demo.run(args)


def run(args: argparse.Namespace) -> int:
    """Do the five steps with the cell.

    Raises:
        AtomError: a step refuses to go on.
    """
    folder = prepare_output_folder(args.output, args.overwrite)
    usual = [SCENARIOS[name].collections for name in SETS]
    counts = dict(zip(SETS, args.collections or usual))
    stops = " and ".join(str(count) for count in counts.values())
    title(
        1,
        f"simulate: {'nine' if args.scanners else 'seven'} sensors see a board at {stops} stops; "
        "every mount but one is 0.1 m and 0.1 rad off (some two minutes at first, kept for the "
        "next run)",
    )
    for name in SETS:
        _simulate(folder, name, counts[name], args)
    title(2, "collect: label images, depth images and clouds; one collection for each stop")
    for name in SETS:
        _collect(folder, name, args.scanners)
    title(3, "check: who sees what, is it enough?")
    core("check", "--dataset", folder / "train" / DATASET_FILE)
    title(4, "calibrate")
    acceptable = _calibrate(folder) == DONE
    title(5, "evaluate on the test recording, against the truth")
    measured = _evaluate(folder, args.verbose) == DONE
    print("\n" + "\n".join(_conclusion(folder)), flush=True)
    report(folder)
    return DONE if acceptable and measured else NOT_ACCEPTABLE


def _simulate(folder: Path, name: str, collections: int, args: argparse.Namespace) -> None:
    refusing(
        cell_simulator.main,
        "--bag",
        folder / f"{name}.bag",
        "--scenario",
        name,
        "--collections",
        collections,
        "--seed",
        args.seed,
        "--compressed",
        "--reuse",
        "--overwrite",
        "--realism",
        args.realism,
        *["--scanners"] * args.scanners,
    )


def _collect(folder: Path, name: str, scanners: bool) -> None:
    """Label a recording.

    What was not seen or refused, exit code 1, has been told; whether what remains is enough, the
    check and the calibration say.
    """
    config = package_folder("atom_examples") / "collab_cell" / "config" / _CONFIGS[scanners]
    refusing(
        collect_from_bag.main,
        "--config",
        config,
        "--bag",
        folder / f"{name}.bag",
        "--output",
        folder / name,
        "--overwrite",
    )


def _calibrate(folder: Path) -> int:
    return core(
        "calibrate",
        "--dataset",
        folder / "train" / DATASET_FILE,
        "--output",
        folder / "calibration",
        "--overwrite",
        "--no_report",
        "--truth",
        folder / "train.truth.json",
    )


def _evaluate(folder: Path, verbose: bool) -> int:
    return core(
        "evaluate",
        "--train",
        folder / "calibration" / calibrate.DATASET_FILE,
        "--test",
        folder / "test" / DATASET_FILE,
        "--truth",
        folder / "test.truth.json",
        "--output",
        folder / "evaluation",
        "--overwrite",
        "--no_report",
        *["--verbose"] * verbose,
    )


def _conclusion(folder: Path) -> List[str]:
    """Return what a newcomer wants to know: how good, and where."""
    document = json.loads((folder / "evaluation" / evaluate.RESULT_FILE).read_text("utf-8"))
    errors = document["ground_truth"]["mean"]
    return [
        f"sensors against the truth, on average: {1000 * errors['translation_error_m']:.2f} mm and "
        f"{errors['rotation_error_deg']:.3f} deg; at the start 100 mm and 5.7 deg",
        f"all results: {folder.resolve()}/",
    ]
