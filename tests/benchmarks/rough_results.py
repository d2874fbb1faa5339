"""The part of the results with the errors of real sensors: the rough profile of the cell."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any, Dict, List, Mapping, Sequence

import numpy as np
from cell_runs import STOPS, CellRun

from atom_core.calibration.options import AUTO, SUGGEST
from atom_core.io.truth_json import pose_from_document, read_truth
from atom_core.model.transforms import Edge
from atom_core.report.edge_results import EdgeResult
from atom_core.report.stated_errors import StatedError, stated_errors

ROUGH = "rough"  # the simulator's profile
MODES = (SUGGEST, AUTO)  # the first one is the default


def rough_part(seeds: Sequence[int], work: Path, compressed: bool, resume: bool) -> Dict[str, Any]:
    """Record, label and calibrate the cell of each seed, its sensors, board and robot erring.

    Args:
        seeds: of rig, boards, noise and errors.
        work: for all files.
        compressed: whether bags are.
        resume: take datasets that are there already.
    """
    rows: List[Dict[str, Any]] = []
    for seed in seeds:
        run = CellRun(seed, work / f"seed_{seed}_rough", compressed, ROUGH)
        run.simulate("train", STOPS["train"])
        if not (resume and run.dataset("train").is_file()):
            run.collect("train")
        for mode in MODES:
            run.calibrate("--model_errors", mode)
            rows.append({"seed": seed, "model_errors": mode, **_figures(run)})
    made = {"date": time.strftime("%Y-%m-%d"), "cores": os.cpu_count(), "compressed": compressed}
    return {"rows": rows, "made": made}


def _figures(run: CellRun) -> Dict[str, Any]:
    document = json.loads((run.calibration / "calibration.json").read_text(encoding="utf-8"))
    errors = stated_errors(_edges(document), read_truth(run.truth("train")))
    farthest = max(errors, key=lambda error: error.translation_m)
    mean = document["ground_truth"]["mean"]
    return {
        "status": document["status"],
        "said": document["message"],
        "mean_mm": 1e3 * mean["translation_error_m"],
        "mean_deg": mean["rotation_error_deg"],
        "farthest": ", ".join(farthest.sensors),
        "farthest_mm": 1e3 * farthest.translation_m,
        "largest_in_sigmas": max(error.in_sigmas for error in errors),
        "within_95_percent": _share_within(errors),
    }


def _edges(document: Mapping[str, Any]) -> List[EdgeResult]:
    """Return the edges of a ``calibration.json``."""
    found = []
    for entry in document["edges"].values():
        sigmas = [
            np.concatenate([entry[f"{which}_rotation_rad"], entry[f"{which}_translation_m"]])
            for which in ("sigma", "model_sigma", "combined_sigma")
        ]
        edge, pose = Edge(entry["parent"], entry["child"]), pose_from_document(entry)
        sensors = tuple(entry["sensors"])
        found.append(EdgeResult(edge, sensors, entry["anchored"], pose, *sigmas))
    return found


def _share_within(errors: Sequence[StatedError]) -> float:
    """Return the share of all numbers that their 95 % interval holds."""
    inside = [np.abs(error.error) < 1.96 * error.sigma for error in errors]
    return float(np.mean(np.concatenate(inside)))
