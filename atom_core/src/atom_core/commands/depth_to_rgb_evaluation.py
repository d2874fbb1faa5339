"""Measure how well a depth camera's border of a board fits a camera's image."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("depth_to_rgb_evaluation")
add_arguments = pair_evaluation.adder("depth_to_rgb_evaluation")
run = pair_evaluation.runner("depth_to_rgb_evaluation")
