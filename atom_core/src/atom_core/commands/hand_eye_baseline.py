"""ATOM's hand-eye baselines, as data: OpenCV's methods for one camera and one board."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.prepare.input_changes import with_biased_joints
from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.commands.calibrate_input import joint_biases
from atom_core.commands.dataset_output import refuse_existing
from atom_core.errors import DatasetError, OutputError
from atom_core.evaluation.edge_errors import EdgeError, edge_errors
from atom_core.evaluation.evaluate import evaluate
from atom_core.evaluation.hand_eye_baselines import METHODS, solved_by
from atom_core.evaluation.hand_eye_views import (
    HandEyeViews,
    Sides,
    hand_eye_views,
    usual_sides,
    with_hand_eye,
)
from atom_core.evaluation.observed import Observed
from atom_core.evaluation.single_camera import single_cameras
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import HAND_EYE_METHODS, ROBOT_WORLD_METHODS, lacking
from atom_core.geometry.units import MM_PER_M
from atom_core.io.atomic import write_text_atomically
from atom_core.io.dataset_json import read_dataset, write_dataset
from atom_core.io.paths import sibling
from atom_core.model.dataset import Dataset, is_complete
from atom_core.model.selection import select_names
from atom_core.model.truth import truth_of
from atom_core.report.atom_csv import short_csv
from atom_core.report.evaluation_tables import evaluation_report
from atom_core.report.tables import text_table

_FAR_WORSE, _FAR_WORSE_PX = 3.0, 1.0  # than the best method: no noise explains it
_FAR_OFF_RAD = 0.02  # of the best method, 20 mm at a metre: no arm explains it
_NO_START = "a closed form needs no start that could be disturbed"
_NOT_HERE = (
    AtomOption("si", "show_images", remark="nothing is drawn; the corners are those of the labels"),
    AtomOption("nig", "noisy_initial_guess", "0.1 0.1", remark=_NO_START),
    AtomOption("ss", "sample_seed", "3", remark=_NO_START),
)


class Tool(NamedTuple):
    """A command of ATOM that solves by OpenCV.

    Attributes:
        methods: that it has, its default first.
        camera_moves: the camera is on the hand; else the board is.
    """

    methods: Tuple[str, ...]
    camera_moves: bool


TOOLS = {
    "cv_eye_in_hand": Tool(HAND_EYE_METHODS, True),
    "cv_eye_to_hand": Tool(HAND_EYE_METHODS, False),
    "cv_eye_to_hand_robot_world": Tool(ROBOT_WORLD_METHODS, False),
    "li_eye_in_hand": Tool(("li",), True),
    "li_eye_to_hand": Tool(("li",), False),
    "shah_eye_in_hand": Tool(("shah",), True),
}


def example(name: str) -> str:
    """Return a command line of a tool."""
    return (
        f"python3 -m atom_core {name} -json dataset.json -c camera -p pattern_1 "
        f"-hl flange -bl base_link"
    )


def adder(name: str) -> Callable[[argparse.ArgumentParser], None]:
    """Return what adds a tool's options."""

    def add_arguments(parser: argparse.ArgumentParser) -> None:
        add, tool = common.add_option, TOOLS[name]
        common.add_dataset_option(parser)
        for dest, short, what in (("camera", "-c", "camera"), ("pattern", "-p", "board")):
            add(parser, dest, short, required=True, metavar="NAME", help=f"name of the {what}")
        carried, other = ("camera", "board") if tool.camera_moves else ("board", "camera")
        for dest, short, what in (("hand_link", "-hl", carried), ("base_link", "-bl", other)):
            text = f"a frame to which the {what} is fixed (default: its parent)"
            add(parser, dest, short, metavar="FRAME", help=text)
        text = f"one of {', '.join(tool.methods)} (default: {tool.methods[0]})"
        add(parser, "method_name", "-mn", default=tool.methods[0], metavar="METHOD", help=text)
        what = "collections to use: names, globs, '!name', or ATOM's lambda strings"
        add(parser, "collection_selection_function", "-csf", nargs="+", metavar="S", help=what)
        flags = {
            "-uic": ("use_incomplete_collections", "also where not all sensors see all patterns"),
            "-ctgt": ("comparison_to_ground_truth", "errors against the dataset's own transforms"),
            "-sfr": ("save_file_results", "write these errors as CSV"),
        }
        for short, (option, what) in flags.items():
            add(parser, option, short, action="store_true", help=what)
        add(parser, "save_file_results_name", "-sfrn", type=Path, metavar="FILE", help="its name")
        biases = {"-jbn": "joint_bias_names", "-jbp": "joint_bias_params"}
        for short, option in biases.items():
            add(parser, option, short, nargs="+", metavar="NAME", help="to disturb the robot by")
        text = "what is added, m or rad"
        add(parser, "joint_bias_values", "-jbv", nargs="+", type=float, metavar="V", help=text)
        text = "the new dataset (default: hand_eye_METHOD_CAMERA.json beside the input)"
        add(parser, "output", "-o", type=Path, metavar="FILE", help=text)
        common.add_overwrite_option(parser, "replace files")
        add_meaningless_options(parser, _NOT_HERE)

    return add_arguments


def runner(name: str) -> Callable[[argparse.Namespace], int]:
    """Return what runs a tool."""

    def run(args: argparse.Namespace) -> int:
        tool, method = TOOLS[name], args.method_name
        if method not in tool.methods:
            raise DatasetError(
                f"-mn {method}: {name} has no such method; use {', '.join(tool.methods)}"
            )
        biases = joint_biases(args)
        usual = sibling(args.dataset, f"hand_eye_{method}_{args.camera}.json")
        target = args.output or usual
        refuse_existing(args.dataset, [target], args.overwrite)
        table = _table_file(args, name)
        original = _read(args)
        dataset, remarks = with_biased_joints(original, biases)
        views = _views(tool, dataset, args)
        X = solved_by(method, views)
        if X is None:
            raise DatasetError(f"{args.dataset}: OpenCV's {method} finds no pose of the camera")
        solved = with_hand_eye(dataset, args.camera, args.pattern, views, X)
        write_dataset(solved, target)
        _show(solved, views, X, args)
        if args.comparison_to_ground_truth:
            errors = _against_input(original, dataset, solved, args.camera)
            _show_errors(errors)
            if table is not None:
                write_text_atomically(table, short_csv(errors))
        for line in remarks:
            print(line)
        print(f"\nresults: {target}")
        doubt = _doubt(dataset, views, args)
        if doubt:
            print(f"{name}: {doubt}", file=sys.stderr)
        return 1 if doubt else 0

    return run


def _doubt(dataset: Dataset, views: HandEyeViews, args: argparse.Namespace) -> str:
    """Return a sentence where another method explains the corners far better, or none does.

    OpenCV's tsai, horaud and daniilidis are at times wrong by metres, also without any noise.
    Where the robot was disturbed on purpose, it is no wonder that none does.
    """
    left_px, observed = {}, Observed(dataset)
    for method in [method for method in METHODS if not lacking(method)]:
        X = solved_by(method, views)
        if X is not None:
            solved = with_hand_eye(dataset, args.camera, args.pattern, views, X)
            board = solved.selected([args.camera], views.collections, [args.pattern])
            (single,) = single_cameras(board, observed)
            assert single.measured is not None
            left_px[method] = single.measured.pooled.mean
    best, mine = min(left_px, key=lambda name: left_px[name]), args.method_name
    far_off_px = _FAR_OFF_RAD * float(np.mean(observed.camera(args.camera).focal_px))
    if left_px[best] > far_off_px and not args.joint_bias_names:
        return (
            f"the answer of {mine} is wrong, and no method has a right one: with that of {best} "
            f"corners are {left_px[best]:.0f} px off on average; check that the robot's poses "
            f"belong to the images, the size of the board and the intrinsics"
        )
    if left_px[mine] < _FAR_WORSE * left_px[best] + _FAR_WORSE_PX:
        return ""
    return (
        f"the answer of {mine} is wrong: its corners are {left_px[mine]:.1f} px off on average, "
        f"with that of {best} {left_px[best]:.1f} px; take that one, or calibrate"
    )


def _table_file(args: argparse.Namespace, name: str) -> Optional[Path]:
    if not args.save_file_results and not args.save_file_results_name:
        return None
    if not args.comparison_to_ground_truth:
        raise OutputError("-sfr writes errors against the dataset's own transforms: add -ctgt")
    target = Path(args.save_file_results_name or args.dataset.parent / f"{name}_results.csv")
    if target.exists() and not args.overwrite:
        raise OutputError(f"{target}: exists already; add --overwrite, or another -sfrn FILE")
    return target


def _read(args: argparse.Namespace) -> Dataset:
    """Read the dataset and reduce it as ATOM does: complete collections, unless -uic is given."""

    def choose(keys: Any) -> List[str]:
        return select_names(keys, args.collection_selection_function, "collection")

    dataset = read_dataset(args.dataset, choose)
    if args.use_incomplete_collections:
        return dataset
    complete = [key for key in dataset.collections if is_complete(dataset, key)]
    if not complete:
        raise DatasetError(
            f"{args.dataset}: in no collection all sensors see all patterns; add -uic"
        )
    return dataset.selected(collections=complete)


def _views(tool: Tool, dataset: Dataset, args: argparse.Namespace) -> HandEyeViews:
    if args.camera not in dataset.sensors or args.pattern not in dataset.patterns:
        return hand_eye_views(dataset, args.camera, args.pattern)  # which refuses them
    of_camera, of_board = usual_sides(dataset, args.camera, args.pattern)
    if tool.camera_moves:
        sides = Sides(args.hand_link or of_camera, args.base_link or of_board)
    else:
        sides = Sides(args.base_link or of_camera, args.hand_link or of_board)
    for frame in sides:
        if frame not in dataset.graph:
            raise DatasetError(
                f"{args.dataset}: frame '{frame}' is in no transform; check -hl, -bl"
            )
    return hand_eye_views(dataset, args.camera, args.pattern, sides)


def _show(solved: Dataset, views: HandEyeViews, X: np.ndarray, args: argparse.Namespace) -> None:
    headers = ["pose", "x [mm]", "y [mm]", "z [mm]", "roll [deg]", "pitch [deg]", "yaw [deg]"]
    rpy = np.degrees(se3.rpy_from_rotation(X[:3, :3]))
    row = [f"{views.frame} in {views.sides.of_camera}", *(MM_PER_M * X[:3, 3]), *rpy]
    count = f"{len(views.collections)} collections"
    print(text_table(headers, [row], f"OpenCV {args.method_name}, {count}"), "\n")
    print(evaluation_report(evaluate(solved, solved, sensors=[args.camera])))


def _against_input(
    original: Dataset, start: Dataset, solved: Dataset, camera: str
) -> Sequence[EdgeError]:
    edge = original.sensors[camera].edge
    errors = edge_errors(start, solved, truth_of(original))
    return [error for error in errors if error.edge == edge]


def _show_errors(errors: Sequence[EdgeError]) -> None:
    rows = [
        [str(e.edge), MM_PER_M * e.after.translation_m, float(np.degrees(e.after.rotation_rad))]
        for e in errors
    ]
    title = "Errors against the dataset's own transforms"
    print("\n" + text_table(["Transform", "Etrans (mm)", "Erot (deg)"], rows, title))
