"""The figures of a calibration, computed once: the document and the tables are made from them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.outliers import Outliers, find_outliers
from atom_core.calibration.judge.propagation import (
    PropagatedPoint,
    SensorPair,
    propagate,
    sensor_pairs,
)
from atom_core.calibration.judge.statistics import (
    ResidualStatistics,
    Table,
    kinds_of,
    residual_table,
)
from atom_core.calibration.prepare.preparation import camera_of
from atom_core.calibration.refine.error_words import described
from atom_core.evaluation.edge_errors import EdgeError, JointError, edge_errors, joint_errors
from atom_core.evaluation.ground_truth import GroundTruth, ground_truth_errors
from atom_core.evaluation.known_errors import parameters_of
from atom_core.evaluation.trust.checks import Trust
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics import intrinsics_names, intrinsics_values
from atom_core.model.truth import Truth
from atom_core.problem.model_errors import ErrorPriors, ModelError, RangeOffset
from atom_core.problem.residuals import UNITS
from atom_core.report.edge_results import (
    EdgeResult,
    ParameterResult,
    block_variances,
    edge_result,
    joint_results,
    selected_edges,
)
from atom_core.report.verdict import names_in_words
from atom_core.solvers.covariance import LARGEST_SIGMA
from atom_core.solvers.stops import stops_of

_LARGEST_IN_UNIT = 1e12  # as `LARGEST_SIGMA`, of model errors and intrinsics, in their units

Residuals = Mapping[str, ResidualStatistics]  # by kind


@dataclass(frozen=True)
class RangeOffsetResult:
    """What is added to all distances of a sensor [m]."""

    offset_m: float
    sigma_m: float


@dataclass(frozen=True)
class ModelErrorResult:
    """An error of the model: estimated, or seen in the data and left.

    Attributes:
        name, target: what it is, and of which sensor or board.
        value, sigma, unit: what must be added, in m, or by which part to grow.
        estimated: the calibration includes it.
        prior_sigma: standard deviation about zero that was assumed, in its unit; None: free.
        option: what estimates it; empty: nothing does.
        sentence: what it means.
        rivals: what the data cannot tell it from.
        family: what it is one of many of, such as "layer offset"; None: it stands alone.
        type, parameters: with the target, all that tells it from other errors.
    """

    name: str
    target: str
    value: float
    sigma: float
    unit: str
    estimated: bool
    prior_sigma: Optional[float]
    option: str
    sentence: str
    rivals: Tuple[str, ...]
    family: Optional[str]
    type: str
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class SensorResult:
    """A sensor at the solution.

    Attributes:
        name, modality: of the sensor.
        detections: how many were used.
        boards: in how many places boards were in these.
        outliers: how many of its corners and points are.
        residuals: statistics over all collections.
        border_inset_steps: how far inside the border its limit points are, in steps of sampling.
        range_offset: None where it was not estimated.
        intrinsics: those estimated.
        cameras: its intrinsics before and after; None where they are the same.
        sigma: median standard deviation of a measurement by kind and unit, as ``border_m``.
    """

    name: str
    modality: str
    detections: int
    boards: int
    outliers: int
    residuals: Residuals
    border_inset_steps: float
    range_offset: Optional[RangeOffsetResult]
    intrinsics: Tuple[ParameterResult, ...]
    cameras: Optional[Tuple[Camera, Camera]]
    sigma: Mapping[str, float]


@dataclass(frozen=True)
class CollectionResult:
    """A collection at the solution.

    Attributes:
        unused: why it was not used; None where it was.
        residuals: by sensor, statistics in this collection.
    """

    unused: Optional[str]
    residuals: Mapping[str, Residuals]


@dataclass(frozen=True)
class PropagationResult:
    """How exactly points are carried from one sensor to another."""

    source: str
    target: str
    points: Tuple[PropagatedPoint, ...]


@dataclass(frozen=True)
class CalibrationResults:
    """All that is written or shown of a calibration.

    Attributes:
        calibration: the answer itself.
        solver_name: which minimiser did the work.
        edges: selected ones.
        joints: estimated parameters by joint.
        sensors, collections: by name and by key.
        model_errors: those estimated, then those that the data show and that were left.
        propagation: for every ordered pair of sensors.
        outliers: single corners and points.
        ground_truth: errors of the sensors; None without a truth.
        warnings: what the user should know.
        seconds: time by step.
        edge_errors: of edges and boards whose truth is known; None without a truth.
        joint_errors: likewise of joints' parameters.
        trust: what it says where it is asked without a truth; None where it was not.
    """

    calibration: Calibration
    solver_name: str
    edges: Tuple[EdgeResult, ...]
    joints: Mapping[str, Tuple[ParameterResult, ...]]
    sensors: Mapping[str, SensorResult]
    collections: Mapping[str, CollectionResult]
    model_errors: Tuple[ModelErrorResult, ...]
    propagation: Tuple[PropagationResult, ...]
    outliers: Outliers
    ground_truth: Optional[GroundTruth]
    warnings: Tuple[str, ...]
    seconds: Mapping[str, float]
    edge_errors: Optional[Tuple[EdgeError, ...]] = None
    joint_errors: Tuple[JointError, ...] = ()
    trust: Optional[Trust] = None

    @property
    def has_combined_sigmas(self) -> bool:
        """Whether usual errors of sensors and boards are known: with variances as weights alone."""
        return self.calibration.covariance.has_combined


def calibration_results(
    calibration: Calibration,
    solver_name: str,
    truth: Optional[Truth] = None,
    trust: Optional[Trust] = None,
) -> CalibrationResults:
    """Return the figures of a calibration.

    Args:
        calibration: the answer.
        solver_name: which minimiser did the work.
        truth: of a simulation, to compare with.
        trust: what it says where it is asked without a truth.

    Raises:
        DatasetError: the truth lacks the edge of a sensor.
    """
    problem, summary = calibration.problem, calibration.summary
    table = residual_table(problem, summary.x)
    outliers = find_outliers(problem, summary.x, summary.sigmas)
    return CalibrationResults(
        calibration=calibration,
        solver_name=solver_name,
        edges=tuple(edge_result(calibration, edge) for edge in selected_edges(calibration)),
        joints=joint_results(calibration),
        sensors=_sensors(calibration, table, outliers),
        collections=_collections(calibration, table),
        model_errors=_model_errors(calibration),
        propagation=_propagation(calibration),
        outliers=outliers,
        ground_truth=None if truth is None else _ground_truth(calibration, truth),
        warnings=(*calibration.warnings, *_untold_joints(calibration, truth)),
        seconds=calibration.seconds,
        trust=trust,
        **_against(calibration, truth),
    )


def _against(calibration: Calibration, truth: Optional[Truth]) -> Dict[str, Any]:
    """Return the errors of edges and joints, as arguments of `CalibrationResults`."""
    if truth is None:
        return {}
    datasets = calibration.initial, calibration.dataset
    return {
        "edge_errors": tuple(edge_errors(*datasets, truth)),
        "joint_errors": tuple(joint_errors(*datasets, truth)),
    }


def _untold_joints(calibration: Calibration, truth: Optional[Truth]) -> List[str]:
    """Return a remark where the truth says nothing of joints that are estimated."""
    if truth is None:
        return []
    untold = [name for name in joint_results(calibration) if name not in truth.joints]
    if not untold:
        return []
    return [
        f"the truth does not tell {names_in_words(untold)}, estimated here: their errors are not "
        f"shown, and are not 0; add them to its `joints`"
    ]


def _ground_truth(calibration: Calibration, truth: Truth) -> GroundTruth:
    dataset = calibration.dataset
    held_edges = calibration.free.held_edges(dataset)
    held = [name for name, sensor in dataset.sensors.items() if sensor.edge in held_edges]
    return ground_truth_errors(dataset, truth, held)


def pairs_of(calibration: Calibration) -> List[SensorPair]:
    """Return every ordered pair of sensors with the covariance of its pose."""
    x, parameters = calibration.summary.x, calibration.problem.parameters
    return sensor_pairs(calibration.dataset, parameters, x, calibration.covariance)


def _intrinsics(calibration: Calibration, sensor: str) -> Tuple[ParameterResult, ...]:
    found: List[ParameterResult] = []
    for i, block in calibration.problem.parameters.camera_blocks():
        if block.sensor != sensor:
            continue
        now, before = (camera_of(d, sensor) for d in (calibration.dataset, calibration.initial))
        values = dict(zip(intrinsics_names(now), zip(*map(intrinsics_values, (now, before)))))
        sigma, combined = (block.sigmas(v, now) for v in block_variances(calibration, i))
        for place, name in block.free_components:
            value, initial = values[name]
            sigmas = min(sigma[name], _LARGEST_IN_UNIT), min(combined[name], _LARGEST_IN_UNIT)
            change = float(value - initial)
            found.append(ParameterResult(name, float(value), change, *sigmas, block.units[place]))
    return tuple(found)


def _cameras(calibration: Calibration, sensor: str) -> Optional[Tuple[Camera, Camera]]:
    before, after = (d.sensors[sensor].camera for d in (calibration.initial, calibration.dataset))
    if before is None or after is None or before is after:
        return None
    return before, after


def _range_offset(calibration: Calibration, sensor: str) -> Optional[RangeOffsetResult]:
    error, values = RangeOffset(sensor), calibration.summary.model_errors
    if error not in values:
        return None
    sigma = calibration.covariance.error_sigmas.get(error, 0.0)
    return RangeOffsetResult(values[error], min(sigma, LARGEST_SIGMA))


def _model_errors(calibration: Calibration) -> Tuple[ModelErrorResult, ...]:
    sigmas, priors = calibration.covariance.error_sigmas, calibration.error_priors
    found = [
        _model_error(error, value, sigmas.get(error, 0.0), True, _prior_sigma(priors, error))
        for error, value in calibration.summary.model_errors.items()
    ]
    for check in calibration.checks:
        result = _model_error(check.error, check.value, check.sigma, False, None)
        found.append(replace(result, rivals=tuple(rival.title for rival in check.rivals)))
    return tuple(found)


def _prior_sigma(priors: ErrorPriors, error: ModelError) -> Optional[float]:
    return priors[error].sigma if error in priors else None


def _model_error(
    error: ModelError, value: float, sigma: float, estimated: bool, prior_sigma: Optional[float]
) -> ModelErrorResult:
    sigma = min(sigma, _LARGEST_IN_UNIT)
    return ModelErrorResult(
        name=error.name,
        target=error.target,
        value=value,
        sigma=sigma,
        unit=error.unit,
        estimated=estimated,
        prior_sigma=prior_sigma,
        option=error.option,
        sentence=described(error, value, sigma),
        rivals=(),
        family=None if error.stands_alone else error.kind.replace("_", " "),
        type=type(error).__name__,
        parameters=parameters_of(error),
    )


def _sensors(calibration: Calibration, table: Table, outliers: Outliers) -> Dict[str, SensorResult]:
    problem = calibration.problem
    stops = stops_of(problem, calibration.summary.x)
    seen = {(key.sensor, key.pattern, stops[key.collection]) for key in problem.detections}
    boards = Counter(sensor for sensor, _, _ in seen)
    names = calibration.dataset.sensors
    return {name: _sensor(calibration, name, boards[name], table, outliers) for name in names}


def _sensor(
    calibration: Calibration, name: str, boards: int, table: Table, outliers: Outliers
) -> SensorResult:
    problem, summary = calibration.problem, calibration.summary
    mine = [i for i, block in enumerate(problem.residual_blocks) if block.sensor == name]
    return SensorResult(
        name=name,
        modality=calibration.dataset.sensors[name].modality,
        detections=sum(key.sensor == name for key in problem.detections),
        boards=boards,
        outliers=outliers.counts.get(name, 0),
        residuals={kind: table[(name, kind, None)] for kind in kinds_of(table, name)},
        border_inset_steps=sum(summary.inset_steps[i] for i in mine),
        range_offset=_range_offset(calibration, name),
        intrinsics=_intrinsics(calibration, name),
        cameras=_cameras(calibration, name),
        sigma={
            f"{kind}_{UNITS[kind]}": float(np.median(summary.sigmas[i]))
            for i, kind in ((i, problem.residual_blocks[i].kind) for i in mine)
        },
    )


def _collections(calibration: Calibration, table: Table) -> Dict[str, CollectionResult]:
    residuals: Dict[Optional[str], Dict[str, Dict[str, ResidualStatistics]]] = {}
    for (sensor, kind, collection), value in table.items():
        residuals.setdefault(collection, {}).setdefault(sensor, {})[kind] = value
    return {
        key: CollectionResult(calibration.unused.get(key), residuals.get(key, {}))
        for key in calibration.dataset.collections
    }


def _propagation(calibration: Calibration) -> Tuple[PropagationResult, ...]:
    pairs: Sequence[SensorPair] = pairs_of(calibration)
    carried = propagate(pairs, calibration.dataset.sensors)
    return tuple(
        PropagationResult(pair.source, pair.target, tuple(points))
        for pair, points in zip(pairs, carried)
    )
