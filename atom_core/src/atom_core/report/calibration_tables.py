"""Tables of ``calibrate`` and ``check``, as users know them from ATOM."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping

import numpy as np

from atom_core.calibration.judge.statistics import Table, kinds_of
from atom_core.calibration.preflight import Preflight
from atom_core.model.dataset import Dataset, DetectionKey
from atom_core.report.tables import ABSENT, text_table

_PROPAGATED_M = 2.0  # the distance whose deviations are shown
_WIDEST_MATRIX = 12  # sensors, that a matrix of them still fits the screen
_OUTLIERS_NAMED = 3
_SHOWN = {"reprojection": ("px", 1.0, 4), "orthogonal": ("mm", 1e3, 2), "border": ("mm", 1e3, 2)}


def calibration_report(document: Mapping[str, Any], verbose: bool = False) -> str:
    """Return what ``calibrate`` prints, from the document ``calibration.json``."""
    parts = [_edges_table(document), *_joints_table(document), _sensors_table(document)]
    parts += _intrinsics_table(document) + _range_offset_lines(document)
    parts += _propagation_table(document) + _outliers_line(document)
    if verbose:
        parts.append(_collections_table(document))
    if "ground_truth" in document:
        parts.append(_truth_table(document["ground_truth"]))
    rejected = {r["collection"] for r in document["rejected_detections"]}  # among the warnings
    unused = [
        f"{key} ({value['reason']})"
        for key, value in document["collections"].items()
        if not value["used"] and key not in rejected
    ]
    if unused:
        parts.append("collections not used: " + "; ".join(unused))
    parts += [f"warning: {w}" for w in document["warnings"]]
    for weak in document["weak_directions"]:
        parts.append(
            f"undetermined: {', '.join(weak['parameters'])} (sigma {weak['sigma']:.3g} "
            f"{weak['unit']}): {weak['why']}"
        )
    solver = document["solver"]
    parts.append(
        f"{document['status']}: {document['message']} ({solver['iterations']} iterations, "
        f"{solver['residuals']} residuals, {solver['parameters']} parameters, solved in "
        f"{solver['seconds']['solve']:.2f} s)"
    )
    return "\n\n".join(parts)


def _edges_table(document: Mapping[str, Any]) -> str:
    rows = []
    for name, edge in document["edges"].items():
        sigmas = [
            1e3 * max(edge["sigma_translation_m"]),
            math.degrees(max(edge["sigma_rotation_rad"])),
        ]
        state = "anchored" if edge["anchored"] else "estimated"
        rows.append([", ".join(edge["sensors"]), name, state, *edge["translation_m"], *sigmas])
    headers = ["Sensors", "Edge (parent-child)", "", "x [m]", "y [m]", "z [m]"]
    headers += ["sigma [mm]", "sigma [deg]"]
    return text_table(headers, rows, "Calibrated edges (sigma: the largest of three axes)")


def _joints_table(document: Mapping[str, Any]) -> List[str]:
    rows = []
    for name, parameters in document["joints"].items():
        for parameter, found in parameters.items():
            factor, unit = (1e3, "mm") if found["unit"] == "m" else (math.degrees(1.0), "deg")
            numbers = [factor * found[key] for key in ("value", "change", "sigma")]
            rows.append([name, parameter, *numbers, unit])
    headers = ["Joint", "Parameter", "Value", "Change", "Sigma", "Unit"]
    return [text_table(headers, rows, "Calibrated joints")] if rows else []


def _sensors_table(document: Mapping[str, Any]) -> str:
    rows = []
    for name, sensor in document["sensors"].items():
        row: List[Any] = [name, sensor["modality"], sensor["detections"], sensor["outliers"]]
        for kind, (_, factor, digits) in _SHOWN.items():
            value = sensor["residuals"].get(kind)
            for figure in ("mean", "rms"):
                row.append(None if value is None else f"{factor * value[figure]:.{digits}f}")
        rows.append(row)
    headers = ["Sensor", "Modality", "Detections", "Outliers"]
    for kind, (unit, _, _) in _SHOWN.items():
        headers += [f"{kind} mean [{unit}]", f"rms [{unit}]"]
    return text_table(headers, rows, "Residuals at the solution")


def _intrinsics_table(document: Mapping[str, Any]) -> List[str]:
    rows: List[List[Any]] = []
    for name, sensor in document["sensors"].items():
        for parameter, found in sensor.get("intrinsics", {}).items():
            digits, unit = (3, "px") if found["unit"] == "px" else (6, "")
            numbers = [f"{found[key]:.{digits}f}" for key in ("value", "change", "sigma")]
            rows.append([name, parameter, *numbers, unit])
    headers = ["Camera", "Parameter", "Value", "Change", "Sigma", "Unit"]
    return [text_table(headers, rows, "Calibrated intrinsics")] if rows else []


def _range_offset_lines(document: Mapping[str, Any]) -> List[str]:
    found = [
        f"{name} {1e3 * s['range_offset_m']:+.2f} mm (sigma {1e3 * s['sigma_range_offset_m']:.2g})"
        for name, s in document["sensors"].items()
        if "range_offset_m" in s
    ]
    return [f"Added to all distances: {', '.join(found)}"] if found else []


def _propagation_table(document: Mapping[str, Any]) -> List[str]:
    """Return the matrix of the deviations of a point carried from sensor to sensor."""
    names = list(document["sensors"])
    if not 2 <= len(names) <= _WIDEST_MATRIX:
        return []
    cells = {}
    for pair in document["propagation"]:
        point = next(p for p in pair["points"] if p["distance_m"] == _PROPAGATED_M)
        cells[(pair["source"], pair["target"])] = _deviation(point)
    rows = [[source] + [cells.get((source, target)) for target in names] for source in names]
    title = (
        f"Standard deviation of a point {_PROPAGATED_M:g} m before the sensor on the left, carried "
        f"to another"
    )
    return [text_table(["From \\ to"] + names, rows, title)]


def _deviation(point: Mapping[str, Any]) -> str:
    if point["sigma_px"] is not None:
        return f"{point['sigma_px']:.2f} px"
    return f"{1e3 * point['sigma_m']:.2f} mm"


def _outliers_line(document: Mapping[str, Any]) -> List[str]:
    count, limit = document["outlier_count"], document["outlier_limit_sigmas"]
    if count == 0:
        return []
    items = sum(r["count"] for s in document["sensors"].values() for r in s["residuals"].values())
    largest = [
        f"{o['sensor']} in {o['collection']}, {o['kind']} of {o['id']}: {o['sigmas']:.1f}"
        for o in document["outliers"][:_OUTLIERS_NAMED]
    ]
    return [
        f"{count} of {items} corners and points lie beyond {limit:g} sigma; the largest: "
        f"{'; '.join(largest)} (all in calibration.json)"
    ]


def _collections_table(document: Mapping[str, Any]) -> str:
    columns = [(name, kind) for name, s in document["sensors"].items() for kind in s["residuals"]]
    rows = []
    for key, collection in document["collections"].items():
        row: List[Any] = [key]
        for name, kind in columns:
            value = collection["residuals"].get(name, {}).get(kind)
            _, factor, digits = _SHOWN[kind]
            row.append(None if value is None else f"{factor * value['mean']:.{digits}f}")
        rows.append(row)
    headers = ["Collection"] + [f"{n} {k} [{_SHOWN[k][0]}]" for n, k in columns]
    return text_table(headers, rows, "Mean residuals by collection")


def _truth_table(ground_truth: Mapping[str, Any]) -> str:
    rows = [
        [name, 1e3 * value["translation_error_m"], value["rotation_error_deg"]]
        for name, value in ground_truth.items()
    ]
    return text_table(
        ["Sensor", "Translation [mm]", "Rotation [deg]"], rows, "Errors against truth", 3
    )


def preflight_report(dataset: Dataset, result: Preflight) -> str:
    """Return what ``check`` prints."""
    parts = [_detection_table(dataset, result)]
    parts.append(
        f"{len(dataset.collections)} collections, {len(result.complete)} complete; "
        f"{result.rows} residuals, {result.free_parameters} free parameters"
    )
    if result.residuals is not None:
        parts.append(_residual_table(dataset, result.residuals))
    parts += [f"warning: {w}" for w in result.warnings]
    parts += [f"problem: {p}" for p in result.problems]
    parts.append("not ready to calibrate" if result.problems else "ready to calibrate")
    return "\n\n".join(parts)


def _detection_table(dataset: Dataset, result: Preflight) -> str:
    rows = []
    for key in dataset.collections:
        cells = [_detection_cell(dataset, result.detections, key, s) for s in dataset.sensors]
        rows.append([key] + cells)
    totals: List[Any] = ["seen in"]
    for sensor in dataset.sensors:
        totals.append(str(len({k.collection for k in result.detections if k.sensor == sensor})))
    title = "Detections (corners found/of all; range points inside+border)"
    return text_table(["Collection"] + list(dataset.sensors), rows + [totals], title)


def _detection_cell(
    dataset: Dataset, detections: Mapping[DetectionKey, str], key: str, sensor: str
) -> str:
    cells = [detections.get(DetectionKey(key, sensor, p), ABSENT) for p in dataset.patterns]
    return " | ".join(cells)


def _residual_table(dataset: Dataset, table: Table) -> str:
    """Return ATOM's table of errors, at the poses that the dataset carries."""
    columns = [(s, kind) for s in dataset.sensors for kind in kinds_of(table, s)]
    rows = []
    for key in dataset.collections:
        row: List[Any] = [key]
        for sensor, kind in columns:
            value = table.get((sensor, kind, key))
            row.append(None if value is None else round(value.mean, 4))
        rows.append(row)
    averages: List[Any] = ["Averages"]  # of the printed values, as ATOM does
    for cells in list(zip(*rows))[1:]:
        averages.append(float(np.mean([v for v in cells if v is not None])))
    units = {"reprojection": "px", "orthogonal": "m", "border": "m"}
    headers = ["Collection"] + [f"{s} {kind} [{units[kind]}]" for s, kind in columns]
    title = "Residuals at the poses in the dataset (mean of each collection)"
    return text_table(headers, rows + [averages], title)


def moved_report(rows: List[Dict[str, Any]]) -> str:
    """Return the table of ``check --against``."""
    cells = [[r["sensor"], r["edge"], 1e3 * r["translation_m"], r["rotation_deg"]] for r in rows]
    headers = ["Sensor", "Edge", "Moved [mm]", "Turned [deg]"]
    return text_table(headers, cells, "Dataset against description", 3)
