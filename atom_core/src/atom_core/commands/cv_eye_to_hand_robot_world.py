"""Calibrate a camera before a hand with a board by OpenCV's robot-world methods."""

from atom_core.commands import hand_eye_baseline

EXAMPLE = hand_eye_baseline.example("cv_eye_to_hand_robot_world")
add_arguments = hand_eye_baseline.adder("cv_eye_to_hand_robot_world")
run = hand_eye_baseline.runner("cv_eye_to_hand_robot_world")
