"""The dataset under test: the test set's measurements with the train file's calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import Collection, Dict, List, Mapping, Optional, Sequence

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

_SAME = 1e-6  # entries of a matrix


def mixed_dataset(
    train: Dataset, test: Dataset, sensors: Optional[Collection[str]] = None
) -> Dataset:
    """Return the test set with the edges, joints and intrinsics that the train file estimated.

    Edges: of every sensor, and the configuration's additional tfs; an edge that has a value of
    its own in each collection stays the test's own: an additional tf of type ``multiple``, and a
    sensor's edge of that type which the train file did not estimate as one. The value is that of
    the first train collection which holds the edge. The boards are the test's own.

    Args:
        train: the calibrated dataset.
        test: the dataset to measure on.
        sensors: names of the sensors to compare; None: all.

    Raises:
        DatasetError: the two do not hold the same sensors, or the train file lacks an edge.
    """
    _check_same_sensors(train, test, sensors)
    mixed = test.with_transforms(dict.fromkeys(test.collections, calibrated_edges(train, test)))
    mixed = mixed.with_joint_parameters(calibrated_joints(train, test))
    shared = {
        name: replace(sensor, camera=train.sensors[name].camera)
        for name, sensor in test.sensors.items()
        if name in train.sensors and (sensors is None or name in sensors)
    }
    return replace(mixed, sensors=shared)


def calibrated_edges(train: Dataset, test: Dataset) -> Dict[Edge, np.ndarray]:
    """Return ``parent_T_child`` (4, 4) of the train file's estimated edges.

    Raises:
        DatasetError: an edge is in no collection of the train file.
    """
    values: Dict[Edge, np.ndarray] = {}
    of_sensors = test.sensor_edges
    for edge in _estimated(train, test):
        found = [c.transforms[edge] for c in train.collections.values() if edge in c.transforms]
        is_multiple = MULTIPLE in (train.edge_types.get(edge), test.edge_types.get(edge))
        # A sensor's edge is estimated as one, whatever its guess was in the collections.
        if is_multiple and (edge not in of_sensors or _differ(found)):
            continue
        if not found:
            raise DatasetError(f"{train.source}: transform '{edge}' is in no collection")
        values[edge] = found[0]
    return values


def not_measured(train: Dataset, test: Dataset) -> List[Edge]:
    """Return estimated edges that stay the test set's own: they have a value per collection."""
    measured = calibrated_edges(train, test)
    return [edge for edge in _estimated(train, test) if edge not in measured]


def calibrated_joints(train: Dataset, test: Dataset) -> Dict[str, Mapping[str, float]]:
    """Return the parameters of the joints whose description is another in the train file.

    Raises:
        DatasetError: a test collection does not know the position of such a joint.
    """
    changed: Dict[str, Mapping[str, float]] = {}
    for name, joint in train.joints.items():
        parameters = joint.parameters
        without = [key for key, c in test.collections.items() if name not in c.joints]
        if without and name in train.config.joints:
            raise DatasetError(
                f"{test.source}: collection {without[0]} has no position of joint '{name}', which "
                f"{train.source} calibrated; collect the test set with the same configuration"
            )
        if not without and any(
            c.joints[name].parameters != parameters for c in test.collections.values()
        ):
            changed[name] = parameters
    return changed


def _differ(values: Sequence[np.ndarray]) -> bool:
    return any(not np.allclose(value, values[0], rtol=0.0, atol=_SAME) for value in values)


def _estimated(train: Dataset, test: Dataset) -> List[Edge]:
    edges = [sensor.edge for name, sensor in train.sensors.items() if name in test.sensors]
    additional = [entry.edge for entry in train.config.additional_tfs.values()]
    return list(dict.fromkeys(edges + additional))


def _check_same_sensors(train: Dataset, test: Dataset, selected: Optional[Collection[str]]) -> None:
    for one, other in ((train, test), (test, train)):
        for name in one.sensors:
            if name not in other.sensors and (selected is None or name in selected):
                raise DatasetError(
                    f"{other.source}: sensor '{name}' of {one.source} is absent; give a train "
                    f"and a test set of the same rig, or leave it out with -ssf '!{name}'"
                )
    for name in test.sensors:
        if name in train.sensors:
            _check_same_place(name, train.sensors[name], test.sensors[name])


def _check_same_place(name: str, train: Sensor, test: Sensor) -> None:
    if train.modality != test.modality:
        raise DatasetError(
            f"sensor '{name}' is {train.modality} in the train file and {test.modality} in the "
            f"test file; give files of the same rig"
        )
    if train.edge != test.edge:
        raise DatasetError(
            f"sensor '{name}': the train file estimates edge '{train.edge}', the test file "
            f"'{test.edge}'; give files of the same configuration"
        )
    sizes = [f"{c.width} x {c.height}" for c in (train.camera, test.camera) if c is not None]
    if len(set(sizes)) > 1:
        raise DatasetError(
            f"sensor '{name}' has images of {sizes[0]} px in the train file and of {sizes[1]} px "
            f"in the test file; give recordings of one resolution"
        )
