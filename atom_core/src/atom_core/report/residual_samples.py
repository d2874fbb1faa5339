"""The residuals that a report draws: thinned out where there are many, with what each was seen at.

They are the ones that the solver ended with: corrected by estimated errors of the model and by the
insets of borders. So they are kept in a file beside the other results, not computed again.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from typing import Dict, List, Optional, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import UNITS, RangeBlock, ReprojectionBlock, ResidualBlock

MOST = 4000  # of a sensor and kind
_ARRAYS = ("collection", "residual", "sigma", "seen", "incidence_rad")


@dataclass(frozen=True)
class ResidualSample:
    """Residuals of one sensor and one kind at the solution.

    Attributes:
        sensor, kind: whose, and which.
        count: how many there are in all.
        collection: (n,) its key.
        residual: (n, dimension) in the kind's unit.
        sigma: (n,) standard deviation that the solver took, in the same unit.
        seen: (n, 2) detected pixels of a camera, or (n, 3) points in the sensor's frame [m].
        incidence_rad: (n,) between the line of sight and the board's normal.
    """

    sensor: str
    kind: str
    count: int
    collection: np.ndarray
    residual: np.ndarray
    sigma: np.ndarray
    seen: np.ndarray
    incidence_rad: np.ndarray

    @property
    def unit(self) -> str:
        """Of the residuals: px or m."""
        return UNITS[self.kind]


def residual_samples(calibration: Calibration, most: int = MOST) -> Tuple[ResidualSample, ...]:
    """Return the residuals of each sensor and kind at the solution.

    Args:
        calibration: the answer.
        most: how many of each; of more every so-many-th is taken.
    """
    problem, summary = calibration.problem, calibration.summary
    poses, residuals = problem.poses(summary.x), problem.residuals(summary.x)
    blocks = zip(problem.residual_blocks, residuals, summary.sigmas)
    return tuple(_sample(problem, poses, *parts, most) for parts in blocks)


def _sample(
    problem: Problem,
    poses: np.ndarray,
    block: ResidualBlock,
    residual: np.ndarray,
    sigma: np.ndarray,
    most: int,
) -> ResidualSample:
    chosen = np.unique(np.linspace(0, block.count - 1, min(most, block.count)).astype(int))
    detection = block.detection[chosen]
    if isinstance(block, ReprojectionBlock):
        seen, rays = block.pixels[chosen], block.corners_in_sensor(poses)[chosen]
    else:
        assert isinstance(block, RangeBlock), "every other block is of a range sensor"
        seen = rays = block.points[chosen]
    keys = np.array([key.collection for key in problem.detections])
    return ResidualSample(
        block.sensor,
        block.kind,
        block.count,
        keys[detection],
        residual[chosen].astype(np.float32),
        sigma[chosen].astype(np.float32),
        seen.astype(np.float32),
        incidence_rad(rays, poses[detection][:, :3, 2]).astype(np.float32),
    )


def incidence_rad(rays: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the angles (n,) between lines of sight (n, 3) and normals (n, 3), 0 to a right one."""
    lengths = np.linalg.norm(rays, axis=1) * np.linalg.norm(normals, axis=1)
    cosines = np.abs(np.einsum("ni,ni->n", rays, normals)) / np.maximum(lengths, 1e-12)
    return np.arccos(np.clip(cosines, 0.0, 1.0))


def to_bytes(samples: Tuple[ResidualSample, ...]) -> bytes:
    """Return the content of a file (numpy's npz) with the residuals."""
    arrays: Dict[str, np.ndarray] = {
        "sensor": np.array([s.sensor for s in samples], dtype=np.str_),
        "kind": np.array([s.kind for s in samples], dtype=np.str_),
        "count": np.array([s.count for s in samples], dtype=int),
    }
    for i, sample in enumerate(samples):
        arrays.update({f"{name}_{i}": getattr(sample, name) for name in _ARRAYS})
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def from_bytes(data: bytes) -> Tuple[ResidualSample, ...]:
    """Return what `to_bytes` has written.

    Raises:
        ValueError: it is nothing of that kind.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            names = zip(arrays["sensor"], arrays["kind"], arrays["count"])
            return tuple(
                ResidualSample(
                    *(str(sensor), str(kind), int(count)),
                    *(arrays[f"{name}_{i}"] for name in _ARRAYS),
                )
                for i, (sensor, kind, count) in enumerate(names)
            )
    except (KeyError, OSError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"it holds no residuals ({error})") from None


def of_sensor(samples: Tuple[ResidualSample, ...], sensor: str) -> List[ResidualSample]:
    """Return the residuals of a sensor, kind by kind."""
    return [sample for sample in samples if sample.sensor == sensor]


def of_kind(
    samples: Tuple[ResidualSample, ...], sensor: str, kind: str
) -> Optional[ResidualSample]:
    """Return the residuals of a sensor and kind, None where there are none."""
    return next((s for s in samples if (s.sensor, s.kind) == (sensor, kind)), None)
