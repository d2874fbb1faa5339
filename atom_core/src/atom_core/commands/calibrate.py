"""Estimate the selected edges of a dataset and say how good the answer is."""

from __future__ import annotations

import argparse
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple, Union

from atom_core.calibration.calibrate import Calibration, calibrate
from atom_core.calibration.options import CalibrationOptions
from atom_core.calibration.prepare.description import description_caveats
from atom_core.calibration.prepare.joints import select_joints
from atom_core.calibration.prepare.preparation import free_edges
from atom_core.commands import common
from atom_core.commands.atom_options import CALIBRATE, add_meaningless_options, without_ros
from atom_core.commands.calibrate_input import CalibrationInput, read_input
from atom_core.commands.calibrate_options import add_options
from atom_core.commands.calibrated_descriptions import DESCRIPTION_FILES, write_descriptions
from atom_core.commands.model_error_options import (
    selected_model_errors,
    selected_moving_edges,
    sensors_of,
    stated_priors,
)
from atom_core.commands.phases import Phases, Watcher
from atom_core.commands.provenance import inputs, versions
from atom_core.commands.report_files import REPORT_FILES, RESIDUALS_FILE, report_beside
from atom_core.commands.verdict_output import print_next, print_verdict
from atom_core.errors import CalibrationError, DescriptionError, OutputError
from atom_core.evaluation.trust.checks import trust_checks
from atom_core.io.atomic import (
    prepare_output_folder,
    write_bytes_atomically,
    write_json_atomically,
    write_text_atomically,
)
from atom_core.io.dataset_json import write_dataset
from atom_core.io.json_text import load_json
from atom_core.io.results import write_arguments_yaml, write_parameters_yaml
from atom_core.io.together import finish_interrupted, written_together
from atom_core.io.urdf import Description, read_description
from atom_core.model.dataset import Dataset
from atom_core.model.joints import JointSelection
from atom_core.model.selection import select_names
from atom_core.report.atom_csv import (
    ERRORS_FILE,
    JOINTS_FILE,
    SHORT_FILE,
    TRANSFORMS_FILE,
    atom_files,
    short_csv,
)
from atom_core.report.calibration_document import calibration_document
from atom_core.report.calibration_results import CalibrationResults, calibration_results
from atom_core.report.calibration_tables import calibration_report
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.residual_samples import residual_samples, to_bytes
from atom_core.report.verdict import WRONG
from atom_core.solvers.base import ATOM, CONVERGED, SolverOptions
from atom_core.solvers.choice import CERES, default_solver

EXAMPLE = """
python3 -m atom_core calibrate --dataset data/dataset.json --output results
python3 -m atom_core calibrate -json data/dataset.json --output results -ssf 'rgb_*' -nig 0.1 0.1
"""
DATASET_FILE, RESULT_FILE = "atom_calibration.json", "calibration.json"
PARAMETERS_FILE = "atom_calibration_params.yml"
ORIGINAL_FILE, ARGUMENTS_FILE = "original_calibration_params.yml", "command_line_args.yml"
_ATOMS_FILES = (
    *(DATASET_FILE, PARAMETERS_FILE, *DESCRIPTION_FILES),
    *(ORIGINAL_FILE, ARGUMENTS_FILE),
)
_ALWAYS = (RESULT_FILE, RESIDUALS_FILE, *_ATOMS_FILES, *REPORT_FILES)
RESULT_FILES = (*_ALWAYS, ERRORS_FILE, TRANSFORMS_FILE, JOINTS_FILE)
NOT_CONVERGED_FOLDER = "not_converged"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command, for a program without ROS."""
    add_options(parser)
    add_meaningless_options(parser, without_ros(CALIBRATE))


def run(args: argparse.Namespace, watcher: Optional[Watcher] = None) -> int:
    """Calibrate, write the results, print the tables; 1 when the answer is not acceptable.

    Args:
        args: as parsed.
        watcher: told how it gets on, if there is one.
    """
    began = time.perf_counter()
    folder = _checked_folder(args)
    options = _options(args)
    given = read_input(args)
    options = _with_selections(options, args, given)
    description = _description(args, given.dataset.config.description_file)
    if not isinstance(description, DescriptionError):
        free = free_edges(given.dataset, options)
        of_description = description_caveats(
            given.dataset, free, description.robot, description.path
        )
        given = replace(given, dataset=given.dataset.with_caveats(of_description))
    load_seconds = time.perf_counter() - began
    phases = Phases(watcher) if args.phased_execution else None
    looking_on = phases or watcher
    if looking_on is not None:
        looking_on.begin(given.dataset)
        options = replace(options, solver=replace(options.solver, progress=looking_on.progress))
    calibration = calibrate(given.dataset, options)
    if phases is not None and phases.ended:
        raise CalibrationError("-phased: ended by the key q at the start; nothing is written")
    solver = options.solver_name or default_solver()
    trust = trust_checks(calibration, options) if args.trust_checks else None
    results = calibration_results(calibration, solver, given.truth, trust)
    writing = time.perf_counter()
    prepare_output_folder(folder, args.overwrite or not args.output)
    folder, remarks = _where_nothing_good_is_lost(folder, calibration.status)
    with written_together(folder, RESULT_FILES):
        remarks += [*_solver_remarks(options), *_write_files(folder, results, description)]
        _write_atoms_files(folder, args, results, given.original)
        ended = time.perf_counter()
        around = {"load": load_seconds, "write": ended - writing, "total": ended - began}
        results = replace(
            results,
            warnings=(*given.remarks, *results.warnings, *remarks),
            seconds={**results.seconds, **around},
        )
        _write_document(folder, args, results)
    if calibration.status == CONVERGED:
        _remove_results(folder / NOT_CONVERGED_FOLDER)
    if looking_on is not None:
        looking_on.end(calibration, options)
    return _conclude(args, folder, calibration, results)


def _conclude(
    args: argparse.Namespace, folder: Path, calibration: Calibration, results: CalibrationResults
) -> int:
    """Print the tables, the verdict and what comes next; return the exit code."""
    print(calibration_report(results, args.verbose, args.show_normalized_values))
    print(f"\nresults: {folder.resolve()}\n")
    verdict = calibration_verdict(results)
    print_verdict(verdict)
    if not args.no_report and not calibration.summary.interrupted:
        report_beside(folder, folder, None, calibration.dataset)
    if calibration.status != CONVERGED or verdict.grade == WRONG:
        return 1
    words = ("--train", str(folder.resolve() / DATASET_FILE), "--test", "OTHER/dataset.json")
    print_next("evaluate", *words, "--output", "evaluation")
    return 0


def _write_document(folder: Path, args: argparse.Namespace, results: CalibrationResults) -> None:
    """Write the result itself, and the residuals that its report draws."""
    document = calibration_document(results, common.options_document(args))
    document["inputs"] = inputs(
        dataset=args.dataset, truth=args.truth, description=args.description
    )
    document["versions"] = versions()
    write_json_atomically(folder / RESULT_FILE, document, sort_keys=False)
    samples = residual_samples(results.calibration)
    write_bytes_atomically(folder / RESIDUALS_FILE, to_bytes(samples))


def _checked_folder(args: argparse.Namespace) -> Path:
    """Return where the results go, when nothing there would be lost; nothing is made."""
    short = _short_file(args)
    if short is not None and short.exists() and not args.overwrite:
        raise OutputError(f"{short}: exists already; add --overwrite, or another -sfrn FILE")
    if short is not None and short.parent != args.output and not short.parent.is_dir():
        raise OutputError(f"{short}: its folder is not there; create it, or another -sfrn FILE")
    if args.output:
        common.refuse_occupied(args.output, args.overwrite)
        return Path(args.output)
    names = list(_ALWAYS)
    if args.save_calibration_errors:
        names.append(ERRORS_FILE)
    if args.truth or args.comparison_to_ground_truth:
        names += [TRANSFORMS_FILE, JOINTS_FILE]
    return common.refuse_results_beside(args.dataset, names, args.overwrite)


def _where_nothing_good_is_lost(folder: Path, status: str) -> Tuple[Path, List[str]]:
    """Return where results go, and what is to be said of it: none replaces a better one."""
    if status == CONVERGED or not _holds_converged_results(folder):
        return folder, []
    aside = prepare_output_folder(folder / NOT_CONVERGED_FOLDER, overwrite=True)
    return aside, [f"the converged results of before stay in {folder}; this run's are in {aside}"]


def _holds_converged_results(folder: Path) -> bool:
    finish_interrupted(folder)
    try:
        earlier = load_json((folder / RESULT_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(earlier, dict) and earlier.get("status") == CONVERGED


def _remove_results(folder: Path) -> None:
    """Remove what an earlier run left in a folder, and the folder if nothing else is in it."""
    with suppress(OSError):
        for name in RESULT_FILES:
            with suppress(FileNotFoundError):
                (folder / name).unlink()
        folder.rmdir()


def _short_file(args: argparse.Namespace) -> Optional[Path]:
    """Return the file of -sfr, which ATOM writes to the current folder."""
    if not args.truth and not args.comparison_to_ground_truth:
        return None
    if args.save_file_results_name:
        return Path(args.save_file_results_name)
    return Path(SHORT_FILE) if args.save_file_results else None


def _write_atoms_files(
    folder: Path, args: argparse.Namespace, results: CalibrationResults, original: Dataset
) -> None:
    """Write what ATOM's users and their batches look for."""
    free = results.calibration.free
    write_parameters_yaml(folder / ORIGINAL_FILE, original, free.additional_tfs, free.joints)
    write_arguments_yaml(folder / ARGUMENTS_FILE, common.options_document(args))
    for name, text in atom_files(results, args.save_calibration_errors).items():
        write_text_atomically(folder / name, text)
    short = _short_file(args)
    if short is not None:
        write_text_atomically(short, short_csv(results.edge_errors or ()))


def _solver_remarks(options: CalibrationOptions) -> List[str]:
    remarks = []
    if options.solver_name is None and default_solver() != CERES:
        remarks.append("solved by scipy: run `make build` for the faster ceres")
    if options.solver.corner_divisor != 1.0 and options.solver.weights != ATOM:
        remarks.append("-rnm has no effect without --weights atom: noise is estimated by sensor")
    usual = CalibrationOptions.intrinsics_sigma
    if options.solver.weights == ATOM and options.intrinsics_sigma not in (usual, None):
        remarks.append(
            "--intrinsics_sigma has no effect with --weights atom, whose weights are no variances"
        )
    return remarks


def _with_selections(
    options: CalibrationOptions, args: argparse.Namespace, given: CalibrationInput
) -> CalibrationOptions:
    """Return the options with what the arguments select of a dataset, and do to it."""
    dataset = given.dataset
    if args.additional_tf_selection_function:
        selection = args.additional_tf_selection_function
        there = dataset.config.additional_tfs
        names = select_names(there, selection, "additional tf", may_be_empty=True)
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
        joint_biases=given.joint_biases,
        unused_collections=given.unused,
    )


def _options(args: argparse.Namespace) -> CalibrationOptions:
    try:
        return CalibrationOptions(
            solver=SolverOptions(
                weights=args.weights,
                loss=args.loss,
                max_iterations=args.max_iterations,
                corner_divisor=args.rgb_normalizer_multiplier,
            ),
            solver_name=args.solver,
            anchor_sensors=tuple(common.strings(args.anchor_sensors)),
            ignore_anchored_sensor=args.ignore_anchored_sensor,
            anchor_patterns=args.anchor_patterns,
            only_anchored_sensor=args.only_anchored_sensor,
            initial_guess=args.initial_guess,
            noisy_initial_guess=tuple(args.noisy_initial_guess),
            seed=args.sample_seed,
            undetermined_limit=tuple(args.undetermined_limit),
            intrinsics_sigma=args.intrinsics_sigma,
            priors=stated_priors(args.prior),
            model_errors=args.model_errors,
        )
    except ValueError as error:
        raise CalibrationError(str(error)) from None


def _joints(args: argparse.Namespace, dataset: Dataset) -> Optional[JointSelection]:
    joints, parameters = args.joint_selection_function, args.joint_parameter_selection_function
    if args.hold_joints:
        if joints or parameters:
            raise CalibrationError("--hold_joints holds what a selection of joints frees")
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


def _description(
    args: argparse.Namespace, configured: Optional[str]
) -> Union[Description, DescriptionError]:
    """Return the description that was asked for; the configuration's, or why it cannot be read."""
    if args.description:
        return read_description(args.description)
    if not configured:
        return DescriptionError("the dataset names no robot description (--description)")
    try:
        return read_description(configured)
    except DescriptionError as error:
        return error


def _write_files(
    folder: Path,
    results: CalibrationResults,
    description: Union[Description, DescriptionError],
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
    return write_descriptions(folder, results, description)
