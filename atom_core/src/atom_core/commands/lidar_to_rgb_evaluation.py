"""Measure how well a LiDAR's points on the border of a board fit a camera's image."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("lidar_to_rgb_evaluation")
add_arguments = pair_evaluation.adder("lidar_to_rgb_evaluation")
run = pair_evaluation.runner("lidar_to_rgb_evaluation")
