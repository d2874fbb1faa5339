"""Estimate the selected edges of a dataset and say how good the answer is."""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, List, Optional, Protocol, Tuple

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.options import DESCRIPTION, NO_GUESS, CalibrationOptions
from atom_core.calibration.prepare.joints import select_joints
from atom_core.commands import common
from atom_core.commands.model_error_options import (
    add_model_error_options,
    selected_model_errors,
    selected_moving_edges,
    sensors_of,
)
from atom_core.errors import CalibrationError, DescriptionError
from atom_core.io.atomic import prepare_output_folder, write_json_atomically
from atom_core.io.dataset_json import write_dataset
from atom_core.io.results import write_parameters_yaml
from atom_core.io.truth_json import read_truth
from atom_core.io.urdf import Description, read_description, write_calibrated_description
from atom_core.model.dataset import Dataset
from atom_core.model.joints import JOINT_PARAMETERS, JointSelection
from atom_core.model.selection import select_names
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import CalibrationResults, calibration_results
from atom_core.report.calibration_tables import calibration_report
from atom_core.report.edge_comments import edge_comments
from atom_core.solvers.base import CONVERGED, Iteration, SolverOptions
from atom_core.solvers.choice import CERES, SOLVERS, default_solver

EXAMPLE = "python3 -m atom_core calibrate --dataset data/dataset.json --output results"
DATASET_FILE, RESULT_FILE = "atom_calibration.json", "calibration.json"
PARAMETERS_FILE, DESCRIPTION_FILE = "atom_calibration_params.yml", "optimized.urdf.xacro"


class Watcher(Protocol):
    """Somebody who looks on while the command runs, such as a live view."""

    def begin(self, dataset: Dataset) -> None:
        """Called with the selected dataset, before anything is solved."""

    def progress(self, iteration: Iteration) -> Optional[bool]:
        """Called after every iteration, see ``SolverOptions.progress``."""

    def end(self, calibration: Calibration) -> None:
        """Called when the results are written."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    common.add_dataset_options(parser)
    common.add_output_options(parser)
    _add_solver_options(parser)
    _add_start_options(parser)
    _add_freedom_options(parser)
    _add_joint_options(parser)
    _add_keep_options(parser)
    _add_intrinsics_option(parser)
    add_model_error_options(parser)
    common.add_option(
        parser,
        "description",
        type=Path,
        metavar="URDF_OR_XACRO",
        help="robot description to write back with the calibrated edges (default: the one that "
        "the configuration names, where it exists)",
    )
    common.add_option(
        parser, "truth", type=Path, metavar="FILE", help="a simulation's truth, to compare with"
    )


def _add_solver_options(parser: argparse.ArgumentParser) -> None:
    defaults = SolverOptions()
    add = common.add_option
    add(
        parser,
        "solver",
        choices=list(SOLVERS),
        default=None,
        help="which solver (default: ceres where the native module is built, else scipy)",
    )
    add(
        parser,
        "weights",
        choices=["sigma", "atom"],
        default=defaults.weights,
        help="sigma: by standard deviations, re-estimated; atom: by the mean initial residual",
    )
    add(
        parser,
        "loss",
        choices=["none", "huber", "cauchy"],
        default=defaults.loss,
        help=f"robust loss (default: {defaults.loss})",
    )
    add(
        parser,
        "max_iterations",
        type=int,
        default=defaults.max_iterations,
        metavar="N",
        help=f"limit of the solver's steps (default: {defaults.max_iterations})",
    )
    add(
        parser,
        "undetermined_limit",
        nargs=2,
        type=float,
        default=(0.05, 0.05),
        metavar=("M", "RAD"),
        help="a larger predicted sigma counts as undetermined",
    )


def _add_start_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
    add(
        parser,
        "initial_guess",
        choices=[DESCRIPTION, NO_GUESS],
        default=DESCRIPTION,
        help="where the sensors start: the transforms that the dataset carries, or none: they are "
        "placed from the shared boards alone",
    )
    add(
        parser,
        "noisy_initial_guess",
        "-nig",
        nargs=2,
        type=float,
        default=(0.0, 0.0),
        metavar=("T", "R"),
        help="move each free edge by T metres and R radians before solving",
    )
    add(
        parser,
        "sample_seed",
        "-ss",
        type=int,
        default=0,
        metavar="N",
        help="seed of that disturbance (default: 0)",
    )


def _add_intrinsics_option(parser: argparse.ArgumentParser) -> None:
    common.add_option(
        parser,
        "optimize_intrinsics",
        "-oi",
        nargs="*",
        metavar="S",
        help="estimate focal lengths, centre and distortion of these rgb cameras too (names, "
        "globs; all without a name)",
    )
    common.add_option(
        parser,
        "intrinsics_sigma",
        type=_sigma_or_none,
        default=0.005,
        metavar="PERCENT",
        help="how far focal lengths and centre are expected from those given, in per cent of the "
        "focal length: with --optimize_intrinsics, and in combined sigmas (0.5; none: anywhere, "
        "and there 0.5)",
    )


def _sigma_or_none(text: str) -> Optional[float]:
    if text.lower() == "none":
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"'{text}' is neither per cent above 0 nor 'none'")
    return value / 100.0


def _add_keep_options(parser: argparse.ArgumentParser) -> None:
    common.add_option(
        parser,
        "keep_collections",
        nargs="+",
        metavar="K",
        help="use these collections (keys, globs) even if they contradict all others",
    )
    common.add_option(
        parser,
        "keep_detections",
        nargs="+",
        metavar="K:S",
        help="use what these sensors saw in these collections (collection:sensor) even if it "
        "contradicts all others",
    )


def _add_joint_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
    add(
        parser,
        "joint_selection_function",
        "-jsf",
        nargs="+",
        metavar="SELECTION",
        help="joints to calibrate (names, globs, lambda; default: those of the configuration)",
    )
    add(
        parser,
        "joint_parameter_selection_function",
        "-jpsf",
        nargs="+",
        metavar="SELECTION",
        help=f"which of their parameters: {', '.join(JOINT_PARAMETERS)} (default: those of the "
        f"configuration)",
    )
    add(
        parser,
        "all_joints_fixed",
        "-ajf",
        action="store_true",
        help="hold all joints, also those of the configuration",
    )


def _add_freedom_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
    add(parser, "anchor_sensors", "-as", nargs="+", metavar="S", help="further sensors to hold")
    add(
        parser,
        "ignore_anchored_sensor",
        "-ias",
        action="store_true",
        help="do not hold the configuration's anchored sensor",
    )
    add(
        parser,
        "anchor_patterns",
        "-ap",
        action="store_true",
        help="hold the boards where the dataset has them",
    )
    add(
        parser,
        "additional_tf_selection_function",
        "-atsf",
        nargs="+",
        metavar="SELECTION",
        help="additional tfs of the configuration to estimate (default: all)",
    )
    add(
        parser,
        "use_incomplete_collections",
        "-uic",
        action="store_true",
        help="accepted for ATOM's sake: incomplete collections are always used",
    )
    add(
        parser,
        "complete_only",
        action="store_true",
        help="use only collections in which every sensor sees every pattern",
    )


def run(args: argparse.Namespace, watcher: Optional[Watcher] = None) -> int:
    """Calibrate, write the results, print the tables; 1 when the answer is not acceptable.

    Args:
        args: as parsed.
        watcher: told how it gets on, if there is one.
    """
    began = time.perf_counter()
    common.refuse_occupied(args.output, args.overwrite)
    truth = read_truth(args.truth) if args.truth else None
    options = _options(args)
    dataset = common.selected_dataset(args)
    options = _with_selections(options, args, dataset)
    description = _description(args, dataset.config.description_file)
    load_seconds = time.perf_counter() - began
    if watcher is not None:
        watcher.begin(dataset)
        options = replace(options, solver=replace(options.solver, progress=watcher.progress))
    calibration = calibrate(dataset, options)
    results = calibration_results(calibration, options.solver_name or default_solver(), truth)
    writing = time.perf_counter()
    folder = prepare_output_folder(args.output, args.overwrite)
    remarks = [*_solver_remarks(options), *_write_files(folder, results, description)]
    ended = time.perf_counter()
    around = {"load": load_seconds, "write": ended - writing, "total": ended - began}
    results = replace(
        results,
        warnings=(*results.warnings, *remarks),
        seconds={**results.seconds, **around},
    )
    document = calibration_document(results, common.options_document(args))
    write_json_atomically(folder / RESULT_FILE, document, sort_keys=False)
    if watcher is not None:
        watcher.end(calibration)
    print(calibration_report(results, verbose=args.verbose))
    print(f"results: {folder}")
    return 0 if calibration.status == CONVERGED else 1


def _solver_remarks(options: CalibrationOptions) -> List[str]:
    if options.solver_name is None and default_solver() != CERES:
        return ["solved by scipy: run `make build` for the faster ceres"]
    return []


def _with_selections(
    options: CalibrationOptions, args: argparse.Namespace, dataset: Dataset
) -> CalibrationOptions:
    """Return the options with what the arguments select of a dataset."""
    if args.additional_tf_selection_function:
        names = select_names(
            dataset.config.additional_tfs, args.additional_tf_selection_function, "additional tf"
        )
        options = replace(options, additional_tfs=tuple(names))
    selected: Dict[str, Any] = dict(selected_model_errors(args, dataset))
    return replace(
        options,
        **selected,
        moving_edge_sigma=selected_moving_edges(args, dataset),
        joints=_joints(args, dataset),
        intrinsics=sensors_of(
            dataset,
            "--optimize_intrinsics",
            args.optimize_intrinsics,
            lambda kind: kind.can_estimate_intrinsics,
        ),
        keep_collections=_kept_collections(args, dataset),
        keep_detections=_kept_detections(args, dataset),
    )


def _options(args: argparse.Namespace) -> CalibrationOptions:
    try:
        return CalibrationOptions(
            solver=SolverOptions(
                weights=args.weights, loss=args.loss, max_iterations=args.max_iterations
            ),
            solver_name=args.solver,
            anchor_sensors=tuple(common.strings(args.anchor_sensors)),
            ignore_anchored_sensor=args.ignore_anchored_sensor,
            anchor_patterns=args.anchor_patterns,
            complete_only=args.complete_only,
            initial_guess=args.initial_guess,
            noisy_initial_guess=tuple(args.noisy_initial_guess),
            seed=args.sample_seed,
            undetermined_limit=tuple(args.undetermined_limit),
            intrinsics_sigma=args.intrinsics_sigma,
            model_errors=args.model_errors,
        )
    except ValueError as error:
        raise CalibrationError(str(error)) from None


def _joints(args: argparse.Namespace, dataset: Dataset) -> Optional[JointSelection]:
    joints, parameters = args.joint_selection_function, args.joint_parameter_selection_function
    if args.all_joints_fixed:
        if joints or parameters:
            raise CalibrationError("--all_joints_fixed holds what a selection of joints frees")
        return {}
    if not joints and not parameters:
        return None
    return select_joints(dataset, common.strings(joints), common.strings(parameters))


def _kept_collections(args: argparse.Namespace, dataset: Dataset) -> Tuple[str, ...]:
    if not args.keep_collections:
        return ()
    return tuple(select_names(dataset.collections, args.keep_collections, "collection"))


def _kept_detections(args: argparse.Namespace, dataset: Dataset) -> Tuple[Tuple[str, str], ...]:
    detected = {(key.collection, key.sensor) for key, _ in dataset.detections()}
    kept = []
    for text in common.strings(args.keep_detections):
        collection, _, sensor = text.partition(":")
        if (collection, sensor) not in detected:
            raise CalibrationError(
                f"--keep_detections {text}: there is no such detection; write collection:sensor, "
                f"as in 003:rgb_1"
            )
        kept.append((collection, sensor))
    return tuple(kept)


def _description(args: argparse.Namespace, configured: Optional[str]) -> Optional[Description]:
    """Read the description that was asked for; the configuration's only where it can be found."""
    if args.description:
        return read_description(args.description)
    if not configured:
        return None
    try:
        return read_description(configured)
    except DescriptionError:
        return None


def _write_files(
    folder: Path, results: CalibrationResults, description: Optional[Description]
) -> List[str]:
    """Write dataset, parameters and description; return what the user should know."""
    calibration = results.calibration
    write_dataset(calibration.dataset, folder / DATASET_FILE, calibration.relabeled)
    write_parameters_yaml(
        folder / PARAMETERS_FILE,
        calibration.dataset,
        calibration.free.additional_tfs,
        calibration.free.joints,
    )
    if description is None:
        return ["no robot description found: optimized.urdf.xacro is not written (--description)"]
    return _write_description(folder / DESCRIPTION_FILE, results, description)


def _write_description(
    path: Path, results: CalibrationResults, description: Description
) -> List[str]:
    calibration = results.calibration
    edges = {edge.edge: edge.parent_T_child for edge in results.edges}
    origins = {
        name: calibration.dataset.joint(name).corrected_origin for name in calibration.free.joints
    }
    comments = edge_comments(results)
    report = write_calibrated_description(description, edges, path, comments, origins)
    missing = [*report.missing, *report.missing_joints]
    remarks = [f"'{what}' is not written to {path.name}: {why}" for what, why in missing]
    if report.flattened:
        remarks.append(f"{path.name} is the expanded description: {report.reason}")
    return remarks
