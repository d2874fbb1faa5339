"""What a user may ask of a calibration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import List, Mapping, Optional, Tuple

import numpy as np

from atom_core.model.dataset import Dataset
from atom_core.model.joints import JointSelection
from atom_core.problem.board_errors import (
    Bend,
    BoardSize,
    BoardThickness,
    BorderShift,
    BorderSize,
)
from atom_core.problem.model_errors import (
    AXES,
    DepthOffset,
    DepthScale,
    ErrorPriors,
    ModelError,
    RangeOffset,
    RangeScale,
)
from atom_core.solvers.base import SolverOptions

DESCRIPTION, NO_GUESS = "description", "none"
SUGGEST, AUTO, OFF = "suggest", "auto", "off"


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of one calibration; names as in the command line.

    Attributes:
        solver: weights, loss, limits.
        solver_name: ceres, scipy, or None for ceres where it is built and scipy elsewhere.
        anchor_sensors: held still beside the configuration's anchored sensor.
        ignore_anchored_sensor: do not hold the configuration's anchored sensor.
        anchor_patterns: hold the boards where the dataset has them.
        only_anchored_sensor: one sensor is used, and held: the boards alone are placed.
        additional_tfs: names of the configuration's additional tfs to estimate; None for all.
        joints: parameters to estimate, by joint; None for those of the configuration.
        intrinsics: cameras whose intrinsics are estimated.
        intrinsics_sigma: how far their focal lengths and centre are expected from those given, in
            parts of the focal length; None: anywhere. In combined sigmas it counts for all cameras
            (None: 0.005).
        complete_only: use only collections in which every sensor sees every pattern.
        unused_collections: further collections not to use, and why, by key.
        initial_guess: ``description`` starts from the transforms of the dataset (and leaves them
            where that cannot be right), ``none`` places the sensors from the data alone.
        boards_of_dataset: boards begin where the dataset has them, as an earlier calibration left
            them, if that fits what is seen of them; else, and by default, they are placed anew.
        noisy_initial_guess: metres and radians by which each free edge is moved at the start.
        seed: of that disturbance.
        range_offset: LiDARs whose range offset is estimated.
        range_scale: LiDARs whose range scale is estimated.
        depth_offset: depth cameras whose offset is estimated.
        depth_scale: depth cameras whose scale is estimated.
        board_size: patterns whose size is estimated.
        board_border: patterns of which shift and size of the border are estimated.
        board_bend: patterns whose bend along x and along y is estimated.
        board_thickness: patterns of which is estimated how far their back lies behind the print.
        moving_edge_sigma: frames of moving parts (an arm's flange) whose poses in a collection are
            off: metres and radians along and about each axis, None where that is estimated.
        priors: metres and radians, standard deviations about the dataset's value, by the name of a
            sensor, an additional tf or a joint, or by an edge; beside those of the configuration.
        joint_biases: what was added to the dataset's joints beforehand, by joint and parameter
            [m or rad]; priors are about the values without it.
        model_errors: whether errors of the model are looked for (``suggest``), estimated until
            none is left (``auto``), or left alone (``off``).
        known_errors: errors of sensors and boards that are known beforehand, and estimated about
            that.
        keep_collections: keys of collections that are used even if they contradict the others.
        keep_detections: (collection, sensor) of detections that are.
        undetermined_limit: metres and radians; a larger predicted sigma is undetermined.
    """

    solver: SolverOptions = field(default_factory=SolverOptions)
    solver_name: Optional[str] = None
    anchor_sensors: Tuple[str, ...] = ()
    ignore_anchored_sensor: bool = False
    anchor_patterns: bool = False
    only_anchored_sensor: bool = False
    additional_tfs: Optional[Tuple[str, ...]] = None
    joints: Optional[JointSelection] = None
    intrinsics: Tuple[str, ...] = ()
    intrinsics_sigma: Optional[float] = 0.005
    complete_only: bool = False
    unused_collections: Mapping[str, str] = field(default_factory=dict)
    initial_guess: str = DESCRIPTION
    boards_of_dataset: bool = False
    noisy_initial_guess: Tuple[float, float] = (0.0, 0.0)
    seed: int = 0
    range_offset: Tuple[str, ...] = ()
    range_scale: Tuple[str, ...] = ()
    depth_offset: Tuple[str, ...] = ()
    depth_scale: Tuple[str, ...] = ()
    board_size: Tuple[str, ...] = ()
    board_border: Tuple[str, ...] = ()
    board_bend: Tuple[str, ...] = ()
    board_thickness: Tuple[str, ...] = ()
    moving_edge_sigma: Mapping[str, Optional[Tuple[float, float]]] = field(default_factory=dict)
    priors: Mapping[str, Tuple[float, float]] = field(default_factory=dict)
    joint_biases: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    model_errors: str = SUGGEST
    known_errors: ErrorPriors = field(default_factory=dict)
    keep_collections: Tuple[str, ...] = ()
    keep_detections: Tuple[Tuple[str, str], ...] = ()
    undetermined_limit: Tuple[float, float] = (0.05, 0.05)

    def solver_options(self, dataset: Dataset) -> SolverOptions:
        """Return the solver's, with the model errors of a dataset that are to be estimated."""
        errors = self.estimated_errors(dataset)
        return replace(self.solver, model_errors=errors, error_priors=self.known_errors)

    def estimated_errors(self, dataset: Dataset) -> Tuple[ModelError, ...]:
        """Return the model errors that the user wants to have estimated, and those known."""
        errors: List[ModelError] = [RangeOffset(name) for name in self.range_offset]
        errors += [RangeScale(name) for name in self.range_scale]
        errors += [DepthOffset(name) for name in self.depth_offset]
        errors += [DepthScale(name) for name in self.depth_scale]
        errors += [BoardSize(name) for name in self.board_size]
        for kind in (BorderShift, BorderSize):
            errors += [kind(name, axis) for name in self.board_border for axis in range(len(AXES))]
        for name in self.board_bend:
            errors += Bend.of_board(name, dataset.patterns[name].border)
        errors += [BoardThickness(name) for name in self.board_thickness]
        return tuple(dict.fromkeys([*errors, *self.known_errors]))

    def __post_init__(self) -> None:
        if self.initial_guess not in (DESCRIPTION, NO_GUESS):
            raise ValueError(f"initial_guess must be {DESCRIPTION} or {NO_GUESS}")
        if self.model_errors not in (SUGGEST, AUTO, OFF):
            raise ValueError(f"model_errors must be {SUGGEST}, {AUTO} or {OFF}")
        if not all(0 <= size < np.inf for size in self.noisy_initial_guess):
            raise ValueError("noisy_initial_guess needs two numbers >= 0: metres and radians")
        if self.intrinsics_sigma is not None and not 0 < self.intrinsics_sigma < np.inf:
            raise ValueError("intrinsics_sigma needs a number > 0, or none for no expectation")
        for frame, sigmas in self.moving_edge_sigma.items():
            if sigmas is not None and not all(0 < sigma < np.inf for sigma in sigmas):
                raise ValueError(f"moving_edge_sigma of {frame} needs two numbers > 0, or none")
        for name, sigmas in self.priors.items():
            if not all(0 < sigma < np.inf for sigma in sigmas):
                raise ValueError(f"the prior of {name} needs two numbers > 0: metres and radians")
        if not all(limit > 0 for limit in self.undetermined_limit):
            raise ValueError("undetermined_limit needs two numbers > 0: metres and radians")
        if self.seed < 0:
            raise ValueError("the seed (sample_seed) needs a whole number >= 0")
