"""Sensors on one another, as the cameras of a drone or of Baxter's hands may be."""

from __future__ import annotations

from dataclasses import replace

from atom_core.model.dataset import Dataset, pose
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
