"""Sensors and boards that a selection leaves out take along what nobody else can tell of."""

from __future__ import annotations

from typing import Container, Dict, Iterable, List, Set, Tuple

from atom_core.model.dataset import Dataset
from atom_core.model.joints import JointSelection
from atom_core.model.transforms import Edge

AdditionalTfs = Dict[str, Edge]


def without_those_of_others(
    dataset: Dataset, additional_tfs: AdditionalTfs, joints: JointSelection
) -> Tuple[AdditionalTfs, JointSelection]:
    """Return the additional tfs and joints on which more hangs than what was left out.

    What nothing at all hangs on stays: the configuration has it by mistake, and is told so.

    Args:
        dataset: reduced to what is selected; its configuration still names all.
        additional_tfs: edges to be estimated, by name.
        joints: parameters to be estimated, by joint.
    """
    left_out = _only_of_others(dataset)
    if not left_out:
        return additional_tfs, joints
    lost = {name for name, joint in dataset.joints.items() if joint.edge in left_out}
    return (
        {name: edge for name, edge in additional_tfs.items() if edge not in left_out},
        {name: wanted for name, wanted in joints.items() if name not in lost},
    )


def remarks_on_those_of_others(wanted: Iterable[str], estimated: Container[str]) -> List[str]:
    """Return a remark on each additional tf or joint, by name, that is held for that reason."""
    return [
        f"'{name}' is not estimated: what hangs on it is left out (-ssf, -psf)"
        for name in wanted
        if name not in estimated
    ]


def _only_of_others(dataset: Dataset) -> Set[Edge]:
    """Return the edges from the world to what is left out that lead to nothing that is used."""
    config = dataset.config
    others = [s.link for name, s in config.sensors.items() if name not in dataset.sensors]
    others += [
        p.parent_link
        for name, p in config.calibration_patterns.items()
        if name not in dataset.patterns
    ]
    used = [sensor.frame for sensor in dataset.sensors.values()]
    used += [pattern.frame for pattern in dataset.patterns.values()]
    return _ways(dataset, others) - _ways(dataset, used) if others else set()


def _ways(dataset: Dataset, frames: Iterable[str]) -> Set[Edge]:
    """Return the edges from the world to frames, of those that it is connected with."""
    graph = dataset.graph
    return {edge for frame in frames for edge in graph.edges_between(dataset.world, frame)}
