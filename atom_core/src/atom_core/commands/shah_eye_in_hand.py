"""Calibrate a camera on a hand by Shah's method."""

from atom_core.commands import hand_eye_baseline

EXAMPLE = hand_eye_baseline.example("shah_eye_in_hand")
add_arguments = hand_eye_baseline.adder("shah_eye_in_hand")
run = hand_eye_baseline.runner("shah_eye_in_hand")
