"""The programs of ATOM by package, as its users type them after ``rosrun``: October 2024."""

from __future__ import annotations

from typing import Dict, Iterator, Tuple

_PAIRS = (
    *("rgb_to_rgb", "lidar_to_lidar", "lidar_to_rgb"),
    *("lidar_to_depth", "depth_to_depth", "depth_to_rgb"),
)
# Calibrations by other methods: ATOM's pages write these with the ending of their files, too.
WITH_ENDING = (
    *("cv_stereo_calib", "icp_calibration", "kalibr_stereo_calib", "copy_tfs_from_dataset"),
    *("cv_eye_in_hand", "cv_eye_to_hand", "cv_eye_to_hand_robot_world", "tf_static_to_dataset"),
    *("li_eye_in_hand", "li_eye_to_hand", "shah_eye_in_hand"),
)
PROGRAMS: Dict[str, Tuple[str, ...]] = {
    "atom_calibration": (
        *("create_calibration_pkg", "configure_calibration_pkg", "view_calibration_config"),
        *("set_initial_estimate", "collect_data", "automatic_data_collector"),
        *("rgb_labeler", "lidar3d_labeler", "depth_labeler"),
        *("dataset_playback", "transform_corrector", "odometry_inspector"),
        *("calibrate", "estimate_pattern_poses", "add_ground_truth_to_dataset"),
        *("add_noise_to_joint_state_in_bag", "list_joints_in_bag", "atom_dataset_to_rosbag"),
        *("filter_dataset_based_on_joint_states", "generate_joint_space_tsne"),
        *("inspect_atom_dataset", "merge_atom_datasets", "split_atom_dataset"),
        *("remove_collections_from_atom_dataset", "rename_atom_dataset"),
        *("update_config_to_version_3", "update_configure_script"),
        *("update_dataset_from_version_2_to_3", "download_atom_examples_data"),
        *("convert_from_rwhe_dataset", "convert_from_rwhe_synthetic_dataset"),
        *("convert_from_tabb_dataset", "convert_to_rwhe_dataset", "convert_to_tabb_dataset"),
    ),
    "atom_evaluation": (
        *(f"{pair}_evaluation" for pair in _PAIRS),
        *(f"inter_collection_{pair}_evaluation" for pair in _PAIRS),
        *("single_rgb_evaluation", "ground_truth_frame_evaluation"),
        *("ground_truth_transform_evaluation", "annotate_pattern_borders_in_rgb_or_depth"),
        *("annotate_pattern_borders_in_lidar", "rviz_viewpoint_motion"),
        *("pandey2010", "dahll2017", *WITH_ENDING),
        *(f"{name}.py" for name in WITH_ENDING),
    ),
    "atom_batch_execution": ("batch_execution", "process_results"),
    "atom_examples": ("download_atom_examples_data", "reconfigure_all"),
}


def programs() -> Iterator[Tuple[str, str]]:
    """Return package and program of everything that ``rosrun`` has to find."""
    for package, names in PROGRAMS.items():
        for name in names:
            yield package, name
