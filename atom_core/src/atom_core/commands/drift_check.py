"""Has the rig moved since it was calibrated? What `check --against` asks new boards."""

from __future__ import annotations

from pathlib import Path
from typing import Mapping, Optional

import numpy as np

from atom_core.errors import CalibrationError, DescriptionError
from atom_core.evaluation.drift import Drift, drift
from atom_core.evaluation.known_errors import known_of
from atom_core.evaluation.spreads import spreads_of
from atom_core.io.calibration_json import (
    StoredCalibration,
    calibration_file,
    read_calibration,
)
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge
from atom_core.report.verdict import names_in_words
from atom_core.solvers.base import CONVERGED


def calibration_of(description: Path, named: Optional[Path]) -> Optional[Path]:
    """Return the ``calibration.json`` that tells how exactly a description is known; None: none.

    Args:
        description: a URDF; `calibrate` writes it beside its other results.
        named: by the user.
    """
    if named is not None:
        return calibration_file(named)
    beside = calibration_file(description)
    return beside if beside.is_file() else None


def drift_of(
    dataset: Dataset, described: Mapping[Edge, np.ndarray], calibration: Path, description: Path
) -> Drift:
    """Ask new boards whether the rig stands as described.

    Args:
        dataset: the new boards.
        described: edges of the description.
        calibration: tells how exactly they are known.
        description: for messages.

    Raises:
        AtomError: the description lacks a sensor, or the boards cannot tell.
    """
    stored = read_calibration(calibration)
    for sensor in dataset.sensors.values():
        if sensor.edge not in described:
            raise DescriptionError(
                f"{description}: has no joint from '{sensor.edge.parent}' to "
                f"'{sensor.edge.child}', on which sensor '{sensor.name}' stands; give the "
                f"description that the rig was calibrated with, or leave the sensor out: "
                f"-ssf '!{sensor.name}'"
            )
    _refuse_untrusted(stored)
    known = known_of(stored, dataset)
    return drift(known.dataset, described, spreads_of(stored.edges), known.errors, known.moving)


def _refuse_untrusted(stored: StoredCalibration) -> None:
    """Refuse a calibration whose sigmas do not tell how far a sensor may seem to have moved."""
    if stored.status != CONVERGED:
        raise CalibrationError(
            f"{stored.path}: this calibration is {stored.status} ({stored.message}); what it says "
            f"of its certainty does not hold, so that whether the rig has moved cannot be told; "
            f"settle that first"
        )
    if stored.joints:
        joints = names_in_words(list(stored.joints))
        raise CalibrationError(
            f"{stored.path}: here joints were estimated, too ({joints}), "
            f"and new boards are read without that, which looks like a move; calibrate the new "
            f"boards with the same options, and compare the results: evaluate --compare OLD NEW"
        )
