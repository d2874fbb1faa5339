"""``python3 -m atom_core COMMAND``: dispatch, exit codes, one line for every refusal.

Exit codes: 0 done, 1 finished but not acceptable (results are written), 2 bad input or usage
(nothing is written).
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
from typing import TYPE_CHECKING, Callable, List, Optional, cast

import atom_core
from atom_core.commands.option_parser import HelpFormatter, OptionParser, examples
from atom_core.commands.substitutes import SUBSTITUTES, refuse
from atom_core.errors import AtomError
from atom_core.io.printing import print_any_text

if TYPE_CHECKING:
    from atom_core.commands.common import Command

# How launch files call options whose names stand in sentences.
_OF_LAUNCHES = {
    "--overwrite": "overwrite:=true",
    "--automatic": "automatic:=true",
    **{f"--{name}": f"{name}:=..." for name in ("dataset", "output", "truth", "seeds")},
    "--description": "description:=...",
    "--parent_link_list": "parents:=...",
    "--child_link_list": "children:=...",
    "--patterns": "patterns:=...",
}
BAD_INPUT = 2
INTERRUPTED = 130
BROKEN_PIPE = 141

# Modules of atom_core.commands below the headings of --help; those that are not asked for are not
# loaded.
COMMAND_GROUPS = {
    "the main steps": (
        "check",
        "calibrate",
        "evaluate",
        "report",
        "demo",
    ),
    "datasets": (
        "convert",
        "recover",
        "inspect_atom_dataset",
        "merge_atom_datasets",
        "split_atom_dataset",
        "remove_collections_from_atom_dataset",
        "filter_dataset_based_on_joint_states",
        "rename_atom_dataset",
        "rename_sensor",
        "add_ground_truth_to_dataset",
        "copy_tfs_from_dataset",
        "estimate_pattern_poses",
        "update_dataset_from_version_2_to_3",
        "convert_from_rwhe_dataset",
        "convert_from_rwhe_synthetic_dataset",
        "convert_from_tabb_dataset",
        "convert_to_rwhe_dataset",
        "convert_to_tabb_dataset",
    ),
    "one figure of `evaluate`, under ATOM's names": (
        "rgb_to_rgb_evaluation",
        "lidar_to_rgb_evaluation",
        "lidar_to_depth_evaluation",
        "depth_to_rgb_evaluation",
        "depth_to_depth_evaluation",
        "lidar_to_lidar_evaluation",
        "inter_collection_rgb_to_rgb_evaluation",
        "inter_collection_lidar_to_rgb_evaluation",
        "inter_collection_lidar_to_depth_evaluation",
        "inter_collection_depth_to_rgb_evaluation",
        "inter_collection_depth_to_depth_evaluation",
        "inter_collection_lidar_to_lidar_evaluation",
        "single_rgb_evaluation",
        "ground_truth_frame_evaluation",
        "ground_truth_transform_evaluation",
        "annotate_pattern_borders_in_rgb_or_depth",
        "annotate_pattern_borders_in_lidar",
    ),
    "other methods, to compare with": (
        "kalibr_stereo_calib",
        "dahll2017",
        "cv_stereo_calib",
        "icp_calibration",
        "cv_eye_in_hand",
        "cv_eye_to_hand",
        "cv_eye_to_hand_robot_world",
        "li_eye_in_hand",
        "li_eye_to_hand",
        "shah_eye_in_hand",
    ),
    "many runs": (
        "batch_execution",
        "process_results",
    ),
}
COMMANDS = tuple(name for names in COMMAND_GROUPS.values() for name in names)


class _GroupedCommands(HelpFormatter):
    """Help with a heading above each group of commands."""

    def _format_action(self, action: argparse.Action) -> str:
        """Return an entry, below its group's heading where it is the first of one."""
        text = super()._format_action(action)
        firsts = {names[0]: heading for heading, names in COMMAND_GROUPS.items()}
        heading = firsts.get(str(action.dest)) if not action.option_strings else None
        return f"\n  {heading}:\n{text}" if heading else text


def build_parser(only: Optional[str] = None) -> argparse.ArgumentParser:
    """Return the parser of all commands.

    Args:
        only: a command; the others are not there, and their modules are not loaded.
    """
    parser = OptionParser(
        prog="python3 -m atom_core",
        description="Calibrate the sensors of a robotic cell in one optimisation.",
        epilog="python3 -m atom_core COMMAND --help tells more of each.",
        formatter_class=_GroupedCommands,
    )
    parser.add_argument("--version", action="version", version=atom_core.__version__)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in [only] if only in COMMANDS else COMMANDS:
        module = cast("Command", importlib.import_module(f"atom_core.commands.{name}"))
        summary = str(module.__doc__).splitlines()[0]
        sub = commands.add_parser(
            name,
            help=summary,
            description=summary,
            epilog=examples(module.EXAMPLE),
        )
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run one command; return its exit code."""
    words = sys.argv[1:] if argv is None else argv
    if words and words[0] in SUBSTITUTES:  # whatever options stand behind it
        return refuse(words[0])
    args = build_parser(words[0] if words else None).parse_args(words)
    return guarded(args.command, lambda: int(args.run(args)))


def as_typed(text: str) -> str:
    """Return a sentence with its options as the user types them, who may have typed roslaunch."""
    if not any(word.startswith("__log:=") for word in sys.argv):
        return text
    for option, argument in _OF_LAUNCHES.items():
        text = re.sub(rf"{option}\b", argument, text)
    return text


def guarded(command: str, run: Callable[[], int]) -> int:
    """Run a command; return its exit code. A refusal is one line on stderr."""
    print_any_text()
    try:
        return run()
    except AtomError as error:
        print(f"{command}: {as_typed(str(error))}", file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:  # the reader of a pipe has gone, e.g. `| head`
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (so that nothing is flushed at exit)
        return BROKEN_PIPE
    except OSError as error:  # a name that is too long, a disk that went away
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"{command}: {where}{(error.strerror or str(error)).lower()}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{command}: interrupted, nothing more is written", file=sys.stderr)
        return INTERRUPTED
