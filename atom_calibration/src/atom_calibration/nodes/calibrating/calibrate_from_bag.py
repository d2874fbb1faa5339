"""From a bag to a calibration: collections in DIR/dataset, results in DIR/calibration.

DIR/status.json says how far it came: {"step", "exit_code", "message"}, and once there is a result
its {"verdict"}; the exit code of a step that has not ended, or was killed, is null. With -rv the
calibration is shown in RViz while it runs.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

from atom_calibration.nodes.calibrating.calibration_view import CalibrationView
from atom_calibration.nodes.collecting import collect_from_bag
from atom_calibration.runtime import running
from atom_calibration.runtime.options import add_receive_time_option, optional_path
from atom_calibration.runtime.status import STATUS_FILE, write_begun, write_status
from atom_calibration.show.view_options import add_view_options, take_view_options
from atom_calibration.sources.described_bag import SAVED
from atom_core import cli
from atom_core.commands import calibrate
from atom_core.commands.calibrate import DATASET_FILE as RESULT_FILE
from atom_core.commands.calibrate import NOT_CONVERGED_FOLDER
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.commands.report_option import add_report_option
from atom_core.errors import AtomError, OutputError
from atom_core.io.dataset_writer import DATASET_FILE
from atom_core.io.json_text import load_json

Said = Dict[str, Any]  # entries of status.json
EXAMPLE = """
roslaunch atom_calibration calibrate_from_bag.launch config:=config.yml bag:=train.bag output:=all
rosrun atom_calibration calibrate_from_bag --config config.yml --bag train.bag --output all
"""


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the steps until one is not done; return its exit code."""
    args = parser().parse_args(argv)
    args.view, stay = take_view_options(args)
    try:
        args.output.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            (args.output / STATUS_FILE).unlink()
        if args.view:
            running.check_master()  # and not only when the collections are there
    except OSError as error:
        print(f"calibrate_from_bag: {args.output}: {error.strerror}", file=sys.stderr)
        return cli.BAD_INPUT
    except AtomError as error:
        print(f"calibrate_from_bag: {error}", file=sys.stderr)
        return cli.BAD_INPUT
    code, steps = 0, (("collect", _collect), ("calibrate", _calibrate))
    for step, run in steps:
        try:
            write_begun(args.output, step)
            code, said = _outcome(step, run, args)
            write_status(args.output, step, exit_code=code, **said)
        except OutputError as error:
            print(f"calibrate_from_bag: {error}", file=sys.stderr)
            return cli.BAD_INPUT
        if code in (cli.BAD_INPUT, cli.INTERRUPTED):
            print(f"calibrate_from_bag: {step}: {said['message']}", file=sys.stderr)
            return code
    if args.view and stay:
        running.wait()
    return code


def _outcome(
    step: str, run: Callable[[argparse.Namespace], Tuple[int, Said]], args: argparse.Namespace
) -> Tuple[int, Said]:
    try:
        return run(args)
    except AtomError as error:
        return cli.BAD_INPUT, {"message": str(error)}
    except KeyboardInterrupt:
        rest = "interrupted, nothing more is written"
        if step == "collect":
            rest = collect_from_bag.interrupted(args.output / "dataset")
        return cli.INTERRUPTED, {"message": rest}


def _collect(args: argparse.Namespace) -> Tuple[int, Said]:
    options = ["--config", args.config, "--bag", *args.bag, "--output", args.output / "dataset"]
    options += ["--seeds", args.seeds] if args.seeds else []
    if args.description is not None:
        options += ["--description", *([] if args.description == SAVED else [args.description])]
    options += ["--use_receive_time", *args.use_receive_time] if args.use_receive_time else []
    parsed = collect_from_bag.parser().parse_args(_texts(options, args))
    code = collect_from_bag.collect_from_bag(parsed)
    nothing = "some sensors or moments gave nothing; see the output"
    return code, {"message": nothing if code else "done"}


def _calibrate(args: argparse.Namespace) -> Tuple[int, Said]:
    folder = args.output / "calibration"
    options = ["calibrate", "--dataset", args.output / "dataset" / DATASET_FILE]
    options += ["--output", folder]
    options += ["--truth", args.truth] if args.truth else []
    options += ["--no_report"] if args.no_report else []
    parsed = cli.build_parser().parse_args(_texts(options, args))
    if args.view:
        running.start("calibrate_from_bag")
    code = calibrate.run(parsed, CalibrationView(args.view) if args.view else None)
    if (folder / NOT_CONVERGED_FOLDER).is_dir():  # results of before are better, and stay
        folder /= NOT_CONVERGED_FOLDER
    try:
        result = load_json((folder / "calibration.json").read_text(encoding="utf-8"))
        verdict = {key: result["verdict"][key] for key in ("grade", "sentence")}
        return code, {"message": f"{result['status']}: {result['message']}", "verdict": verdict}
    except (OSError, ValueError, KeyError):
        return code, {"message": f"see {folder / RESULT_FILE}"}


def _texts(options: List[object], args: argparse.Namespace) -> List[str]:
    return [str(option) for option in options] + (["--overwrite"] if args.overwrite else [])


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = OptionParser(prog="calibrate_from_bag", description=__doc__, epilog=examples(EXAMPLE))
    add_option(made, "config", required=True, type=Path, metavar="FILE", help="config.yml")
    collect_from_bag.add_bag_option(made)
    add_option(made, "output", "-o", required=True, type=Path, metavar="DIR", help="results")
    add_option(made, "seeds", type=optional_path, metavar="FILE", help="seeds given by hand")
    collect_from_bag.add_description_option(made, optional_path)
    add_receive_time_option(made)
    add_option(made, "truth", type=optional_path, metavar="FILE", help="a simulation's truth")
    add_option(made, "overwrite", "-ow", action="store_true", help="replace earlier results")
    add_report_option(made)
    add_view_options(made)
    return made


def run_as_node() -> int:
    """Run with the arguments of a launch file, without those that are roslaunch's own."""
    code = main(running.arguments())
    running.end_launch(code)
    return code
