"""The ROS side of the calibration: messages, bags and nodes around ``atom_core``.

One folder for each step on the way of the data; imports go down only (``.importlinter``).
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in atom_core, whichever comes first
