"""Measure how well two cameras agree, by the corners that both see."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("rgb_to_rgb_evaluation")
add_arguments = pair_evaluation.adder("rgb_to_rgb_evaluation")
run = pair_evaluation.runner("rgb_to_rgb_evaluation")
