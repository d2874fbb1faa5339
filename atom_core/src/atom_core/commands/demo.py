"""Show the main job on the paper's cell: simulate, check, calibrate, evaluate."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import List

from atom_core.commands import calibrate, check, common, evaluate, report
from atom_core.commands.option_parser import OptionParser
from atom_core.commands.progress import watched
from atom_core.commands.report_option import add_report_option
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.io.truth_json import write_truth
from atom_core.synthetic import Noise, paper_cell

EXAMPLE = "python3 -m atom_core demo --output demo_output --overwrite"
_DISTURBANCE = (0.1, 0.1)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_output_options(parser)
    add_report_option(parser)
    common.add_option(
        parser, "seed", type=int, default=0, metavar="N", help="of rig, boards and noise"
    )


def run(args: argparse.Namespace) -> int:
    """Run the four steps; 1 when the calibration is not acceptable."""
    folder = prepare_output_folder(args.output, args.overwrite)
    print(
        f"1/4 simulated cell: 3 rgb, 1 depth, 3 lidar3d, seed {args.seed}; every free sensor "
        f"starts {_DISTURBANCE[0]} m and {_DISTURBANCE[1]} rad off the truth"
    )
    for scenario in watched(("train", "test"), 2, "writing datasets", "datasets"):
        cell = paper_cell(args.seed, scenario, Noise(), _DISTURBANCE)
        write_dataset_folder(cell.dataset, folder / scenario, name=scenario, overwrite=True)
        write_truth(cell.truth, folder / f"{scenario}.truth.json")
    train = str(folder / "train" / "dataset.json")
    print("\n2/4 check\n")
    _run(check, ["--dataset", train])
    print("\n3/4 calibrate\n")
    result = folder / "calibration"
    options = ["--output", str(result), "--overwrite", "--no_report"]
    truth = ["--truth", str(folder / "train.truth.json")]
    status = _run(calibrate, ["--dataset", train] + options + truth)
    print("\n4/4 evaluate on the test set\n")
    _run(evaluate, _evaluation_arguments(folder, result))
    print(f"\nall results: {folder.resolve()}")
    results = ["--calibration", str(result), "--evaluation", str(folder / "evaluation")]
    if not args.no_report:
        _run(report, [*results, "--output", str(folder), "--overwrite"])
    return status


def _evaluation_arguments(folder: Path, result: Path) -> List[str]:
    return [
        *("--train", str(result / calibrate.DATASET_FILE)),
        *("--test", str(folder / "test" / "dataset.json")),
        *("--truth", str(folder / "test.truth.json")),
        *("--output", str(folder / "evaluation")),
        "--overwrite",
        "--no_report",
    ]


def _run(command: common.Command, arguments: List[str]) -> int:
    parser = OptionParser()
    command.add_arguments(parser)
    return command.run(parser.parse_args(arguments))
