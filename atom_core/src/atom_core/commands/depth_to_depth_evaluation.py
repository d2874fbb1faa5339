"""Measure how well two depth cameras agree about the border of a board."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("depth_to_depth_evaluation")
add_arguments = pair_evaluation.adder("depth_to_depth_evaluation")
run = pair_evaluation.runner("depth_to_depth_evaluation")
