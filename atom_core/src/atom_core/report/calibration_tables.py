"""Tables of ``calibrate`` and ``check``, as users know them from ATOM."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.outliers import OUTLIER_SIGMAS, Outlier
from atom_core.calibration.judge.propagation import PropagatedPoint
from atom_core.calibration.judge.statistics import Table, kinds_of
from atom_core.calibration.preflight import Preflight
from atom_core.calibration.refine.moving_parts import moving_sentences
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION, UNITS
from atom_core.report.calibration_results import (
    CalibrationResults,
    GroundTruth,
)
from atom_core.report.edge_tables import edge_tables, figure_names, figures, joints_table
from atom_core.report.model_error_lines import estimated_errors, shown_errors
from atom_core.report.tables import ABSENT, by_collection_table, text_table
from atom_core.report.trust_report import trust_lines
from atom_core.report.truth_tables import truth_tables
from atom_core.report.verdict import is_open, sigma_in_words

_PROPAGATED_M = 2.0  # the distance whose deviations are shown
_WIDEST_MATRIX = 12  # sensors, that a matrix of them still fits the screen
_OUTLIERS_NAMED = 3
_SHOWN = {REPROJECTION: ("px", 1.0, 4), ORTHOGONAL: ("mm", 1e3, 2), BORDER: ("mm", 1e3, 2)}


def calibration_report(
    results: CalibrationResults, verbose: bool = False, normalised: bool = False
) -> str:
    """Return what ``calibrate`` prints.

    Args:
        results: the figures.
        verbose: also residuals by collection.
        normalised: these too, each with its multiple of the expected standard deviation.
    """
    calibration = results.calibration
    parts = [*edge_tables(results), *joints_table(results), _sensors_table(results)]
    parts += _intrinsics_table(results) + _model_error_lines(results)
    parts += _propagation_table(results) + _outliers_line(results)
    if results.trust is not None:
        parts.append(trust_lines(results.trust))
    if verbose or normalised:
        parts.append(_collections_table(results, normalised))
    if results.ground_truth is not None:
        parts.append(_truth_table(results.ground_truth))
        parts += truth_tables(results.edge_errors or (), results.joint_errors)
    rejected = {r.key.collection for r in calibration.rejected}  # among the warnings
    unused = [
        f"{key} ({value.unused})"
        for key, value in results.collections.items()
        if value.unused is not None and key not in rejected
    ]
    if unused:
        parts.append("collections not used: " + "; ".join(unused))
    parts += [f"warning: {warning}" for warning in results.warnings]
    for weak in calibration.weak_directions:
        parts.append(
            f"undetermined: {', '.join(weak.parameters)} "
            f"({sigma_in_words(weak.sigma, weak.unit)}): {weak.why}"
        )
    parts += [
        f"held by prior of {', '.join(held.priors)}: {', '.join(held.parameters)} (sigma "
        f"{held.sigma:.3g} {held.unit}): {held.why}"
        for held in calibration.held_directions
    ]
    parts += [f"inconsistent: {prior.why}" for prior in calibration.priors if prior.contradicted]
    parts += [f"inconsistent: {misfit.why}" for misfit in calibration.misfits]
    parts += [f"inconsistent: {exclusion.why}" for exclusion in calibration.exclusions]
    problem = calibration.problem
    parts.append(
        f"{calibration.status}: {calibration.message} ({calibration.summary.iterations} "
        f"iterations, {problem.row_count} residuals, {problem.parameters.free_count} parameters, "
        f"solved in {results.seconds['solve']:.2f} s)"
    )
    return "\n\n".join(parts)


def _sensors_table(results: CalibrationResults) -> str:
    rows = []
    for name, sensor in results.sensors.items():
        row: List[Any] = [name, sensor.modality, sensor.detections, sensor.outliers]
        for kind, (_, factor, digits) in _SHOWN.items():
            value = sensor.residuals.get(kind)
            if value is None:
                row += [None, None]
            else:
                row += [f"{factor * figure:.{digits}f}" for figure in (value.mean, value.rms)]
        rows.append(row)
    headers = ["Sensor", "Modality", "Detections", "Outliers"]
    for kind, (unit, _, _) in _SHOWN.items():
        headers += [f"{kind} mean [{unit}]", f"rms [{unit}]"]
    return text_table(headers, rows, "Residuals at the solution")


def _intrinsics_table(results: CalibrationResults) -> List[str]:
    rows: List[List[Any]] = []
    for name, sensor in results.sensors.items():
        for p in sensor.intrinsics:
            digits, unit = (3, "px") if p.unit == "px" else (6, "")
            numbers = [f"{value:.{digits}f}" for value in figures(results, p)]
            rows.append([name, p.name, *numbers, unit])
    headers = ["Camera", "Parameter", *figure_names(results), "Unit"]
    return [text_table(headers, rows, "Calibrated intrinsics")] if rows else []


def _model_error_lines(results: CalibrationResults) -> List[str]:
    """Return what was estimated of the model's errors, and what the data show beside it."""
    errors = [asdict(error) for error in results.model_errors]
    lines = [f"estimated: {told}" for told in estimated_errors(errors)]
    lines += [f"the data show: {told}" for told in shown_errors(errors)]
    lines += moving_sentences(results.calibration.free)
    return lines + [f"the data show: {edge.why}" for edge in results.calibration.moving]


def _propagation_table(results: CalibrationResults) -> List[str]:
    """Return the matrix of the deviations of a point carried from sensor to sensor."""
    names = list(results.sensors)
    if not 2 <= len(names) <= _WIDEST_MATRIX:
        return []
    cells: Dict[Tuple[str, str], str] = {}
    for pair in results.propagation:
        point = next(p for p in pair.points if p.distance_m == _PROPAGATED_M)
        cells[(pair.source, pair.target)] = _deviation(point)
    rows = [[source, *(cells.get((source, target)) for target in names)] for source in names]
    title = (
        f"{'Combined standard' if results.has_combined_sigmas else 'Standard'} deviation of a "
        f"point {_PROPAGATED_M:g} m before the sensor on the left, carried to another"
    )
    return [text_table(["From \\ to"] + names, rows, title)]


def _deviation(point: PropagatedPoint) -> str:
    if is_open(point.combined_sigma_m, "m"):
        return "open"
    if point.combined_sigma_px is not None:
        return f"{point.combined_sigma_px:.2f} px"
    return f"{1e3 * point.combined_sigma_m:.2f} mm"


def _outliers_line(results: CalibrationResults) -> List[str]:
    count = results.outliers.count
    if count == 0:
        return []
    items = sum(r.count for s in results.sensors.values() for r in s.residuals.values())
    largest = "; ".join(_outlier(results, o) for o in results.outliers.largest[:_OUTLIERS_NAMED])
    return [
        f"{count} of {items} corners and points lie more than {OUTLIER_SIGMAS:g} standard "
        f"deviations from where they should be, and count less for it; the farthest: {largest} "
        f"(more of them in calibration.json)"
    ]


def _outlier(results: CalibrationResults, outlier: Outlier) -> str:
    """Return what it is, where, and how far off: "a border pixel (433, 275) of depth_1 ..."."""
    camera = results.calibration.dataset.sensors[outlier.sensor].camera
    kind = "" if outlier.kind == ORTHOGONAL else "border "
    if outlier.kind == REPROJECTION:
        what = f"corner {outlier.id}"
    elif camera is not None:
        row, column = divmod(outlier.id, camera.width)
        what = f"{kind}pixel ({column}, {row})"
    else:
        what = f"{kind}point {outlier.id}"
    _, factor, _ = _SHOWN[outlier.kind]
    unit = "px" if outlier.unit == "px" else "mm"
    return (
        f"{what} of {outlier.sensor} in collection {outlier.collection}, "
        f"{factor * outlier.residual:.3g} {unit} off ({outlier.sigmas:.1f} standard deviations)"
    )


def _collections_table(results: CalibrationResults, normalised: bool) -> str:
    columns = [(name, kind) for name, s in results.sensors.items() for kind in s.residuals]
    rows = []
    for key, collection in results.collections.items():
        row: List[Any] = [key]
        for name, kind in columns:
            value = collection.residuals.get(name, {}).get(kind)
            _, factor, digits = _SHOWN[kind]
            cell = None if value is None else f"{factor * value.mean:.{digits}f}"
            if value is not None and normalised:
                sigma = results.sensors[name].sigma[f"{kind}_{value.unit}"]
                cell = f"{cell} ({value.mean / sigma:.2f})"
            row.append(cell)
        rows.append(row)
    headers = [f"{n} {k} [{_SHOWN[k][0]}]" for n, k in columns]
    title = "Mean residuals by collection"
    title += " (and by their expected standard deviation)" if normalised else ""
    return by_collection_table(headers, rows, title)


def _truth_table(ground_truth: GroundTruth) -> str:
    mean = ground_truth.mean
    rows: List[List[Any]] = [["mean", 1e3 * mean.translation_m, mean.rotation_deg]]
    for name, error in ground_truth.sensors.items():
        rows.append([name, 1e3 * error.translation_m, error.rotation_deg])
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
    if result.sides:
        parts.append(_size_table(result))
    parts += [f"warning: {w}" for w in result.warnings]
    parts += [f"problem: {p}" for p in result.problems]
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
    return by_collection_table(list(dataset.sensors), rows + [totals], title)


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
    headers = [f"{s} {kind} [{UNITS[kind]}]" for s, kind in columns]
    title = "Residuals at the poses in the dataset (mean of each collection)"
    return by_collection_table(headers, rows + [averages], title)


def _size_table(result: Preflight) -> str:
    rows = [
        (
            s.pattern,
            ("width", "height")[s.across],
            f"{s.configured_m:.4f}",
            s.sensor,
            f"{s.measured_m:.4f}",
            f"{100.0 * (s.measured_m / s.configured_m - 1.0):+.1f}",
            s.detections,
        )
        for s in sorted(result.sides)
    ]
    headers = ["Pattern", "Side", "Configured [m]", "To sensor", "Looks [m]", "[%]", "Detections"]
    title = "Boards as they look (limit points of cameras lie half a pixel inside)"
    return text_table(headers, rows, title)


class MovedEdge(NamedTuple):
    """How far a sensor's edge is from the description's; NaN where one of them lacks it."""

    sensor: str
    edge: Edge
    translation_m: float
    rotation_deg: float


def moved_report(moved: Sequence[MovedEdge]) -> str:
    """Return the table of ``check --against``."""
    cells = [[m.sensor, str(m.edge), 1e3 * m.translation_m, m.rotation_deg] for m in moved]
    headers = ["Sensor", "Edge", "Apart [mm]", "Turned [deg]"]
    title = "Mounts in the dataset's transforms against the description (the boards are not asked)"
    return text_table(headers, cells, title, 3)
