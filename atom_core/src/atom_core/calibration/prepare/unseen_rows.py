"""Boards that are configured with rows of corners that they do not have."""

from __future__ import annotations

from typing import Dict, List

from atom_core.labeling.unseen_rows import REMEDY, SeenRows, seen_rows, unseen_rows_remark
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset
from atom_core.model.labels import RgbLabel


def unseen_rows(dataset: Dataset) -> List[Caveat]:
    """Return the boards whose last rows no picture shows; they concern all who see the board.

    Cameras lose nothing, since the corners that are found have the right numbers, but range
    sensors look for a border that is not there.
    """
    pictures: Dict[str, List[SeenRows]] = {}
    sensors: Dict[str, List[str]] = {}
    for key, label in dataset.detections():
        seers = sensors.setdefault(key.pattern, [])
        seers += [key.sensor] if key.sensor not in seers else []
        camera = dataset.sensors[key.sensor].camera
        if isinstance(label, RgbLabel) and camera is not None:
            seen = seen_rows(label, dataset.patterns[key.pattern], camera)
            pictures.setdefault(key.pattern, []).append(seen)
    caveats = []
    for name, seen_in in pictures.items():
        remark = unseen_rows_remark(dataset.patterns[name], seen_in)
        if remark is not None:
            caveats.append(Caveat(tuple(sensors[name]), remark, REMEDY))
    return caveats
