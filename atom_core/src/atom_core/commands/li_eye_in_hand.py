"""Calibrate a camera on a hand by Li's method."""

from atom_core.commands import hand_eye_baseline

EXAMPLE = hand_eye_baseline.example("li_eye_in_hand")
add_arguments = hand_eye_baseline.adder("li_eye_in_hand")
run = hand_eye_baseline.runner("li_eye_in_hand")
