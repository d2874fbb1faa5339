"""Calibrate a camera on a hand by one of OpenCV's five hand-eye methods."""

from atom_core.commands import hand_eye_baseline

EXAMPLE = hand_eye_baseline.example("cv_eye_in_hand")
add_arguments = hand_eye_baseline.adder("cv_eye_in_hand")
run = hand_eye_baseline.runner("cv_eye_in_hand")
