"""Calibration of many sensors of many kinds, sensor to pattern, without ROS.

Method: Rato et al., J. Manufacturing Systems 64 (2022) 497-507, and Oliveira et al.,
Expert Systems with Applications (2022). Frames, units and orders: docs/conventions.md.
"""

import os

# Matrices here are small: OpenBLAS's threads cost many times what they save, and the cores that
# others need. Takes effect where numpy is not loaded yet; who sets the variable decides.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__version__ = "1.0.0"
