"""Scans of 2D LiDARs."""

from __future__ import annotations

from typing import Any

import numpy as np

LASER_SCAN = "sensor_msgs/LaserScan"


def laser_scan(message: Any) -> np.ndarray:
    """Return a LaserScan as points (n, 3) [m] in the plane z = 0; invalid ranges are NaN."""
    ranges = np.asarray(message.ranges, dtype=float)
    with np.errstate(invalid="ignore"):
        valid = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    ranges = np.where(valid, ranges, np.nan)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    return np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), 0.0 * ranges])
