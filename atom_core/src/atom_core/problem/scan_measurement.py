"""The cut of a board in a scan: points on a line and up to two ends (docs/lidar2d.md).

A turn of the board about its cut moves no point of the cut. Measured points lie off it by their
noise, though, and a turn moves them by just as much as they lie off: a plane fitted to them prefers
any turn that lays the board along their noise. So the points are moved onto their line along their
beams; what they deviated by, which neither shifts nor turns the line, is added to their heights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Sequence, Tuple

import numpy as np

from atom_core.geometry.expected_noise import LIDAR_SIGMA_M
from atom_core.geometry.line import LineFit, fit_line
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, RangePoints
from atom_core.model.sensor import Sensor
from atom_core.problem.range_measurement import (
    RangeMeasurement,
    range_blocks,
    range_measurement,
    usable_points,
)
from atom_core.problem.residuals import OrthogonalBlock, ResidualBlock

_LINE_LIMIT_M = 0.05
_GRAZING = 0.05  # sine of the angle between beam and cut below which the cut is hit nowhere


@dataclass(frozen=True)
class ScanMeasurement(RangeMeasurement):
    """Points of a 2D LiDAR on one board: a line, which leaves the board's pose open.

    Attributes:
        on_line: (n, 3) where the beams of the points on the board meet their line [m].
        deviation_m: (n,) of the points from it, across it in the scan's plane [m].
    """

    on_line: np.ndarray
    deviation_m: np.ndarray

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
    on_line, deviation_m = points.inside, np.zeros(len(points.inside))
    try:
        line = fit_line(points.inside)
    except ValueError:
        count = len(points.inside)
        sigmas = np.full(count, LIDAR_SIGMA_M), np.full(len(points.limit), LIDAR_SIGMA_M)
        steps = np.zeros((len(points.limit), 2, 3))
    else:
        sigmas, steps = _sigmas_and_steps(points, line.direction, abs(scan.angle_increment))
        on_line, deviation_m = _moved_onto(line, points.inside)
    plain = range_measurement(dataset, key, points, *sigmas, steps).with_atom_residuals()
    return ScanMeasurement(**plain.__dict__, on_line=on_line, deviation_m=deviation_m), remarks


def scan_blocks(
    sensor: Sensor, items: Sequence[Tuple[int, ScanMeasurement]]
) -> List[ResidualBlock]:
    """Return the residuals of a 2D LiDAR, from its measurements and detections' indices."""
    heights, *ends = range_blocks(sensor, items)
    assert isinstance(heights, OrthogonalBlock)
    on_line = np.concatenate([m.on_line for _, m in items])
    deviation_m = np.concatenate([m.deviation_m for _, m in items])
    return [replace(heights, points=on_line, deviation_m=deviation_m), *ends]


def _moved_onto(line: LineFit, points: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return where the beams of points (n, 3) of a scan meet a line (n, 3) [m].

    And (n,) by how much the points lie beyond it, at right angles [m].
    """
    across = np.cross(line.direction, (0.0, 0.0, 1.0))
    away = float(across @ line.centroid)
    reached = points.astype(float) @ across
    if abs(away) < _GRAZING * np.linalg.norm(line.centroid):  # seen from its end
        return points, np.zeros(len(points))
    return points * (away / reached)[:, None], reached - away


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
