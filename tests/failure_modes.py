"""What goes wrong with tools that calibrate, what happens here instead, and the tests of it.

`docs/reliability.md` is written from this list by `docs/make_reliability.py`. The failures are
those that users of such tools reported.
"""

from __future__ import annotations

from typing import NamedTuple, Tuple


class FailureMode(NamedTuple):
    """A failure that users met, what happens here, and tests as ``file::function``."""

    number: int
    failure: str
    here: str
    tests: Tuple[str, ...]


_CALIBRATION = "atom_core/tests/calibration"
_LABELING = "atom_core/tests/labeling"
_NODES = "atom_calibration/tests"

FAILURE_MODES = (
    FailureMode(
        1,
        "A bad first guess ends in a local minimum",
        "sensors are placed from the labels alone where the guess and the data disagree; several "
        "starts lead to one answer",
        (
            f"{_CALIBRATION}/test_initial_sensors.py::"
            "test_cells_are_found_without_a_guess_and_from_a_bad_one",
            f"{_CALIBRATION}/test_initial_sensors.py::test_no_guess_and_a_good_guess_give_the_same_answer",
        ),
    ),
    FailureMode(
        2,
        "The answer depends on the first guess, through weights that are taken from it",
        "weights are the sensors' noise, estimated from the residuals at the end",
        (
            f"{_CALIBRATION}/test_calibrate.py::test_the_answer_does_not_depend_on_the_start",
            "atom_core/tests/solvers/test_levenberg_marquardt.py::test_planted_sigmas_are_found",
        ),
    ),
    FailureMode(
        3,
        "Sensors whose names contain one another are mixed up",
        "names are compared as a whole",
        (f"{_CALIBRATION}/test_calibrate.py::test_names_that_contain_one_another_stay_apart",),
    ),
    FailureMode(
        4,
        "The board's rows and columns are swapped, squares counted for corners, its size is wrong",
        "the sentence names the size that fits; a board of another size is told by the sensors "
        "that measure ranges",
        (
            f"{_LABELING}/test_rgb.py::test_swapped_rows_and_columns_are_named",
            "atom_core/tests/problem/test_measured_size.py::"
            "test_a_board_of_another_size_is_told_for_each_sensor_with_both_sizes",
        ),
    ),
    FailureMode(
        5,
        "ChArUco boards of before OpenCV 4.6 have another layout",
        "both are tried, and the one that fits is taken; the same pictures are labeled with every "
        "version of OpenCV that is tested",
        (
            f"{_LABELING}/test_charuco_layouts.py::test_the_layout_of_an_even_number_of_rows_is_recognised",
            f"{_LABELING}/test_charuco_layouts.py::test_the_layout_of_an_odd_number_of_columns_is_not_mistaken",
        ),
    ),
    FailureMode(
        6,
        "ChArUco corners are interpolated without the lens, and wrong where it bends",
        "corners are refined in the image; they are where the lens puts them",
        (f"{_LABELING}/test_rgb.py::test_corners_are_exact_and_without_bias",),
    ),
    FailureMode(
        7,
        "A flat board has two poses that look alike; a board is read as its mirror image",
        "both poses stay until the other sensors have decided; mirrored images are named",
        (
            f"{_CALIBRATION}/test_half_turns.py::test_renumbered_twice_is_as_before",
            f"{_LABELING}/test_rgb.py::test_a_mirrored_charuco_is_named",
        ),
    ),
    FailureMode(
        8,
        "Points behind a camera count as if they were in front",
        "a projection that goes on smoothly behind the camera, and never looks like one in front",
        (
            "atom_core/tests/geometry/test_camera.py::test_a_point_behind_is_not_taken_for_one_in_front",
            "atom_core/tests/solvers/test_ceres_solver.py::test_points_behind_and_beside_the_camera_too",
        ),
    ),
    FailureMode(
        9,
        "Rectified images with the lens of the raw ones, and the other way round",
        "told whenever the dataset is read; every camera model has its own number of coefficients",
        (
            "atom_core/tests/io/test_dataset_json.py::"
            "test_a_lens_in_doubt_is_told_when_the_dataset_is_read",
            "atom_core/tests/geometry/test_camera.py::test_names_of_models",
        ),
    ),
    FailureMode(
        10,
        "`fisheye` and `equidistant` are one model with two names",
        "both are read",
        ("atom_core/tests/geometry/test_camera.py::test_names_of_models",),
    ),
    FailureMode(
        11,
        "Clouds hold NaN, or (0, 0, 0) where nothing came back",
        "such points are no points, and the others keep their index",
        (
            f"{_LABELING}/test_lidar3d.py::test_invalid_points_keep_their_place",
            f"{_CALIBRATION}/test_bad_numbers.py::test_a_residual_that_is_not_finite_is_named",
        ),
    ),
    FailureMode(
        12,
        "Clouds without `ring`",
        "layers are found from the directions of the points",
        (
            f"{_LABELING}/test_lidar3d.py::test_layers_are_found_without_ring_field_in_any_orientation",
            f"{_LABELING}/test_lidar3d.py::test_a_useless_ring_field_is_passed_over",
        ),
    ),
    FailureMode(
        13,
        "Too few layers meet the board",
        "said with the number, the size of what they see, and how near the board should be",
        (
            f"{_LABELING}/test_lidar3d.py::test_too_few_layers_are_named_with_the_size_of_what_they_see",
            f"{_NODES}/test_quality_log.py::"
            "test_the_second_failure_for_one_reason_brings_advice_with_the_distance",
        ),
    ),
    FailureMode(
        14,
        "A tripod, a person or a wall is labeled",
        "what is labeled has the board's size, is flat, and ends where the board does",
        (
            f"{_LABELING}/test_lidar3d.py::test_wall_behind_the_board_does_not_win",
            f"{_LABELING}/test_depth.py::test_a_post_that_touches_the_board_is_not_labeled",
            f"{_LABELING}/test_cloud_boards.py::test_a_pole_before_the_board_is_not_labeled",
        ),
    ),
    FailureMode(
        15,
        "A LiDAR reads long, dark squares stand apart, beams are mixed at the border",
        "a range offset is suggested, or estimated with `--model_errors auto`",
        (
            f"{_CALIBRATION}/test_range_offset.py::test_a_planted_offset_is_found",
            f"{_CALIBRATION}/test_model_checks.py::test_what_is_planted_is_named_alone_with_its_size",
        ),
    ),
    FailureMode(
        16,
        "Sensors are not synchronised, and the board moves",
        "a collection in which the board moved during the skew is refused, with sensor and time",
        (
            f"{_NODES}/test_selection.py::"
            "test_a_board_that_moved_during_the_skew_is_refused_with_sensor_and_time",
        ),
    ),
    FailureMode(
        17,
        "The limit of the skew is compared in another unit than it is written in",
        "milliseconds, and a value below 1 is read as seconds, with a warning",
        (
            "atom_core/tests/model/test_config.py::test_duration_is_in_milliseconds",
            f"{_NODES}/test_collect_from_bag.py::test_the_skew_is_compared_in_milliseconds",
        ),
    ),
    FailureMode(
        18,
        "tf is looked up at one stamp for all sensors, or too late",
        "each sensor's transforms are of its own stamp",
        (
            f"{_NODES}/test_tf_snapshot.py::"
            "test_two_sensors_on_arms_of_their_own_have_transforms_at_their_own_stamps",
        ),
    ),
    FailureMode(
        19,
        "Depths are in millimetres where metres are expected",
        "REP 118; another unit is refused with sensor, topic, time and factor",
        (
            f"{_NODES}/test_depth_units.py::"
            "test_another_unit_is_refused_with_sensor_topic_time_and_factor",
        ),
    ),
    FailureMode(
        20,
        "A sensor sees no board, or shares none with the others",
        "told before anything is solved, with the groups by name; exit code 2",
        (
            f"{_CALIBRATION}/test_calibrate.py::test_components_that_share_no_board_are_named",
            "atom_core/tests/test_cli.py::test_a_sensor_that_shares_no_board_is_told_so",
        ),
    ),
    FailureMode(
        21,
        "The motion leaves a direction open, and residuals are small all the same",
        "`rank_deficient`, exit code 1, and the direction by the names of its parameters",
        (
            f"{_CALIBRATION}/test_calibrate.py::test_planar_motion_is_found_undetermined_and_named",
            f"{_CALIBRATION}/test_observability.py::test_the_exit_code_tells",
        ),
    ),
    FailureMode(
        22,
        "A few wrong labels pull the whole answer",
        "a robust loss, and wrong detections left out by name",
        (
            f"{_CALIBRATION}/test_outliers.py::"
            "test_a_wrong_corner_is_the_largest_outlier_and_named_by_its_id",
            f"{_CALIBRATION}/test_initial_sensors.py::test_gross_errors_do_not_mislead_the_start",
        ),
    ),
    FailureMode(
        23,
        "The answer is good only where the boards were",
        "views are watched while collecting; `propagation` says how sure a place is that no board "
        "was at; evaluating on the data that were calibrated with is told",
        (
            f"{_LABELING}/test_guidance.py::"
            "test_boards_that_face_the_sensor_need_tilt_and_those_tilted_alike_another_one",
            "atom_core/tests/commands/test_evaluate.py::"
            "test_a_test_set_that_was_calibrated_with_is_told",
        ),
    ),
    FailureMode(
        24,
        "Each pair is good, the whole is not",
        "one problem with all sensors; sensors that contradict the rest are named",
        (f"{_CALIBRATION}/test_trust.py::test_what_does_harm_is_named",),
    ),
    FailureMode(
        25,
        "Tables have a wrong unit",
        "units stand in names and headers, and tables are held against ATOM's own figures",
        (
            "atom_core/tests/problem/test_parameters.py::test_every_number_has_its_name_and_unit",
            "atom_core/tests/evaluation/test_softbot.py::test_averages_are_those_that_atom_printed",
        ),
    ),
    FailureMode(
        26,
        "A result is written as a success although nothing converged",
        "a status, a verdict, exit code 1; no earlier result is replaced by it",
        (
            "atom_core/tests/test_cli.py::test_not_converged_is_exit_1_and_written",
            "atom_core/tests/commands/test_calibrate_results.py::"
            "test_what_did_not_converge_replaces_nothing_that_did",
        ),
    ),
    FailureMode(
        27,
        "The arm is wrong, and the camera gets the blame",
        "a joint that is off is named, or estimated; an arm's spread is estimated where the data "
        "demand it",
        (
            f"{_CALIBRATION}/test_joint_errors.py::"
            "test_a_joint_that_is_off_is_named_alone_with_its_size",
            f"{_CALIBRATION}/test_moving_edges.py::test_a_millimetre_is_found_too",
        ),
    ),
    FailureMode(
        28,
        "Too slow",
        "`make bench`; every step tells how far it is, and can be interrupted with a result",
        (
            "atom_core/tests/solvers/test_progress.py::test_progress_tells_of_every_iteration",
            "atom_core/tests/solvers/test_progress.py::test_ctrl_c_ends_the_command_with_results",
        ),
    ),
    FailureMode(
        29,
        "Libraries change under the tool",
        "the tests run with Noetic's Python, numpy, scipy and OpenCV, and with Debian's",
        (
            "tests/test_suite.py::test_ci_runs_the_same_as_a_person",
            "tests/test_suite.py::test_every_pip_requirement_has_its_exact_version",
        ),
    ),
    FailureMode(
        30,
        "A selection on the command line is evaluated as code",
        "selections are names, globs, or a small language of comparisons",
        (
            "atom_core/tests/commands/test_selections_typed.py::test_what_names_nothing_or_is_code_is_refused",
        ),
    ),
)
