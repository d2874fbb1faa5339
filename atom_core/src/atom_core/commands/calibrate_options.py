"""The options of ``calibrate``, but those of a live view."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Optional

from atom_core.calibration.options import DESCRIPTION, NO_GUESS
from atom_core.commands import common
from atom_core.commands.atom_options import CALIBRATE, add_meaningless_options
from atom_core.commands.model_error_options import add_model_error_options
from atom_core.commands.report_option import add_report_option
from atom_core.model.joints import JOINT_PARAMETERS
from atom_core.solvers.base import SolverOptions
from atom_core.solvers.choice import SOLVERS


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options but those of a live view."""
    common.add_dataset_options(parser)
    common.add_output_options(parser, "beside the dataset, under ATOM's names")
    _add_start_options(common.group(parser, "where the sensors start"))
    _add_freedom_options(common.group(parser, "what is held, what is estimated"))
    _add_joint_options(common.group(parser, "joints of a robot"))
    _add_input_options(common.group(parser, "which detections count"))
    _add_intrinsics_option(common.group(parser, "intrinsics of cameras"))
    add_model_error_options(common.group(parser, "errors of sensors, boards and arms"))
    _add_solver_options(common.group(parser, "the solver"))
    _add_shown_options(common.group(parser, "what is compared, shown and written"))
    add_meaningless_options(parser, CALIBRATE)


def _add_description_option(parser: argparse.ArgumentParser) -> None:
    common.add_option(
        parser,
        "description",
        type=Path,
        metavar="URDF_OR_XACRO",
        help="robot description to write back with the calibrated edges (default: the one that "
        "the configuration names, where it exists)",
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
    text = "with --weights atom: corners are divided by X times more; below 1 they weigh more"
    rnm = {"type": float, "default": defaults.corner_divisor, "metavar": "X", "help": text}
    add(parser, "rgb_normalizer_multiplier", "-rnm", **rnm)
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
        "-max_nfev",
        "--optimization_max_nfev",
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
        type=common.seed_of_chance,
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
        "focal length: with --optimize_intrinsics, and in combined sigmas (default: 0.5; "
        "none: anywhere, and there 0.5)",
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
    _add_joint_bias_options(parser)
    add(
        parser,
        "hold_joints",
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
        help="hold the boards where the dataset has them, or where a sensor saw them first",
    )
    add(
        parser,
        "additional_tf_selection_function",
        "-atsf",
        nargs="+",
        metavar="SELECTION",
        help="additional tfs of the configuration to estimate (default: all)",
    )


def _add_input_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
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
    add(
        parser,
        "ground_truth_pattern_poses",
        "-gtpp",
        action="store_true",
        help="refuse boards whose pose the dataset does not carry (with -ap those are held)",
    )
    add(
        parser,
        "only_anchored_sensor",
        "-oas",
        action="store_true",
        help="use the configuration's anchored sensor alone; it is held, the boards are placed",
    )
    add(
        parser,
        "remove_partial_detections",
        "-rpd",
        action="store_true",
        help="do not use labels of cameras that lack corners",
    )
    _add_keep_options(parser)


def _add_joint_bias_options(parser: argparse.ArgumentParser) -> None:
    for name, short, kind, metavar, what in (
        ("joint_bias_names", "-jbn", str, "JOINT", "joints to disturb before the calibration"),
        ("joint_bias_params", "-jbp", str, "PARAMETER", "which parameter, for each of them"),
        ("joint_bias_values", "-jbv", float, "VALUE", "what is added to it [m or rad]"),
    ):
        common.add_option(parser, name, short, nargs="+", type=kind, metavar=metavar, help=what)


def _add_truth_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
    add(
        parser,
        "truth",
        type=Path,
        metavar="FILE",
        help="the truth to compare with: a simulation's file, a dataset with true transforms, a "
        "URDF or xacro",
    )
    add(
        parser,
        "comparison_to_ground_truth",
        "-ctgt",
        action="store_true",
        help="the truth is the dataset itself, as it is before -nig and joint biases",
    )
    add(
        parser,
        "save_file_results",
        "-sfr",
        action="store_true",
        help="write the errors of the edges to a CSV in the current folder as well",
    )
    add(
        parser,
        "save_file_results_name",
        "-sfrn",
        type=Path,
        metavar="FILE",
        help="the file for them",
    )


def _add_shown_options(parser: argparse.ArgumentParser) -> None:
    add = common.add_option
    _add_description_option(parser)
    _add_truth_options(parser)
    add_report_option(parser)
    add(
        parser,
        "show_normalized_values",
        "-snv",
        action="store_true",
        help="show residuals by collection, each with its multiple of the expected deviation",
    )
    add(
        parser,
        "save_calibration_errors",
        "-sce",
        action="store_true",
        help="write mean residuals by collection as CSV",
    )
    add(
        parser,
        "phased_execution",
        "-phased",
        action="store_true",
        help="wait for a key before and after the solver: c goes on, q ends",
    )
    add(
        parser,
        "trust_checks",
        action="store_true",
        help="ask the result without a truth: two halves of the collections, each sensor by the "
        "boards of the others, loops of three sensors; eleven to thirteen times the time of a "
        "calibration",
    )
