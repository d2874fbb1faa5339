"""The first guess of where sensors are: values that a person edits, and where they are saved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from atom_core.calibration.start.starts import sensors_from_data
from atom_core.errors import ConfigError
from atom_core.io.atomic import write_text_atomically
from atom_core.io.dataset_json import read_dataset
from atom_core.io.urdf import Description, WriteReport, write_calibrated_description
from atom_core.model.config import CalibrationConfig
from atom_core.model.robot import FIXED
from atom_core.model.transforms import Edge

UNSAVED = "unsaved_"  # begins the name of the file of what nobody saved
_ORIGINAL = ".orig"
_SAME = 1e-9  # m and entries of rotations


@dataclass(frozen=True)
class Saved:
    """What became of a first guess that was saved.

    Attributes:
        report: what was written, and what is missing in the description.
        original: copy of the xacro whose macros the new file lacks; None when nothing was lost.
    """

    report: WriteReport
    original: Optional[Path]

    @property
    def sentence(self) -> str:
        """For the user."""
        text = f"saved to {self.report.path}: {len(self.report.replaced)} changed"
        if self.report.flattened:
            kept = f"; the file as it was is {self.original}" if self.original else ""
            text += f"; it is expanded, without the macros of the xacro: {self.report.reason}{kept}"
        return text


class FirstGuess:
    """Values of the edges that a person may edit.

    Attributes:
        edges: by the name of sensor or additional tf; sensors that share an edge share its value.
        remarks: what cannot be edited, and why.
    """

    def __init__(self, config: CalibrationConfig, description: Description):
        """Start from the description.

        Args:
            config: says what is free: sensors that are not anchored, and additional tfs.
            description: the robot.

        Raises:
            ConfigError: nothing can be edited.
        """
        self._description = description
        self.edges, self.remarks = _editable(config, description)
        if not self.edges:
            raise ConfigError(
                f"nothing of the configuration can be edited in {description.path}: "
                + "; ".join(self.remarks or ["every sensor is anchored"])
            )
        transforms = description.robot.transforms()
        self._initial = {edge: transforms[edge] for edge in self.edges.values()}
        self._values = dict(self._initial)
        self._saved = dict(self._initial)
        fixed = (j.edge for j in description.robot.joints.values() if j.type == FIXED)
        self._others = {edge: transforms[edge] for edge in fixed if edge not in self._initial}

    def value(self, name: str) -> np.ndarray:
        """Return ``parent_T_child`` (4, 4) of what has this name [m]."""
        return self._values[self.edges[name]]

    def set(self, name: str, parent_T_child: np.ndarray) -> None:
        """Take another value (4, 4) [m]."""
        self._values[self.edges[name]] = np.array(parent_T_child, dtype=float)

    def reset(self, name: str) -> None:
        """Go back to the value at the start."""
        edge = self.edges[name]
        self._values[edge] = self._initial[edge]

    def start_from(self, values: Mapping[Edge, np.ndarray]) -> List[str]:
        """Take values from elsewhere, to which resetting shall return; return names without one.

        The description has others, so that they are not saved yet.
        """
        for edge in self._initial:
            if edge in values:
                self._values[edge] = self._initial[edge] = np.array(values[edge], dtype=float)
        return [name for name, edge in self.edges.items() if edge not in values]

    def fixed_transforms(self) -> Dict[Edge, np.ndarray]:
        """Return every fixed edge of the description, those that were edited among them."""
        return {**self._others, **self._values}

    @property
    def unsaved(self) -> List[str]:
        """Names of what is elsewhere than in what was saved, or in the description."""
        return [
            name
            for name, edge in self.edges.items()
            if not np.allclose(self._values[edge], self._saved[edge], rtol=0.0, atol=_SAME)
        ]

    def keep_unsaved(self, path: Path) -> Optional[Path]:
        """Write what was moved and not saved beside the file; return where, None if it was nothing.

        Args:
            path: what would have been saved; it stays as it is.

        Raises:
            AtomError: it cannot be written.
        """
        if not self.unsaved:
            return None
        beside = path.with_name(UNSAVED + path.name)
        self.save(beside)
        return beside

    def save(self, path: Path) -> Saved:
        """Write the description with the values as they are.

        Where the macros of a xacro cannot be kept, the file that is replaced stays as FILE.orig.

        Raises:
            DescriptionError: the description cannot be written so.
            OutputError: the file cannot be written.
        """
        before = path.read_text(encoding="utf-8") if path.is_file() else None
        described = self._description.robot.transforms()
        changed = {
            edge: value
            for edge, value in self._values.items()
            if not np.allclose(value, described[edge], rtol=0.0, atol=_SAME)
        }
        report = write_calibrated_description(self._description, changed, path)
        self._saved = dict(self._values)
        original = path.with_name(path.name + _ORIGINAL)
        if before is None or not report.flattened or original.exists():
            return Saved(report, original if report.flattened and original.exists() else None)
        write_text_atomically(original, before)
        return Saved(report, original)


class PlacedSensors(NamedTuple):
    """Where the data alone put the sensors.

    Attributes:
        values: ``parent_T_child`` (4, 4) [m] by edge.
        remarks: which sensors the data do not place.
    """

    values: Dict[Edge, np.ndarray]
    remarks: Tuple[str, ...]


def values_from_dataset(path: Path) -> PlacedSensors:
    """Return where the data alone put the sensors.

    Those that are held, and those that the data do not place, keep the dataset's value.

    Raises:
        AtomError: the dataset cannot be read, or its boards do not tie the sensors together.
    """
    dataset = read_dataset(path)
    placed = sensors_from_data(dataset)
    edges = {edge: placed.dataset.first_value(edge) for edge in dataset.sensor_edges}
    return PlacedSensors(edges, placed.remarks)


def _editable(
    config: CalibrationConfig, description: Description
) -> Tuple[Dict[str, Edge], List[str]]:
    """Return the edges to edit by name, and remarks on those that cannot be."""
    edges: Dict[str, Edge] = {}
    remarks: List[str] = []
    anchored = config.sensors.get(config.anchored_sensor or "")
    held = anchored.edge if anchored else None
    for name, edge in config.estimated_edges:
        joint = description.robot.joint_between(*edge)
        if edge == held:
            continue
        if joint is None or joint.type != FIXED:
            kind = "no joint" if joint is None else f"a {joint.type} joint"
            remarks.append(f"'{name}': its edge {edge} is {kind} of the description")
        else:
            edges[name] = edge
    return edges, remarks
