"""ATOM's options of each command, as data: which of ours they are, or why they mean nothing here.

The page docs/coming_from_atom.md is held to this table by a test.
"""

from __future__ import annotations

import argparse
import shlex
from typing import Any, Iterable, List, NamedTuple, Optional

NOTES = "atom_notes"  # of the parsed arguments: what the user is told, each once


class AtomOption(NamedTuple):
    """An option of ATOM.

    Attributes:
        short, long: its names there, without dashes.
        example: words that may follow it.
        ours: the name of our option, which has the same meaning; None: it means nothing here.
        remark: what is different, or why it means nothing here: "because" this.
    """

    short: str
    long: str
    example: str = ""
    ours: Optional[str] = None
    remark: str = ""

    @property
    def names(self) -> List[str]:
        """Return what may be typed."""
        return [f"-{self.short}", f"--{self.long}"]

    @property
    def note(self) -> str:
        """Return what a user is told who gives an option that means nothing here."""
        return f"-{self.short} has no meaning here, because {self.remark}"


def _same(short: str, long: str, example: str = "", ours: str = "", remark: str = "") -> AtomOption:
    return AtomOption(short, long, example, ours or long, remark)


_FEW_ROWS = "all points are used: a detection costs the same whatever their number"
_OWN_CRITERION = (
    "the solver ends where no step promises anything (a calibration is converged, or says not)"
)
_NONE = "likewise; a lambda that holds for none estimates none"
_EXACT = "derivatives are exact, nothing is differenced"

CALIBRATE = (
    _same("json", "json_file", "dataset.json", ours="dataset"),
    _same("v", "verbose", remark="residuals by collection at the end; while it runs: -rv"),
    AtomOption("vo", "view_optimization", remark="RViz shows every iteration: -rv"),
    _same(
        *("snv", "show_normalized_values"),
        remark="the second number of a cell is the mean residual by its expected deviation",
    ),
    _same(
        *("rnm", "rgb_normalizer_multiplier", "0.5"),
        remark="with --weights atom; else a note: each sensor has its own noise estimated",
    ),
    _same("rv", "ros_visualization", remark="with rosrun"),
    _same("dpcc", "draw_per_collection_colors", remark="of points; with rosrun"),
    AtomOption("da", "draw_alpha", "0.3", remark="RViz's RobotModel display has an Alpha"),
    AtomOption("si", "show_images", remark="with -rv the labeled images are always published"),
    _same(
        *("oi", "optimize_intrinsics"),
        remark="names of cameras may follow; models of 4 to 8 coefficients as well",
    ),
    AtomOption("sr", "sample_residuals", "0.5", remark=_FEW_ROWS),
    AtomOption("slr", "sample_longitudinal_residuals", "0.5", remark=_FEW_ROWS),
    _same("ss", "sample_seed", "3", remark="0 without it, so that every run is reproducible"),
    AtomOption(
        *("ajf", "all_joints_fixed"),
        remark="it only made ATOM's drawing faster; --hold_joints holds all joints",
    ),
    _same("oas", "only_anchored_sensor"),
    _same("as", "anchor_sensors", "rgb_1"),
    _same(
        *("ap", "anchor_patterns"),
        remark="where the dataset has them, without collections that lack them; in a raw one, "
        "where a sensor saw them first",
    ),
    _same(
        *("gtpp", "ground_truth_pattern_poses"),
        remark="matters with -ap: boards that are estimated are placed by what the sensors see",
    ),
    _same("uic", "use_incomplete_collections", remark="the default; --complete_only: without"),
    _same("ias", "ignore_anchored_sensor"),
    _same("rpd", "remove_partial_detections", remark="the labels stay in the result's file"),
    _same("nig", "noisy_initial_guess", "0.1 0.1", remark="the second is the angle of a rotation"),
    _same("jbn", "joint_bias_names", "elbow"),
    _same("jbp", "joint_bias_params", "position_bias"),
    _same("jbv", "joint_bias_values", "-0.02", remark="origin_yaw as in URDF; see joints below"),
    _same("ssf", "sensor_selection_function", "lambda s: s != 'x'", remark="also names, globs"),
    _same("csf", "collection_selection_function", "lambda x: int(x) < 99", remark="likewise"),
    _same("psf", "pattern_selection_function", "lambda p: True", remark="likewise"),
    _same("jsf", "joint_selection_function", "lambda j: True", remark=_NONE),
    _same("jpsf", "joint_parameter_selection_function", "lambda p: 'bias' in p", remark=_NONE),
    _same("atsf", "additional_tf_selection_function", "lambda t: True", remark=_NONE),
    _same("phased", "phased_execution", remark="the keys c and q in the terminal"),
    _same(
        *("ipg", "initial_pose_ghost"),
        remark="on /calibrate/ghost; without it the ghost is the start, after -nig; with rosrun",
    ),
    _same("ctgt", "comparison_to_ground_truth", remark="by axis; --truth takes another file"),
    _same("sce", "save_calibration_errors", remark="written at the end"),
    AtomOption("ftol", "optimization_ftol", "1e-5", remark=_OWN_CRITERION),
    AtomOption("xtol", "optimization_xtol", "1e-5", remark=_OWN_CRITERION),
    AtomOption("gtol", "optimization_gtol", "1e-5", remark=_OWN_CRITERION),
    AtomOption("diff_step", "optimization_diff_step", "1e-6", remark=_EXACT),
    _same("max_nfev", "optimization_max_nfev", "100", ours="max_iterations"),
    _same("sfr", "save_file_results", remark="in the current folder, as there"),
    _same("sfrn", "save_file_results_name", "errors.csv"),
    AtomOption(
        *("oj", "output_json", "calibrated.json"),
        remark="the calibrated dataset is always atom_calibration.json, in the folder of --output",
    ),
)
_DRAWN = "RViz shows the labels of all sensors, each in a display of its own"
_ALL_SHOWN = "the clouds of all sensors of the reference collection are shown"
_BORDER = "where a depth image's border points are wrong, a polygon removes them"
COLLECT_DATA = (
    _same("o", "output_folder", "DIR", ours="output"),
    _same("c", "calibration_file", "config.yml", ours="config"),
    _same("ov", "overwrite", remark="replaces; nothing is moved to /tmp"),
    _same("s", "marker_size", "0.4"),
    AtomOption(
        *("ssl", "skip_sensor_labels", "'lambda s: False'"),
        remark="labelers are programs of their own (in ATOM, too: it does nothing any more); "
        "calibrate -ssf leaves a sensor out",
    ),
)
LABELER = (
    _same("cfg", "config_file", "config.yml", ours="config"),
    _same("sn", "sensor_name", "camera", ours="sensor"),
    AtomOption("d", "debug", remark=_DRAWN),
    AtomOption("c", "color", "1 0 0", remark=_DRAWN),
)
DATASET_PLAYBACK = (
    _same("json", "json_file", "dataset.json", ours="dataset"),
    _same("ow", "overwrite"),
    AtomOption("rnb", "remove_nan_border", remark=_BORDER),
)
TRANSFORM_CORRECTOR = (
    _same("json", "json_file", "dataset.json", ours="dataset"),
    _same("ow", "overwrite"),
    _same("pll", "parent_link_list", "a"),
    _same("cll", "child_link_list", "b"),
    _same("rc", "reference_collection", "000"),
    _same("2d", "two_dimensional"),
    _same("s", "marker_scale", "0.5"),
    AtomOption("rs", "reference_sensor", "camera", remark=_ALL_SHOWN),
    AtomOption("rnb", "remove_nan_border", remark=_BORDER),
)
ODOMETRY_INSPECTOR = (
    _same("json", "json_file", "dataset.json", ours="dataset"),
    _same("ow", "overwrite"),
    _same("op", "odometry_parent", "odom"),
    _same("oc", "odometry_child", "base_footprint"),
    _same("rc", "reference_collection", "000"),
    _same("s", "marker_scale", "0.5"),
    AtomOption("rs", "reference_sensor", "camera", remark=_ALL_SHOWN),
    AtomOption("rnb", "remove_nan_border", remark=_BORDER),
    AtomOption(
        *("csf", "collection_selection_function", "'lambda x: int(x) < 9'"),
        remark="all collections stay in the dataset; the menu goes to any of them",
    ),
)
UPDATE_CONFIG_TO_VERSION_3 = (
    _same("pn", "package_name", "my_robot_calibration", remark="or its folder"),
    _same("cfg", "config_file", "config.yml", remark="or its path"),
)
SET_INITIAL_ESTIMATE = (
    _same("f", "filename", "guess.urdf.xacro"),
    _same("s", "marker_scale", "0.5"),
    _same("c", "calibration_file", "config.yml", ours="config_file"),
)
CONFIGURE_CALIBRATION_PKG = (
    _same("n", "name", "my_robot_calibration", remark="or its folder"),
    _same("cfg", "config_file", "config.yml", remark="or its path"),
    AtomOption(
        *("cgt", "compare_ground_truth"),
        remark="a truth is compared with when it is calibrated: calibrate --truth, or -ctgt",
    ),
    AtomOption(
        *("utf", "use_tfs"),
        remark="data are collected with the bag's own /tf, and --first_guess bag takes the first "
        "guess from it",
    ),
)
CREATE_CALIBRATION_PKG = (_same("n", "name", "my_robot_calibration", remark="or its folder"),)
# Arguments of the launch files that ATOM makes for a calibration package.
LAUNCH_ARGUMENTS = {
    "playbag": (
        *("bag_file", "bag_start", "bag_rate", "optimized", "rviz_file", "description_file"),
    ),
    "set_initial_estimate": ("config_file", "output_file", "marker_size", "rviz_file"),
    "collect_data": (
        *("output_folder", "overwrite", "ow", "marker_size", "bag_file", "bag_start", "bag_rate"),
        *("ssl", "config_file", "description_file", "rviz_file"),
    ),
    "dataset_playback": ("rviz_file", "ow"),
    "calibrate": ("rviz_file",),
    "full_evaluation": ("train_json", "test_json", "csf"),
}
LIVE = ("ros_visualization", "draw_per_collection_colors", "initial_pose_ghost")  # of a node
_NO_ROS = "this program runs without ROS; use rosrun atom_calibration calibrate"


def without_ros(options: Iterable[AtomOption]) -> List[AtomOption]:
    """Return, as meaning nothing, those of a live view."""
    return [o._replace(ours=None, remark=_NO_ROS) for o in options if o.ours in LIVE]


def add_meaningless_options(parser: Any, options: Iterable[AtomOption]) -> None:
    """Accept the options that mean nothing here; each is answered with its note."""
    for option in options:
        if option.ours is None:
            parser.add_argument(
                *option.names,
                action=_Note,
                nargs=len(shlex.split(option.example)),
                dest=NOTES,
                default=argparse.SUPPRESS,
                help=argparse.SUPPRESS,
                const=option.note,
            )


class _Note(argparse.Action):
    """Keeps the note of an option that means nothing."""

    def __call__(self, parser: Any, namespace: Any, *_: Any) -> None:
        notes = getattr(namespace, NOTES, [])
        setattr(namespace, NOTES, [*notes, *([] if self.const in notes else [self.const])])
