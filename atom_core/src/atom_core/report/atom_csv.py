"""Files of `calibrate` with ATOM's names and columns: errors against the truth, and residuals."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from atom_core.evaluation.edge_errors import EdgeError, JointError
from atom_core.report.calibration_results import CalibrationResults, Residuals
from atom_core.report.tables import ABSENT, AVERAGES, csv_table

TRANSFORMS_FILE = "comparison_to_ground_truth_transforms.csv"
JOINTS_FILE = "comparison_to_ground_truth_joints.csv"
SHORT_FILE = "comparison_to_gt_tfs.csv"
ERRORS_FILE = "calibration_errors.csv"
_DECIMALS, _SHORT_DECIMALS, _RESIDUAL_DECIMALS = 5, 6, 4


def transforms_csv(errors: Sequence[EdgeError]) -> str:
    """Return the errors of the edges before (0) and after, one line for each."""
    headers = ["Transform", "Description", "Et0 [m]", "Et [m]", "Rrot0 [rad]", "Erot [rad]"]
    rows = [
        [
            str(error.edge),
            error.name if error.collection is None else f"{error.name} {error.collection}",
            None if error.before is None else error.before.translation_m,
            error.after.translation_m,
            None if error.before is None else error.before.rotation_rad,
            error.after.rotation_rad,
        ]
        for error in errors
    ]
    return _csv(headers, rows, _DECIMALS, averages=2)


def joints_csv(errors: Sequence[JointError]) -> str:
    """Return the absolute errors of joints' parameters."""
    headers = ["Joint", "Param", "Error (ini)", "Error (calib)"]
    rows = [[e.joint, e.parameter, abs(e.before), abs(e.after)] for e in errors]
    return _csv(headers, rows, _DECIMALS, averages=2)


def short_csv(errors: Sequence[EdgeError]) -> str:
    """Return the errors of the edges after the calibration."""
    rows = [[str(e.edge), e.after.translation_m, e.after.rotation_rad] for e in errors]
    return _csv(["Transform", "Et [m]", "Erot [rad]"], rows, _SHORT_DECIMALS)


def residuals_csv(results: CalibrationResults) -> str:
    """Return mean residuals: of cameras [px], of range sensors [m], by collection."""
    sensors = results.sensors.values()
    units = {s.name: next((r.unit for r in s.residuals.values()), "px") for s in sensors}
    headers = ["Collection", *(f"{name} [{unit}]" for name, unit in units.items())]
    rows = []
    for key, collection in results.collections.items():
        rows.append([key, *(_mean(collection.residuals.get(name)) for name in units)])
    return _csv(headers, rows, _RESIDUAL_DECIMALS, averages=1)


def _mean(residuals: Optional[Residuals]) -> Optional[float]:
    """Return the mean over all kinds of a sensor's residuals."""
    if not residuals:
        return None
    counts = [statistics.count for statistics in residuals.values()]
    return float(np.average([s.mean for s in residuals.values()], weights=counts))


def _csv(headers: List[str], rows: List[List[Any]], decimals: int, averages: int = 0) -> str:
    """Return the text, with a line of means if so many columns stand before the numbers."""
    if averages:
        columns = list(zip(*rows))[averages:] if rows else [()] * (len(headers) - averages)
        means = [_average(column) for column in columns]
        rows = [*rows, [AVERAGES, *[""] * (averages - 1), *means]]
    return csv_text(headers, rows, decimals)


def csv_text(
    headers: Sequence[str], rows: Sequence[Sequence[Any]], decimals: int, absent: str = ABSENT
) -> str:
    """Return a table as ATOM writes it: floats with so many decimals, `absent` where none is."""
    lines = ([_cell(value, decimals, absent) for value in row] for row in rows)
    return csv_table([headers, *lines], line_end="\r\n")


def _average(column: Sequence[Optional[float]]) -> Optional[float]:
    known = [value for value in column if value is not None]
    return float(np.mean(known)) if known else None


def _cell(value: Any, decimals: int, absent: str) -> str:
    if value is None:
        return absent
    return f"{value:.{decimals}f}" if isinstance(value, float) else str(value)


def atom_files(results: CalibrationResults, with_residuals: bool) -> Dict[str, str]:
    """Return the texts of ATOM's CSV files by name; those against the truth where it is known."""
    files: Dict[str, str] = {ERRORS_FILE: residuals_csv(results)} if with_residuals else {}
    if results.edge_errors is not None:
        files[TRANSFORMS_FILE] = transforms_csv(results.edge_errors)
    if results.joint_errors:
        files[JOINTS_FILE] = joints_csv(results.joint_errors)
    return files
