"""Standard deviations that labels are expected to have before anything is estimated.

Labels are compared in these units, and the solver begins with them (docs/conventions.md, Sigma).
"""

from __future__ import annotations

import numpy as np

CORNER_SIGMA_PX = 0.3  # along each axis of the image
LIDAR_SIGMA_M = 0.010  # of a range


def depth_sigma_m(z_m: np.ndarray) -> np.ndarray:
    """Return the standard deviation (n,) [m] of structured-light z-depths (n,) [m].

    Source: Nguyen, Izadi, Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction
    and tracking" (3DIMPVT 2012), axial noise.
    """
    return 0.0012 + 0.0019 * (z_m - 0.4) ** 2
