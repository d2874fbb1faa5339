"""Borders that were annotated beside a test set, for whatever evaluates on it."""

from __future__ import annotations

from pathlib import Path
from typing import Collection, List, Optional, Tuple

from atom_core.evaluation.annotation_check import misplaced_annotations, with_patterns
from atom_core.evaluation.observed import Borders
from atom_core.io.annotations import read_annotations
from atom_core.model.dataset import Dataset


def annotated_borders(
    path: Path, test: Dataset, sensors: Optional[Collection[str]] = None
) -> Tuple[Borders, List[str]]:
    """Return the borders in the images of some sensors, and a sentence for each that is in doubt.

    Between cameras no border is needed, so that none is read.

    Args:
        path: of the test set's file.
        test: what was read of it, with the selected patterns.
        sensors: that are evaluated; None: all.

    Raises:
        DatasetError: a file is malformed, or was drawn in images of another size.
    """
    chosen = {
        name: sensor for name, sensor in test.sensors.items() if sensors is None or name in sensors
    }
    if not any(sensor.kind.measures_range for sensor in chosen.values()):
        return {}, []
    read = read_annotations(path.parent, chosen, test.config.calibration_patterns)
    borders, told = with_patterns(test, read)
    return borders, [*told, *misplaced_annotations(test, borders)]
