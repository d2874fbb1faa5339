"""Measure how well depth cameras agree between collections."""

from atom_core.commands import pair_evaluation

EXAMPLE = pair_evaluation.example("inter_collection_depth_to_depth_evaluation")
add_arguments = pair_evaluation.adder("inter_collection_depth_to_depth_evaluation")
run = pair_evaluation.runner("inter_collection_depth_to_depth_evaluation")
