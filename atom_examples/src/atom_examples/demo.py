"""``rosrun atom_examples demo``: the main job on the simulated cell, from recordings to figures."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Callable, List, Optional, Sequence

from atom_calibration.nodes.collecting import collect_from_bag
from atom_core import cli
from atom_core.commands import calibrate, evaluate
from atom_core.commands.common import add_option, add_output_options
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import AtomError
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_writer import DATASET_FILE
from atom_core.io.paths import package_folder
from atom_core.synthetic.cell import SCENARIOS
from atom_examples.cell_simulator import main as cell_simulator
from atom_examples.cell_simulator.profiles import PLAIN_PROFILE, ROUGH_PROFILE

PROGRAM = "demo"
EXAMPLE = "rosrun atom_examples demo --output demo_output --overwrite"
DONE, NOT_ACCEPTABLE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
_SETS = ("train", "test")
_CONFIGS = {False: "config.yml", True: "config_with_scanners.yml"}


class StepError(AtomError):
    """A step ended with a refusal, which it has printed."""


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the demo; return the exit code: 0, 1 for an answer that is not acceptable, 2, 130."""
    args = build_parser().parse_args(sys.argv[1:] if argv is None else argv)
    try:
        return run(args)
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
        epilog=f"example: {EXAMPLE}",
    )
    add_output_options(parser)
    add_option(parser, "seed", type=int, default=0, metavar="N", help="of rig, boards and noise")
    add_option(
        parser,
        "collections",
        type=int,
        nargs=2,
        metavar=("TRAIN", "TEST"),
        default=tuple(SCENARIOS[name].collections for name in _SETS),
        help="number of stops of the board in each recording (default: 23 17)",
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


def run(args: argparse.Namespace) -> int:
    """Do the five steps.

    Raises:
        AtomError: a step refuses to go on.
    """
    folder = prepare_output_folder(args.output, args.overwrite)
    counts = dict(zip(_SETS, args.collections))
    stops = " and ".join(str(count) for count in counts.values())
    _title(
        1,
        f"simulate: {'nine' if args.scanners else 'seven'} sensors see a board at {stops} stops; "
        "every mount but one is 0.1 m and 0.1 rad off (some two minutes at first, kept for the "
        "next run)",
    )
    for name in _SETS:
        _simulate(folder, name, counts[name], args)
    _title(2, "collect: label images, depth images and clouds; one collection for each stop")
    for name in _SETS:
        _collect(folder, name, args.scanners)
    _title(3, "check: who sees what, is it enough?")
    _core("check", "--dataset", folder / "train" / DATASET_FILE)
    _title(4, "calibrate")
    acceptable = _calibrate(folder) == DONE
    _title(5, "evaluate on the test recording, against the truth")
    measured = _evaluate(folder, args.verbose) == DONE
    print("\n" + "\n".join(_conclusion(folder)))
    return DONE if acceptable and measured else NOT_ACCEPTABLE


def _simulate(folder: Path, name: str, collections: int, args: argparse.Namespace) -> None:
    _refusing(
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
    _refusing(
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
    return _core(
        "calibrate",
        "--dataset",
        folder / "train" / DATASET_FILE,
        "--output",
        folder / "calibration",
        "--overwrite",
        "--truth",
        folder / "train.truth.json",
    )


def _evaluate(folder: Path, verbose: bool) -> int:
    return _core(
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
        *["--verbose"] * verbose,
    )


def _core(*words: object) -> int:
    return _refusing(cli.main, *words)


def _refusing(program: Callable[[List[str]], int], *words: object) -> int:
    """Run a program; return 0 or 1.

    Raises:
        KeyboardInterrupt: the program was interrupted.
        StepError: it refused.
    """
    code = program([str(word) for word in words])
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    if code not in (DONE, NOT_ACCEPTABLE):
        raise StepError("the step above refused to go on; nothing further is done")
    return code


def _title(step: int, text: str) -> None:
    print(f"\n{step}/5 {text}\n", flush=True)


def _conclusion(folder: Path) -> List[str]:
    """Return what a newcomer wants to know: how good, and where."""
    document = json.loads((folder / "evaluation" / evaluate.RESULT_FILE).read_text("utf-8"))
    errors = document["ground_truth"]["mean"]
    return [
        f"sensors against the truth, on average: {1000 * errors['translation_error_m']:.2f} mm and "
        f"{errors['rotation_error_deg']:.3f} deg; at the start 100 mm and 5.7 deg",
        f"all results: {folder}/",
    ]
