"""Calibrate a camera before a hand with a board by Li's method."""

from atom_core.commands import hand_eye_baseline

EXAMPLE = hand_eye_baseline.example("li_eye_to_hand")
add_arguments = hand_eye_baseline.adder("li_eye_to_hand")
run = hand_eye_baseline.runner("li_eye_to_hand")
