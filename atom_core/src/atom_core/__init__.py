"""Calibration of many sensors of many kinds, sensor to pattern, without ROS.

Method: Rato et al., J. Manufacturing Systems 64 (2022) 497-507, and Oliveira et al.,
Expert Systems with Applications (2022). Frames, units and orders: docs/conventions.md.
"""

__version__ = "0.1.0"
