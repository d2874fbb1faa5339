"""Tables of cameras by themselves on a test set: reprojection, spread, hand-eye methods."""

from __future__ import annotations

from typing import Any, Iterator, List, Mapping, Optional, Tuple

from atom_core.evaluation.statistics import mean_of
from atom_core.report.page.blocks import Block, Table
from atom_core.report.page.given import Document
from atom_core.report.tables import ABSENT, three_digits

_HAND_EYE = "hand_eye"  # the calibration in the terms of the methods, and how their names begin
_FIGURES = ("reprojection_px", "spread_px", "spread_mm", "spread_deg")


def camera_tables(document: Document) -> List[Block]:
    """Return what the test set says of each camera by itself, and of hand-eye methods.

    Args:
        document: of an evaluation.
    """
    tables = (_reprojection(document), _spread(document), _hand_eye(document))
    return [table for table in tables if table.rows]


def _reprojection(document: Document) -> Table:
    others = {_camera_key(e): e for e in _of_the_other(document, "single_cameras")}
    rows = []
    for entry in document.get("single_cameras", []):
        if entry["skipped"] is not None:
            continue
        board = "one pose for all" if entry["one_pose"] else "a pose for each"
        counts = [str(entry["collections"]), str(entry["points"])]
        in_each = mean_of([one["mean"] for one in entry["per_collection"].values()])
        row = [entry["sensor"], entry["pattern"], board, *counts, _three(in_each)]
        row += [_three(entry["rms"]), _three(_figure(entry["at_truth"], "rms"))]
        rows.append([*row, *_beside(others, _camera_key(entry), "rms")])
    columns = ["camera", "board", "its pose", "collections", "corners", "mean [px]", "RMS [px]"]
    columns += ["RMS at the truth", *(["RMS compared with"] if others else [])]
    note = (
        "Corners from where the board is projected; means over the collections. One pose for all: "
        "the board is fixed, and what is left are errors of the hand-eye calibration, of the "
        "robot's poses, of labels and intrinsics. A pose for each image: of labels and intrinsics "
        "alone, wherever the camera is."
    )
    return Table("Cameras by themselves", columns, rows, note=note)


def _spread(document: Document) -> Table:
    others = {e["source"]: e for e in _of_the_other(document, "between_collections")}
    rows = []
    for entry in document.get("between_collections", []):
        if entry["skipped"] is not None:
            continue
        row = [entry["source"], str(entry["collections"]), str(entry["points"])]
        for figures in (entry, entry["at_truth"]):
            names = ("rms", "translation_mm", "rotation_deg")
            row += [_three(_figure(figures, name)) for name in names]
        rows.append([*row, *_beside(others, entry["source"], "translation_mm")])
    columns = ["camera", "pairs of collections", "corners", "RMS [px]", "apart [mm]"]
    columns += ["turned [deg]", "at the truth [px]", "at the truth [mm]", "at the truth [deg]"]
    columns += ["compared with [mm]"] if others else []
    note = "A board that stays, as each two collections have it; the robot's poses enter."
    return Table("Spread of fixed boards, from one collection to another", columns, rows, note=note)


def _hand_eye(document: Document) -> Table:
    found = dict(_scores(document))
    known = any(score.get("error_m") is not None for score in found.values())
    rows = []
    for (method, camera), score in found.items():
        row = [method, camera, *(_three(score.get(name)) for name in _FIGURES)]
        if known:
            metres = score.get("error_m")
            row += [_three(None if metres is None else 1e3 * metres), _three(score["error_deg"])]
        rows.append(row)
    columns = ["method", "camera", "reprojection [px]", "spread [px]", "spread [mm]"]
    columns += ["spread [deg]", *(["error [mm]", "error [deg]"] if known else [])]
    return Table("Hand-eye methods on the same labels", columns, rows)


def _scores(document: Document) -> Iterator[Tuple[Tuple[str, str], Mapping[str, Any]]]:
    """Yield method, camera and score, the calibration first."""
    for name, entry in document.get("baselines", {}).items():
        if name.startswith(_HAND_EYE) and isinstance(entry, Mapping):
            method = name[len(_HAND_EYE) + 1 :]
            method = f"OpenCV {method}" if method else "this calibration"
            for camera, score in (entry.get("cameras") or {}).items():
                yield (method, camera), score


def _of_the_other(document: Document, name: str) -> List[Mapping[str, Any]]:
    """Return the measured entries of the calibration that this one is compared with."""
    entries = document.get("compared_with", {}).get(name, [])
    return [entry for entry in entries if entry["skipped"] is None]


def _beside(others: Mapping[Any, Mapping[str, Any]], key: Any, name: str) -> List[str]:
    return [_three(_figure(others.get(key), name))] if others else []


def _camera_key(entry: Mapping[str, Any]) -> Tuple[str, str]:
    return entry["sensor"], entry["pattern"]


def _figure(figures: Optional[Mapping[str, Any]], name: str) -> Optional[float]:
    return None if figures is None else figures.get(name)


def _three(value: Optional[float]) -> str:
    return three_digits(value) or ABSENT
