"""The document ``calibration.json`` of a calibration; its keys are a stable interface."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Dict, List, Mapping, Sequence

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.outliers import OUTLIER_SIGMAS
from atom_core.calibration.judge.propagation import PropagatedPoint
from atom_core.geometry import se3
from atom_core.geometry.intrinsics import intrinsics_names, intrinsics_values
from atom_core.model.dataset import Dataset
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.report.calibration_results import (
    CalibrationResults,
    CollectionResult,
    Residuals,
    SensorResult,
)
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.edge_results import EdgeResult, ParameterResult
from atom_core.report.ground_truth_document import ground_truth_document
from atom_core.report.trust_report import trust_document
from atom_core.report.truth_tables import truth_document
from atom_core.report.verdict import verdict_document

VERSION = "1.0"
_COMBINED = "combined_sigma"


def calibration_document(results: CalibrationResults, options: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the document; all numbers finite, SI units.

    Args:
        results: the figures.
        options: the command's options, to be repeated.
    """
    calibration, outliers = results.calibration, results.outliers
    freedom = calibration.covariance.freedom
    document = {
        "version": VERSION,
        "dataset": str(calibration.dataset.source),
        "seed": calibration.seed,
        "options": dict(options),
        "status": calibration.status,
        "message": calibration.message,
        "contradictions": list(calibration.contradictions),
        "verdict": verdict_document(calibration_verdict(results)),
        "solver": _solver(results),
        "degrees_of_freedom": freedom if np.isfinite(freedom) else None,
        "edges": {str(edge.edge): _edge(edge, calibration.initial) for edge in results.edges},
        "joints": {name: _joint(joint) for name, joint in results.joints.items()},
        "sensors": {name: _sensor(sensor) for name, sensor in results.sensors.items()},
        "collections": {key: _collection(value) for key, value in results.collections.items()},
        "propagation": _propagation(results),
        "outlier_limit_sigmas": OUTLIER_SIGMAS,
        "outlier_count": outliers.count,
        "outliers": [outlier._asdict() for outlier in outliers.largest],
        "rejected_detections": [
            {**r.key._asdict(), "reason": r.reason, "excess": r.excess}
            for r in calibration.rejected
        ],
        "weak_directions": [
            {**asdict(weak), "parameters": list(weak.parameters)}
            for weak in calibration.weak_directions
        ],
        **_priors(calibration),
        "model_errors": [
            {**asdict(error), "rivals": list(error.rivals)} for error in results.model_errors
        ],
        **_inconsistencies(calibration),
        "trust_checks": None if results.trust is None else trust_document(results.trust),
        "warnings": list(results.warnings),
    }
    if results.ground_truth is not None:
        document["ground_truth"] = ground_truth_document(results.ground_truth)
        document["truth_comparison"] = truth_document(
            results.edge_errors or (), results.joint_errors
        )
    return document if results.has_combined_sigmas else _without_combined(document)


def _without_combined(document: Any) -> Any:
    """Return a document without the sigmas that would say more than is known."""
    if isinstance(document, dict):
        kept = {key: v for key, v in document.items() if not str(key).startswith(_COMBINED)}
        return {key: _without_combined(value) for key, value in kept.items()}
    if isinstance(document, list):
        return [_without_combined(value) for value in document]
    return document


def _propagation(results: CalibrationResults) -> List[Dict[str, Any]]:
    return [
        {
            "source": pair.source,
            "target": pair.target,
            "points": [_point(point) for point in pair.points],
        }
        for pair in results.propagation
    ]


def _inconsistencies(calibration: Calibration) -> Dict[str, Any]:
    shared = [e.shared and e.shared._asdict() for e in calibration.exclusions]
    return {
        "moving_parts": [
            {
                "parent": edge.parent,
                "child": edge.child,
                "sigma_m": part.sigma_m,
                "sigma_rad": part.sigma_rad,
                "estimated": part.is_estimated,
                "far": sorted(part.far),
            }
            for edge, part in calibration.free.moving.items()
        ],
        "moving_edges": [
            {**edge._asdict(), "collections": list(edge.collections)} for edge in calibration.moving
        ],
        "misfits": [misfit._asdict() for misfit in calibration.misfits],
        "exclusions": [
            {**exclusion._asdict(), "shared": sort}
            for exclusion, sort in zip(calibration.exclusions, shared)
        ],
    }


def _solver(results: CalibrationResults) -> Dict[str, Any]:
    problem, summary = results.calibration.problem, results.calibration.summary
    return {
        "name": results.solver_name,
        "iterations": summary.iterations,
        "residuals": problem.row_count,
        "parameters": problem.parameters.free_count,
        "cost_initial": _finite(summary.cost_initial),
        "cost_final": _finite(summary.cost_final),
        "seconds": dict(results.seconds),
    }


def _finite(value: float) -> float:
    return float(np.nan_to_num(value, nan=1e300, posinf=1e300))


def _edge(edge: EdgeResult, initial: Dataset) -> Dict[str, Any]:
    matrix, prior = edge.parent_T_child, edge.prior
    started = initial.first_value(edge.edge)
    return {
        "parent": edge.edge.parent,
        "child": edge.edge.child,
        "sensors": list(edge.sensors),
        "anchored": edge.anchored,
        "translation_m": matrix[:3, 3].tolist(),
        "quaternion_xyzw": se3.quaternion_from_rotation(matrix[:3, :3]).tolist(),
        "initial_translation_m": started[:3, 3].tolist(),
        "initial_quaternion_xyzw": se3.quaternion_from_rotation(started[:3, :3]).tolist(),
        "sigma_translation_m": edge.sigma_translation_m.tolist(),
        "sigma_rotation_rad": edge.sigma_rotation_rad.tolist(),
        "covariance": None if edge.covariance is None else edge.covariance.tolist(),
        "sigma_collection": edge.collection,
        "combined_sigma_translation_m": edge.combined_sigma[TRANSLATION].tolist(),
        "combined_sigma_rotation_rad": edge.combined_sigma[ROTATION].tolist(),
        "model_sigma_translation_m": edge.model_sigma[TRANSLATION].tolist(),
        "model_sigma_rotation_rad": edge.model_sigma[ROTATION].tolist(),
        "prior_sigma_m": prior and prior.sigma_m,
        "prior_sigma_rad": prior and prior.sigma_rad,
        "held_by_prior": edge.held,
    }


def _parameters(parameters: Sequence[ParameterResult]) -> Dict[str, Dict[str, Any]]:
    keys = ("value", "change", "sigma", "combined_sigma", "unit")
    return {p.name: {key: getattr(p, key) for key in keys} for p in parameters}


def _joint(parameters: Sequence[ParameterResult]) -> Dict[str, Dict[str, Any]]:
    document = _parameters(parameters)
    for p in parameters:
        document[p.name].update(prior_sigma=p.prior_sigma, held_by_prior=p.held)
    return document


def _priors(calibration: Calibration) -> Dict[str, Any]:
    return {
        "priors": [
            {
                "name": result.prior.name,
                "sigma_m": result.prior.sigma_m,
                "sigma_rad": result.prior.sigma_rad,
                "deviation_sigmas": result.deviation,
                "contradicted": result.contradicted,
            }
            for result in calibration.priors
        ],
        "held_by_prior": [
            {**asdict(held), "parameters": list(held.parameters), "priors": list(held.priors)}
            for held in calibration.held_directions
        ],
    }


def _sensor(sensor: SensorResult) -> Dict[str, Any]:
    document = {
        "modality": sensor.modality,
        "detections": sensor.detections,
        "outliers": sensor.outliers,
        "residuals": _residuals(sensor.residuals),
        "border_inset_steps": sensor.border_inset_steps,
    }
    if sensor.range_offset is not None:
        document["range_offset_m"] = sensor.range_offset.offset_m
        document["sigma_range_offset_m"] = sensor.range_offset.sigma_m
    if sensor.intrinsics:
        document["intrinsics"] = _parameters(sensor.intrinsics)
    if sensor.cameras is not None:
        pair = zip(("given", "found"), sensor.cameras)
        document["camera"] = {
            which: dict(zip(intrinsics_names(camera), intrinsics_values(camera).tolist()))
            for which, camera in pair
        }
    return {**document, "sigma": dict(sensor.sigma)}


def _collection(collection: CollectionResult) -> Dict[str, Any]:
    return {
        "used": collection.unused is None,
        "reason": collection.unused,
        "residuals": {name: _residuals(r) for name, r in collection.residuals.items()},
    }


def _residuals(residuals: Residuals) -> Dict[str, Any]:
    return {kind: asdict(statistics) for kind, statistics in residuals.items()}


def _point(point: PropagatedPoint) -> Dict[str, Any]:
    return {**point._asdict(), "point_in_source_m": point.point_in_source_m.tolist()}
