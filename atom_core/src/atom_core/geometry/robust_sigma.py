"""Standard deviations by medians, so that gross errors do not count."""

from __future__ import annotations

import numpy as np

PER_MEDIAN = 1.4826  # standard deviation over the median of the sizes, of a normal distribution
OF_A_MEDIAN = 1.25  # how much less exact a median is than a mean, likewise


def robust_sigma(off: np.ndarray) -> float:
    """Return the standard deviation of the normal distribution about zero that fits (n,) values."""
    return PER_MEDIAN * float(np.median(np.abs(off)))
