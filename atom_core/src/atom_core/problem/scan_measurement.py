"""The cut of a board in a scan: points on a line and up to two ends (docs/lidar2d.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Optional, Tuple

import numpy as np

from atom_core.geometry.line import fit_line
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, RangePoints
from atom_core.problem.range_measurement import (
    LIDAR_SIGMA_M,
    RangeMeasurement,
    range_measurement,
    usable_points,
)

_LINE_LIMIT_M = 0.05
_GRAZING = 0.05  # sine of the angle between beam and cut below which the cut is hit nowhere


@dataclass(frozen=True)
class ScanMeasurement(RangeMeasurement):
    """Points of a 2D LiDAR on one board: a line, which leaves the board's pose open."""

    def candidates(self) -> List[np.ndarray]:
        """Return none: a line in the board tells two of the six numbers of its pose."""
        return []

    def implausibilities(self) -> List[str]:
        """Return what is wrong with the points: no line, or longer than the board."""
        try:
            rms = fit_line(self.inside).rms_m
        except ValueError as error:
            return [str(error)]
        found = []
        if rms > _LINE_LIMIT_M:
            found.append(f"the labeled points are no line (RMS {rms:.3f} m)")
        return found + self.too_large()


def measured_in_scan(
    dataset: Dataset, key: DetectionKey
) -> Tuple[Optional[RangeMeasurement], List[str]]:
    """Return the measurement of a label in a scan, if any of its points has a value."""
    points, remarks = usable_points(dataset, key)
    if points is None:
        return None, remarks
    scan = dataset.data.read(key.collection, key.sensor)
    try:
        direction = fit_line(points.inside).direction
    except ValueError:
        count = len(points.inside)
        sigmas = np.full(count, LIDAR_SIGMA_M), np.full(len(points.limit), LIDAR_SIGMA_M)
        steps = np.zeros((len(points.limit), 2, 3))
    else:
        sigmas, steps = _sigmas_and_steps(points, direction, abs(scan.angle_increment))
    plain = range_measurement(dataset, key, points, *sigmas, steps)
    return ScanMeasurement(**plain.__dict__), remarks


def _sigmas_and_steps(
    points: RangePoints, direction: np.ndarray, step_rad: float
) -> Tuple[Tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Return what to expect of points and ends, and the way from each end to the next beam.

    Noise is along the beam: at a slant it moves a point less off the board, and an end more along
    it. The last return lies anywhere within a step of the edge.

    Args:
        points: of the cut.
        direction: (3,) along it, of unit length.
        step_rad: between two beams.

    Returns:
        Sigmas (n,) of the points and (m,) of the ends [m]; the way (m, 2, 3) along the cut to where
        the next beam would meet it [m], the second one zero.
    """
    inside_sigma = LIDAR_SIGMA_M * _sines(points.inside, direction)
    sine, distance = _sines(points.limit, direction), np.linalg.norm(points.limit, axis=1)
    length = distance * np.tan(step_rad) / sine
    along_cut = LIDAR_SIGMA_M * np.sqrt(1.0 - sine**2)
    outward = np.sign((points.limit - points.inside.mean(axis=0)) @ direction)
    steps = np.zeros((len(points.limit), 2, 3))
    steps[:, 0] = (length * outward)[:, None] * direction
    return (inside_sigma, np.hypot(length / np.sqrt(12.0), along_cut)), steps


def _sines(points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return (n,) sines of the angles between the beams to points and the cut, not below 0.05."""
    along = (points @ direction) / np.linalg.norm(points, axis=1)
    return np.sqrt(np.maximum(1.0 - along**2, _GRAZING**2))
