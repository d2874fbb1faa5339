"""The ROS side of the calibration: messages, bags and nodes around ``atom_core``.

``conversions`` is the only module that knows both messages and the core's types.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in atom_core, whichever comes first
