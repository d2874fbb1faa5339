"""The document ``calibration.json`` of a calibration; its keys are a stable interface."""

from __future__ import annotations

from typing import Any, Dict, List, Optional

import numpy as np

from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.judge.outliers import OUTLIER_SIGMAS, Outliers, find_outliers
from atom_core.calibration.judge.propagation import SensorPair, propagate, sensor_pairs
from atom_core.calibration.judge.statistics import Table, kinds_of, residual_table
from atom_core.calibration.judge.weak_directions import edge_covariance
from atom_core.calibration.prepare.preparation import camera_of
from atom_core.geometry import se3
from atom_core.geometry.intrinsics import intrinsics_names, intrinsics_values
from atom_core.model.transforms import Edge
from atom_core.problem.residuals import UNITS

VERSION = "1.0"
_COMMENT_DISTANCE_M = 2.0


def result_document(
    calibration: Calibration, options: Dict[str, Any], solver_name: str
) -> Dict[str, Any]:
    """Return the document; all numbers finite, SI units.

    Args:
        calibration: the answer.
        options: the command's options, to be repeated.
        solver_name: which minimiser did the work.
    """
    problem, summary = calibration.problem, calibration.summary
    table = residual_table(problem, summary.x)
    outliers = find_outliers(problem, summary.x, summary.sigmas)
    return {
        "version": VERSION,
        "dataset": str(calibration.dataset.source),
        "seed": calibration.seed,
        "options": options,
        "status": calibration.status,
        "message": calibration.message,
        "solver": _solver(calibration, solver_name),
        "edges": edges_document(calibration),
        "joints": joints_document(calibration),
        "sensors": _sensors(calibration, table, outliers),
        "collections": _collections(calibration, table),
        "propagation": propagation_document(calibration),
        "outlier_limit_sigmas": OUTLIER_SIGMAS,
        "outlier_count": sum(outliers.counts.values()),
        "outliers": [outlier.document() for outlier in outliers.largest],
        "rejected_detections": [
            {**r.key._asdict(), "reason": r.reason, "excess": r.excess}
            for r in calibration.rejected
        ],
        "weak_directions": [
            {"parameters": list(w.parameters), "sigma": w.sigma, "unit": w.unit, "why": w.why}
            for w in calibration.weak_directions
        ],
        "warnings": list(calibration.warnings),
    }


def _solver(calibration: Calibration, name: str) -> Dict[str, Any]:
    summary = calibration.summary
    return {
        "name": name,
        "iterations": summary.iterations,
        "residuals": calibration.problem.row_count,
        "parameters": calibration.problem.parameters.free_count,
        "cost_initial": _finite(summary.cost_initial),
        "cost_final": _finite(summary.cost_final),
        "seconds": dict(calibration.seconds),
    }


def _finite(value: float) -> float:
    return float(np.nan_to_num(value, nan=1e300, posinf=1e300))


def selected_edges(calibration: Calibration) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of every selected edge, estimated or anchored.

    Of an edge with a value for each collection, the first.
    """
    dataset = calibration.dataset
    edges = [s.edge for s in dataset.sensors.values()]
    edges += list(calibration.free.additional_tfs.values())
    return {edge: dataset.first_value(edge) for edge in edges}


def sigma_text(calibration: Calibration, edge: Edge) -> str:
    """Return, for a comment, an edge's standard deviations and how well its sensors see with it.

    The latter is the deviation of a point carried to the reference, which is the anchored sensor,
    or the first one.
    """
    variance = edge_variance(calibration, edge)
    sigma = np.sqrt(np.zeros(6) if variance is None else variance)
    move = ", ".join(f"{1e3 * s:.2g}" for s in sigma[3:])
    turn = ", ".join(f"{np.rad2deg(s):.2g}" for s in sigma[:3])
    text = f"calibrated; sigma x y z: {move} mm, about x y z: {turn} deg"
    dataset, anchored = calibration.dataset, calibration.free.anchored_sensors
    reference = anchored[0] if anchored else next(iter(dataset.sensors))
    for pair in pairs_of(calibration):
        if dataset.sensors[pair.source].edge == edge and pair.target == reference:
            (carried,) = propagate([pair], dataset.sensors, [_COMMENT_DISTANCE_M])[0]
            text += f"; a point at {_COMMENT_DISTANCE_M:g} m, carried to {reference}: "
            text += f"{1e3 * carried.sigma_m:.2g} mm"
            text += "" if carried.sigma_px is None else f", {carried.sigma_px:.2g} px"
    return text


def edges_document(calibration: Calibration) -> Dict[str, Any]:
    """Return every selected edge: estimated ones with sigmas, anchored ones with zeros."""
    dataset = calibration.dataset
    held = calibration.free.held_edges(dataset)
    document = {}
    for edge, matrix in selected_edges(calibration).items():
        sensors = [s.name for s in dataset.sensors.values() if s.edge == edge]
        document[str(edge)] = _edge(calibration, edge, matrix, sensors, edge in held)
    return document


def _edge(
    calibration: Calibration, edge: Edge, matrix: np.ndarray, sensors: List[str], anchored: bool
) -> Dict[str, Any]:
    variance = edge_variance(calibration, edge)
    sigma = np.zeros(6) if variance is None else np.sqrt(np.minimum(variance, 1e12))
    return {
        "parent": edge.parent,
        "child": edge.child,
        "sensors": sensors,
        "anchored": anchored,
        "translation_m": [float(v) for v in matrix[:3, 3]],
        "quaternion_xyzw": [float(v) for v in se3.quaternion_from_rotation(matrix[:3, :3])],
        "sigma_translation_m": [float(v) for v in sigma[3:]],
        "sigma_rotation_rad": [float(v) for v in sigma[:3]],
    }


def joints_document(calibration: Calibration) -> Dict[str, Any]:
    """Return every calibrated parameter of joints: value, change, sigma; in m or rad."""
    parameters = calibration.problem.parameters
    document: Dict[str, Any] = {}
    for i, block in parameters.joint_blocks():
        name, variance = block.joint, np.diagonal(calibration.covariance.block(i))
        joint, before = calibration.dataset.joint(name), calibration.initial.joint(name)
        for place, parameter in block.free_components:
            document.setdefault(name, {})[parameter] = {
                "value": joint.parameters[parameter],
                "change": joint.parameters[parameter] - before.parameters[parameter],
                "sigma": float(np.sqrt(min(variance[place], 1e12))),
                "unit": joint.unit(parameter),
            }
    return document


def edge_variance(calibration: Calibration, edge: Edge) -> Optional[np.ndarray]:
    """Return (6,) variances of rotation and translation in the parent's axes; None if held."""
    parameters = calibration.problem.parameters
    for i, block in parameters.pose_blocks():
        if block.edge == edge:
            x = calibration.summary.x[parameters.slice_of(i)]
            return np.diagonal(edge_covariance(block, x, calibration.covariance.block(i)))
    return None


def pairs_of(calibration: Calibration) -> List[SensorPair]:
    """Return every ordered pair of sensors with the covariance of its pose."""
    x, parameters = calibration.summary.x, calibration.problem.parameters
    return sensor_pairs(calibration.dataset, parameters, x, calibration.covariance)


def propagation_document(calibration: Calibration) -> List[Dict[str, Any]]:
    """Return, for every ordered pair of sensors, how exactly points are carried over."""
    pairs = pairs_of(calibration)
    return [
        {
            "source": pair.source,
            "target": pair.target,
            "points": [point.document() for point in points],
        }
        for pair, points in zip(pairs, propagate(pairs, calibration.dataset.sensors))
    ]


def _sensors(calibration: Calibration, table: Table, outliers: Outliers) -> Dict[str, Any]:
    problem, summary = calibration.problem, calibration.summary
    document = {}
    for name, sensor in calibration.dataset.sensors.items():
        kinds = kinds_of(table, name)
        document[name] = {
            "modality": sensor.modality,
            "detections": sum(key.sensor == name for key in problem.detections),
            "outliers": outliers.counts.get(name, 0),
            "residuals": {kind: table[(name, kind, None)].document() for kind in kinds},
            "border_inset_steps": sum(
                inset
                for block, inset in zip(problem.residual_blocks, summary.inset_steps)
                if block.sensor == name
            ),
            **_range_offset(calibration, name),
            **_intrinsics(calibration, name),
            "sigma": {
                f"{block.kind}_{UNITS[block.kind]}": float(np.median(sigma))
                for block, sigma in zip(problem.residual_blocks, summary.sigmas)
                if block.sensor == name
            },
        }
    return document


def _intrinsics(calibration: Calibration, sensor: str) -> Dict[str, Any]:
    """Return a camera's estimated intrinsics; nothing where they were not asked for."""
    parameters, dataset = calibration.problem.parameters, calibration.dataset
    found: Dict[str, Any] = {}
    for i, block in parameters.camera_blocks():
        if block.sensor != sensor:
            continue
        now, before = (camera_of(d, sensor) for d in (dataset, calibration.initial))
        of_name = dict(zip(intrinsics_names(now), zip(*map(intrinsics_values, (now, before)))))
        sigmas = block.sigmas(np.diagonal(calibration.covariance.block(i)), now)
        for place, name in block.free_components:
            value, initial = of_name[name]
            found[name] = {
                "value": float(value),
                "change": float(value - initial),
                "sigma": min(sigmas[name], 1e12),
                "unit": block.units[place],
            }
    return {"intrinsics": found} if found else {}


def _range_offset(calibration: Calibration, sensor: str) -> Dict[str, float]:
    """Return what was found of a sensor's range offset; nothing where it was not asked for."""
    offsets = calibration.summary.range_offsets_m
    if sensor not in offsets:
        return {}
    sigma = calibration.covariance.range_offset_sigmas_m.get(sensor, 0.0)
    return {"range_offset_m": offsets[sensor], "sigma_range_offset_m": min(sigma, 1e6)}


def _collections(calibration: Calibration, table: Table) -> Dict[str, Any]:
    by_collection: Dict[Optional[str], Dict[str, Any]] = {}
    for (sensor, kind, collection), value in table.items():
        of_sensor = by_collection.setdefault(collection, {}).setdefault(sensor, {})
        of_sensor[kind] = value.document()
    document = {}
    for key in calibration.dataset.collections:
        residuals = by_collection.get(key, {})
        reason = calibration.unused.get(key)
        document[key] = {"used": reason is None, "reason": reason, "residuals": residuals}
    return document
