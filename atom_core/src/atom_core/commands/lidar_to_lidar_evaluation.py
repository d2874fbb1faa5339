"""Measure how well two LiDARs agree, by the nearest points on a board."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("lidar_to_lidar_evaluation")
add_arguments = pair_evaluation.adder("lidar_to_lidar_evaluation")
run = pair_evaluation.runner("lidar_to_lidar_evaluation")
