"""Measure how well LiDARs agree between collections, over a board that stays."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("inter_collection_lidar_to_lidar_evaluation")
add_arguments = pair_evaluation.adder("inter_collection_lidar_to_lidar_evaluation")
run = pair_evaluation.runner("inter_collection_lidar_to_lidar_evaluation")
