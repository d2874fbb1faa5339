"""Which model errors are looked for: those that real sensors and boards usually have."""

from __future__ import annotations

from typing import Dict, Iterable, List, Optional, Set

import numpy as np

from atom_core.calibration.refine.joint_candidates import joint_candidates
from atom_core.calibration.refine.moving_trends import moving_trends
from atom_core.calibration.refine.told_joints import told_joints
from atom_core.calibration.start.boards import solved_dataset
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import intrinsics_names
from atom_core.model.dataset import Dataset
from atom_core.problem.board_errors import (
    Bend,
    BoardAspect,
    BoardSize,
    BoardThickness,
    BoardTwist,
    BorderShift,
    PrintTurn,
    SeenBorder,
)
from atom_core.problem.direction_errors import (
    AzimuthScale,
    AzimuthWave,
    DepthCentre,
    DepthFocalLength,
    ElevationOffset,
    ElevationScale,
)
from atom_core.problem.model_errors import (
    AXES,
    CameraError,
    DepthOffset,
    DepthScale,
    ModelError,
    RangeOffset,
    RangeScale,
)
from atom_core.problem.problem import Problem
from atom_core.problem.range_fields import (
    LayerField,
    RangeField,
    WaveField,
    depth_waves,
    layer_offsets,
)
from atom_core.problem.residuals import BorderBlock, OrthogonalBlock

_NUMBERS = {
    "focal_length": (0, 1),
    "aspect": (1,),
    "centre_x": (2,),
    "centre_y": (3,),
    "k1": (4,),
}
_DISTORTION = 4  # the first of a camera's numbers that is of its distortion


def candidates(
    dataset: Dataset, problem: Problem, x: np.ndarray, of_all_motions: bool = False
) -> List[ModelError]:
    """Return the errors that a problem's sensors and boards may have.

    Args:
        dataset: with the sensors' intrinsics as given.
        problem: whose rows are to depend on them; cameras whose intrinsics are estimated have none.
        x: its solution.
        of_all_motions: also what moving parts do that are taken to be where the dataset has them.
    """
    found: List[ModelError] = []
    for name in dict.fromkeys(block.sensor for block in problem.residual_blocks):
        sensor = dataset.sensors[name]
        if sensor.kind.can_estimate_range_offset:
            found += _of_lidar(name)
        elif sensor.kind.measures_range:
            found += _of_depth_camera(name, sensor.camera)
        camera = sensor.camera if sensor.kind.can_estimate_intrinsics else None
        if camera is not None and name not in problem.parameters.cameras:
            found += [
                CameraError(name, label, numbers, camera)
                for label, numbers in _NUMBERS.items()
                if max(numbers) < len(intrinsics_names(camera))
            ]
    with_border, from_behind = _patterns_with_border(problem), _patterns_from_behind(problem, x)
    for name in dict.fromkeys(key.pattern for key in problem.detections):
        border = dataset.patterns[name].border
        found += [BoardSize(name), BoardAspect(name)]
        if name in with_border:  # else nothing is there beside which it is turned
            found.append(PrintTurn.of_board(name, border))
        if name in from_behind:
            found.append(BoardThickness(name))
        found.append(BoardTwist.of_board(name, border))
        bends = Bend.of_board(name, border)
        for axis, bend in enumerate(bends):
            found += [BorderShift(name, axis), bend]
    solved = solved_dataset(dataset, problem, x, {})
    told = told_joints(solved, problem)
    found += joint_candidates(solved, problem, told)
    return [*found, *moving_trends(solved, problem, told, of_all_motions)]


def _patterns_with_border(problem: Problem) -> Set[str]:
    """Return the patterns of which some sensor sees the border."""
    borders = [b.detection for b in problem.residual_blocks if isinstance(b, BorderBlock)]
    return {str(pattern) for seen in borders for pattern in np.unique(problem.patterns[seen])}


def _patterns_from_behind(problem: Problem, x: np.ndarray) -> Set[str]:
    """Return the patterns whose back some range sensor sees."""
    poses = problem.poses(x)
    behind = np.einsum("di,di->d", poses[:, :3, 2], poses[:, :3, 3]) < 0.0
    seen = [b.detection for b in problem.residual_blocks if isinstance(b, OrthogonalBlock)]
    return {str(pattern) for d in seen for pattern in np.unique(problem.patterns[d][behind[d]])}


def _of_lidar(name: str) -> List[ModelError]:
    """Return the errors of a LiDAR; a scan in one plane has no elevations, and no row of theirs."""
    waves = [AzimuthWave(name, axis) for axis in range(len(AXES))]
    elevations = [ElevationOffset(name), ElevationScale(name)]
    return [RangeOffset(name), RangeScale(name), AzimuthScale(name), *waves, *elevations]


def _of_depth_camera(name: str, camera: Optional[Camera]) -> List[ModelError]:
    found: List[ModelError] = [DepthOffset(name), DepthScale(name)]
    if camera is not None:
        found.append(DepthFocalLength(name, camera))
        found += [DepthCentre(name, camera, axis) for axis in range(len(AXES))]
    return found


def range_fields(dataset: Dataset, problem: Problem) -> List[RangeField]:
    """Return the errors of range sensors that differ from ray to ray, by sensor."""
    found: List[RangeField] = []
    for name in dict.fromkeys(block.sensor for block in problem.residual_blocks):
        sensor = dataset.sensors[name]
        if sensor.kind.can_estimate_range_offset:
            layers = layer_offsets(problem, name)
            if layers:
                found.append(LayerField(layers))
        elif sensor.kind.measures_range and sensor.camera is not None:
            found.append(WaveField(depth_waves(name, sensor.camera)))
    return found


def usual_sizes(
    errors: Iterable[ModelError], intrinsics_sigma: Optional[float]
) -> Dict[ModelError, float]:
    """Return the standard deviations about zero that errors usually have, in their units.

    Args:
        errors: whose.
        intrinsics_sigma: that of focal lengths and centres, in parts of the focal length; None:
            the usual.
    """
    sizes = {error: error.usual for error in errors}
    if intrinsics_sigma is not None:
        given = (e for e in sizes if isinstance(e, CameraError) and max(e.numbers) < _DISTORTION)
        sizes.update(dict.fromkeys(given, intrinsics_sigma))
    return sizes


def nuisances(problem: Problem) -> List[ModelError]:
    """Return what every sensor's labels may do to the border, to be free in all tests.

    A labeled border is the sampling's and the labeler's as much as the board's: its size says
    nothing of the scale of ranges.
    """
    borders = [b.sensor for b in problem.residual_blocks if isinstance(b, BorderBlock)]
    return [SeenBorder(name, axis) for name in borders for axis in range(len(AXES))]
