"""Sensors on one another or on a head that tilts, as drones, Baxter and others have them."""

from __future__ import annotations

from dataclasses import replace
from typing import Sequence

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE, Dataset, pose
from atom_core.model.transforms import Edge


def on_another(dataset: Dataset, name: str, carrier: str) -> Dataset:
    """Return the dataset with a sensor's edge below the data frame of another one.

    Nothing moves by that: the edge has the value with which all frames stay where they are.

    Args:
        dataset: both stand still to each other.
        name: the sensor that is hung elsewhere.
        carrier: the sensor that carries it.
    """
    sensor, graph = dataset.sensors[name], dataset.graph
    old, new = sensor.edge, Edge(dataset.sensors[carrier].frame, sensor.edge.child)
    collections = {}
    for key, collection in dataset.collections.items():
        others = {edge: value for edge, value in collection.transforms.items() if edge != old}
        transforms = {**others, new: pose(collection, graph, *new)}
        collections[key] = replace(collection, transforms=transforms)
    types = {new if edge == old else edge: kind for edge, kind in dataset.edge_types.items()}
    entry = replace(dataset.config.sensors[name], parent_link=new.parent)
    config = replace(dataset.config, sensors={**dataset.config.sensors, name: entry})
    sensors = {**dataset.sensors, name: replace(sensor, edge=new)}
    return replace(
        dataset, config=config, sensors=sensors, collections=collections, edge_types=types
    )


def on_tilting_head(dataset: Dataset, name: str, turns_rad: Sequence[float]) -> Dataset:
    """Return the dataset with a joint between a sensor's calibrated edge and its data frame.

    What moves the calibrated edge makes up for it, so that the data are those of this rig, too.

    Args:
        dataset: of a sensor on an arm.
        name: of this sensor.
        turns_rad: of the joint, about its z axis, for each collection.
    """
    edge, graph = dataset.sensors[name].edge, dataset.graph
    arm = next(e for e in dataset.edge_types if e.child == edge.parent)
    joint = graph.chain(edge.child, dataset.sensors[name].frame)[0].edge
    changes = {}
    for (key, collection), turn_rad in zip(dataset.collections.items(), turns_rad):
        value = collection.transforms[joint]
        turned = value @ se3.from_rpy(np.zeros(3), np.array([0.0, 0.0, turn_rad]))
        hand_T_old = collection.transforms[edge] @ value
        hand_T_new = collection.transforms[edge] @ turned
        base_T_hand = collection.transforms[arm] @ hand_T_old @ se3.inverse(hand_T_new)
        changes[key] = {joint: turned, arm: base_T_hand}
    return replace(
        dataset.with_transforms(changes), edge_types={**dataset.edge_types, joint: MULTIPLE}
    )
