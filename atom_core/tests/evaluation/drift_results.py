"""What tests of drift make results and questions of, and put in the place of its parts."""

from types import SimpleNamespace

import numpy as np

from atom_core.evaluation import drift as module
from atom_core.evaluation.drift import Drift, EdgeDrift
from atom_core.evaluation.edge_errors import PoseError
from atom_core.model.dataset import Dataset
from atom_core.model.transforms import Edge

LIMIT = 20.0
ZERO = PoseError(np.zeros(3), np.zeros(3))


def edge_of(name):
    return Edge("base", name)


def edge_drift(name, moved=False, chi_square=1.0, **changes):
    figures = {"beyond_detections": False, "found_m": 0.001, "found_rad": 0.001, **changes}
    return EdgeDrift(edge_of(name), (name,), ZERO, chi_square, moved, **figures)


def result(reference, moved=(), still=(), **changes):
    edges = [edge_drift(name, True, 100.0) for name in moved]
    edges += [edge_drift(name, chi_square=square) for name, square in still]
    figures = {"limit": LIMIT, "boards": 3, "untold": (), **changes}
    return Drift((reference,), tuple(edges), **figures)


def rig_of(sensors, collections=None, **additional_tfs):
    """Return a dataset of sensors that have an edge, and additional tfs likewise, by name."""
    config = SimpleNamespace(additional_tfs=additional_tfs)
    return Dataset("new boards", config, sensors, {}, collections or {})


def question(*names, collections=("0", "1", "2"), spreads=None):
    sensors = {name: SimpleNamespace(name=name, edge=edge_of(name)) for name in names}
    standing = rig_of(sensors, dict.fromkeys(collections))
    return SimpleNamespace(
        standing=standing,
        spreads=spreads or {},
        options=lambda held: tuple(held),
        without_collection=lambda key: key,
    )


def moved_names(found):
    return [name for edge in found.moved for name in edge.sensors]


def replaced(monkeypatch, **functions):
    for name, function in functions.items():
        monkeypatch.setattr(module, name, function)
