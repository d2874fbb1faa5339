"""What a report is made from: the documents of results, and the dataset where it can be read."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Dict, List, Mapping, Optional, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.colours import sensor_colours
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.report.residual_samples import ResidualSample

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Given:
    """Results of one calibration, of one evaluation, or of both.

    Attributes:
        calibration: ``calibration.json``; None: there is none.
        evaluation: ``evaluation.json``; None: there is none.
        dataset: with the calibrated edges and board poses; None: it could not be read.
        residuals: at the solution; empty where they were not kept.
        remarks: what could not be read, and is therefore left out.
        changes: comparisons with another calibration (``comparison.json``) or with new boards
            (``drift.json``).
    """

    calibration: Optional[Document]
    evaluation: Optional[Document]
    dataset: Optional[Dataset] = field(default=None, repr=False)
    residuals: Tuple[ResidualSample, ...] = field(default=(), repr=False)
    remarks: Tuple[str, ...] = ()
    changes: Tuple[Document, ...] = field(default=(), repr=False)

    @property
    def sensors(self) -> List[str]:
        """Names of all sensors, in the order of the calibration."""
        if self.calibration is not None:
            return list(self.calibration["sensors"])
        if self.dataset is not None:
            return list(self.dataset.sensors)
        return list(verdict_of(self.evaluation).get("sensors", {}))

    @cached_property
    def colours(self) -> Dict[str, Tuple[float, float, float]]:
        """One colour for each sensor, as everywhere else."""
        return sensor_colours(self.sensors)

    @cached_property
    def before(self) -> Optional[Dataset]:
        """The dataset with the edges that the solver started from; None where they are unknown.

        What has a value for each collection stays: its start is known of the first one alone.
        """
        if self.dataset is None or self.calibration is None:
            return None
        initial = initial_edges(self.calibration)
        if not initial:
            return None
        for entry in self.calibration["edges"].values():
            if entry.get("sigma_collection") is not None:
                del initial[Edge(entry["parent"], entry["child"])]
        return self.dataset.with_transforms(dict.fromkeys(self.dataset.collections, initial))


def verdict_of(document: Optional[Document]) -> Document:
    """Return the verdict of a result; empty where there is none."""
    return {} if document is None else document.get("verdict") or {}


def initial_edges(calibration: Document) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) at the start, of the edges whose start is known."""
    found = {}
    for edge in calibration["edges"].values():
        if "initial_translation_m" in edge:
            pose = (edge["initial_translation_m"], edge["initial_quaternion_xyzw"])
            found[Edge(edge["parent"], edge["child"])] = se3.from_quaternion(*map(np.array, pose))
    return found


def final_edges(calibration: Document) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) at the solution."""
    return {
        Edge(e["parent"], e["child"]): se3.from_quaternion(
            np.array(e["translation_m"]), np.array(e["quaternion_xyzw"])
        )
        for e in calibration["edges"].values()
    }
