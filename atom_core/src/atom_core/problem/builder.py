"""From a dataset to a problem: which edges are free, and every detection's chain and rows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Dict, FrozenSet, List, Mapping, Optional, Sequence, Set, Tuple, Union

import numpy as np

from atom_core.errors import CalibrationError, DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE, Dataset, board_edge
from atom_core.model.joints import POSITION_BIAS, JointSelection
from atom_core.model.pattern import BoardKey
from atom_core.model.transforms import Chain, Edge, FrameGraph, Step
from atom_core.problem.blocks import (
    ADDITIONAL_TF,
    JOINT,
    PATTERN,
    SENSOR,
    ParameterBlock,
    PoseBlock,
    PriorPoseBlock,
)
from atom_core.problem.camera_blocks import ExpectedCamera, camera_blocks
from atom_core.problem.joint_blocks import (
    ORIGIN_PARAMETERS,
    JointBiasBlock,
    JointBlock,
    JointOriginBlock,
)
from atom_core.problem.measurements import Measurement
from atom_core.problem.moving_blocks import MOVING, MovingBlock, MovingPart
from atom_core.problem.parameters import Parameters
from atom_core.problem.priors import Prior
from atom_core.problem.problem import PoseChains, Problem
from atom_core.problem.residuals import ResidualBlock


@dataclass(frozen=True)
class FreeEdges:
    """What is estimated and what is held.

    Attributes:
        anchored_sensors: sensors whose edge stays as it is.
        additional_tfs: further edges to estimate, by name.
        anchor_patterns: True to hold every board where it is.
        joints: parameters to estimate, by joint.
        intrinsics: names of the intrinsics to estimate, by camera.
        expected_cameras: near which they are expected, by camera; none: anywhere.
        moving: edges whose pose in a collection is off from what the dataset says.
        priors: what the user knows beforehand of edges, those of joints among them.
        held_first: additional tfs that stay in the first collection whose detections pass them.
    """

    anchored_sensors: Tuple[str, ...] = ()
    additional_tfs: Mapping[str, Edge] = field(default_factory=dict)
    anchor_patterns: bool = False
    joints: JointSelection = field(default_factory=dict)
    intrinsics: Mapping[str, Tuple[str, ...]] = field(default_factory=dict)
    expected_cameras: Mapping[str, ExpectedCamera] = field(default_factory=dict)
    moving: Mapping[Edge, MovingPart] = field(default_factory=dict)
    priors: Mapping[Edge, Prior] = field(default_factory=dict)
    held_first: FrozenSet[Edge] = frozenset()

    def without_intrinsics(self) -> FreeEdges:
        """Return the same with all intrinsics held."""
        return replace(self, intrinsics={})

    def held_edges(self, dataset: Dataset) -> FrozenSet[Edge]:
        """Return the sensor edges that stay; one that sensors share stays for all of them."""
        return frozenset(dataset.sensors[name].edge for name in self.anchored_sensors)


def check_edges(dataset: Dataset, free: FreeEdges) -> None:
    """Refuse a selected edge that does not stand where it must.

    Raises:
        CalibrationError: naming the sensor or additional tf, the edge and the chain.
        DatasetError: a collection lacks an edge on the way to a sensor that saw a board in it.
    """
    graph = dataset.graph
    chains = {s.name: graph.chain(dataset.world, s.frame) for s in dataset.sensors.values()}
    for sensor in dataset.sensors.values():
        chain = chains[sensor.name]
        on_chain = [step.edge for step in chain]
        if sensor.edge not in on_chain:
            frames = " -> ".join([dataset.world] + [_far_frame(step) for step in chain])
            turned = Edge(sensor.edge.child, sensor.edge.parent) in on_chain
            remedy = "exchange" if turned else "correct"
            raise CalibrationError(
                f"sensor '{sensor.name}': edge '{sensor.edge}' is not on its chain {frames}; "
                f"{remedy} parent_link and child_link in the configuration"
            )
    _check_whole(dataset, chains)
    known = {edge for c in dataset.collections.values() for edge in c.transforms}
    for name, edge in free.additional_tfs.items():
        if edge not in known:
            raise CalibrationError(
                f"additional_tfs '{name}': edge '{edge}' is in no collection's transforms"
            )


def _check_whole(dataset: Dataset, chains: Mapping[str, Chain]) -> None:
    for key, _ in dataset.detections():
        there = dataset.collections[key.collection].transforms
        for step in chains[key.sensor]:
            if step.edge not in there:
                raise DatasetError(
                    f"collection {key.collection}: transform '{step.edge}', on the way from "
                    f"'{dataset.world}' to sensor '{key.sensor}', is absent; leave the collection "
                    f"out with -csf, or the sensor with -ssf"
                )


def _far_frame(step: Step) -> str:
    return step.edge.parent if step.inverted else step.edge.child


def build_problem(
    dataset: Dataset,
    measurements: Sequence[Measurement],
    boards: Mapping[BoardKey, np.ndarray],
    free: FreeEdges,
) -> Problem:
    """Return the problem of a dataset.

    Args:
        dataset: its transforms are the initial values, and the values of what is held.
        measurements: the detections to use; each board of theirs stands in ``boards``.
        boards: initial (or, with ``anchor_patterns``, held) ``parent_T_pattern``.
        free: what is estimated.
    """
    placed = with_boards(dataset, boards)
    used = {m.key.collection for m in measurements}
    first = next(iter(sorted(used))) if used else ""
    parameters = Parameters(
        _sensor_blocks(placed, measurements, free, first)
        + _additional_blocks(placed, measurements, free)
        + _joint_blocks(placed, free)
        + _intrinsics_blocks(placed, measurements, free)
        + _moving_blocks(placed, free, sorted(used))
        + _pattern_blocks(placed, boards, measurements, free)
    )
    ordered = sorted(measurements, key=lambda m: (m.key.sensor, m.key.collection, m.key.pattern))
    ends = [
        (
            m.key.collection,
            dataset.sensors[m.key.sensor].frame,
            dataset.patterns[m.key.pattern].frame,
        )
        for m in ordered
    ]
    chains = pose_chains(placed, ends, parameters)
    blocks = _residual_blocks(ordered, dataset)
    return Problem(parameters, tuple(m.key for m in ordered), chains, tuple(blocks))


def with_boards(dataset: Dataset, boards: Mapping[BoardKey, np.ndarray]) -> Dataset:
    """Return the dataset with the boards' ``parent_T_pattern`` in its transforms."""
    changes: Dict[str, Dict[Edge, np.ndarray]] = {key: {} for key in dataset.collections}
    for (pattern, collection), pose in boards.items():
        edge = board_edge(dataset.patterns[pattern])
        for key in dataset.collections if collection is None else [collection]:
            changes[key][edge] = pose
    return dataset.with_transforms(changes)


def _sensor_blocks(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges, first: str
) -> List[ParameterBlock]:
    seen = {m.key.sensor for m in measurements}
    held = free.held_edges(dataset)
    names: Dict[Edge, List[str]] = {}
    for sensor in dataset.sensors.values():
        if sensor.name in seen and sensor.edge not in held:
            names.setdefault(sensor.edge, []).append(sensor.name)
    return [
        _pose_block(dataset, free, (edge, SENSOR, None, tuple(sharing)), first)
        for edge, sharing in names.items()
    ]


def _pose_block(
    dataset: Dataset, free: FreeEdges, owner: Tuple[Edge, str, Optional[str], Any], key: str
) -> PoseBlock:
    """Return the block of an edge, from its value in a collection, with what is known of it."""
    value, prior = _value(dataset, key, owner[0]), free.priors.get(owner[0])
    if prior is None:
        return PoseBlock(*owner, value)
    sigmas = prior.sigma_m, prior.sigma_rad
    return PriorPoseBlock(*owner, value, prior.poses.get(key, value), *sigmas, prior)


def _additional_blocks(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> List[ParameterBlock]:
    collections = sorted({m.key.collection for m in measurements})
    blocks: List[ParameterBlock] = []
    held, sensor_edges = free.held_edges(dataset), dataset.sensor_edges
    for name, edge in free.additional_tfs.items():
        if edge in held or edge in sensor_edges:
            continue
        if dataset.edge_types.get(edge) == MULTIPLE:
            first = _first_to_pass(dataset, measurements, edge) if edge in free.held_first else None
            blocks += [
                _pose_block(dataset, free, (edge, ADDITIONAL_TF, key, (name,)), key)
                for key in collections
                if key != first
            ]
        elif collections:
            owner = (edge, ADDITIONAL_TF, None, (name,))
            blocks.append(_pose_block(dataset, free, owner, collections[0]))
    return blocks


def _first_to_pass(
    dataset: Dataset, measurements: Sequence[Measurement], edge: Edge
) -> Optional[str]:
    """Return the first collection of which a detection's chain passes an edge."""
    for m in sorted(measurements, key=lambda m: m.key.collection):
        ends = dataset.sensors[m.key.sensor].frame, dataset.patterns[m.key.pattern].frame
        if any(step.edge == edge for step in dataset.graph.chain(*ends)):
            return m.key.collection
    return None


def _joint_blocks(dataset: Dataset, free: FreeEdges) -> List[ParameterBlock]:
    blocks: List[ParameterBlock] = []
    for name, selected in free.joints.items():
        joint = dataset.joint(name)
        values, prior = joint.parameters, free.priors.get(joint.edge)
        owner = (joint.edge, JOINT, None, (name,))
        chosen = np.array([parameter in selected for parameter in ORIGIN_PARAMETERS])
        if np.any(chosen):
            initial = np.array([values[parameter] for parameter in ORIGIN_PARAMETERS])
            blocks.append(JointOriginBlock(*owner, initial, chosen, prior))
        if POSITION_BIAS in selected:
            bias = values[POSITION_BIAS]
            blocks.append(JointBiasBlock(*owner, joint.axis, joint.is_prismatic, bias, prior))
    return blocks


def _intrinsics_blocks(
    dataset: Dataset, measurements: Sequence[Measurement], free: FreeEdges
) -> List[ParameterBlock]:
    seen = {m.key.sensor for m in measurements}
    blocks: List[ParameterBlock] = []
    for name, estimated in free.intrinsics.items():
        sensor = dataset.sensors[name]
        if sensor.camera is not None and name in seen:
            expected = free.expected_cameras.get(name)
            blocks += camera_blocks(name, sensor.edge, sensor.camera, estimated, expected)
    return blocks


def _moving_blocks(
    dataset: Dataset, free: FreeEdges, collections: Sequence[str]
) -> List[ParameterBlock]:
    blocks: List[ParameterBlock] = []
    for edge, part in free.moving.items():
        for key in collections:
            if key in part.given:
                owner = (edge, MOVING, key, (edge.child,))
                value = _value(dataset, key, edge)
                blocks.append(MovingBlock(*owner, value, part.given[key], *part.sigmas(key)))
    return blocks


def _pattern_blocks(
    dataset: Dataset,
    boards: Mapping[BoardKey, np.ndarray],
    measurements: Sequence[Measurement],
    free: FreeEdges,
) -> List[ParameterBlock]:
    if free.anchor_patterns:
        return []
    seen: Set[BoardKey] = {(m.key.pattern, m.key.collection) for m in measurements}
    seen |= {(pattern, None) for pattern, _ in seen}
    blocks: List[ParameterBlock] = []
    for (pattern, collection), pose in boards.items():
        if (pattern, collection) not in seen:
            continue
        owner = (board_edge(dataset.patterns[pattern]), PATTERN, collection, (pattern,))
        prior = free.priors.get(owner[0])
        if prior is None:
            blocks.append(PoseBlock(*owner, pose))
        else:  # of a fixed board, which is described alike in all collections
            given = next(iter(prior.poses.values()))
            sigmas = prior.sigma_m, prior.sigma_rad
            blocks.append(PriorPoseBlock(*owner, pose, given, *sigmas, prior))
    return blocks


def _value(dataset: Dataset, collection: str, edge: Edge) -> np.ndarray:
    transforms = dataset.collections[collection].transforms
    if edge not in transforms:
        raise CalibrationError(f"collection {collection} lacks the transform '{edge}'")
    return transforms[edge]


def pose_chains(
    dataset: Dataset, ends: Sequence[Tuple[str, str, str]], parameters: Parameters
) -> PoseChains:
    """Return the chains between frames.

    Args:
        dataset: its transforms are the values of what is no parameter.
        ends: (collection, target frame, source frame) of each chain.
        parameters: what is estimated.
    """
    graph = dataset.graph
    factored = [_factor(dataset, graph, *end, parameters) for end in ends]
    depth = max([len(blocks) for _, blocks, _ in factored] + [0])
    count = len(factored)
    constants = np.tile(np.eye(4), (count, depth + 1, 1, 1))
    block = np.full((count, depth), -1)
    inverted = np.zeros((count, depth), dtype=bool)
    for i, (matrices, blocks, turned) in enumerate(factored):
        constants[i, : len(matrices)] = matrices
        block[i, : len(blocks)] = blocks
        inverted[i, : len(turned)] = turned
    return PoseChains(constants, block, inverted)


def _factor(
    dataset: Dataset,
    graph: FrameGraph,
    collection: str,
    target: str,
    source: str,
    parameters: Parameters,
) -> Tuple[List[np.ndarray], List[int], List[bool]]:
    """Return constants, block indices and inversions of ``target_T_source``."""
    matrices: List[np.ndarray] = [np.eye(4)]
    blocks: List[int] = []
    turned: List[bool] = []
    for edge, inverted in graph.chain(target, source):
        factors = _factors(dataset, collection, edge, parameters)
        for factor in reversed(factors) if inverted else factors:
            if isinstance(factor, np.ndarray):
                matrices[-1] = matrices[-1] @ (se3.inverse(factor) if inverted else factor)
                continue
            blocks.append(factor)
            turned.append(inverted)
            matrices.append(np.eye(4))
    return matrices, blocks, turned


def _factors(
    dataset: Dataset, collection: str, edge: Edge, parameters: Parameters
) -> List[Union[int, np.ndarray]]:
    """Return what an edge is made of: indices of blocks, and matrices that are held."""
    indices = parameters.find(edge, collection)
    if not indices:
        return [_value(dataset, collection, edge)]
    by_index = {i: parameters.blocks[i] for i in indices}
    joints = {type(block): i for i, block in by_index.items() if isinstance(block, JointBlock)}
    if not joints:
        return list(indices)
    name = by_index[indices[0]].names[0]
    joint = dataset.collections[collection].joints[name]
    origin: Union[int, np.ndarray] = joints.get(JointOriginBlock, joint.origin)
    bias: Union[int, np.ndarray]
    bias = joints.get(JointBiasBlock, joint.motion(joint.parameters[POSITION_BIAS]))
    return [origin, bias, joint.motion(joint.position)]


def _residual_blocks(measurements: Sequence[Measurement], dataset: Dataset) -> List[ResidualBlock]:
    by_sensor: Dict[str, List[Tuple[int, Measurement]]] = {}
    for i, m in enumerate(measurements):
        by_sensor.setdefault(m.key.sensor, []).append((i, m))
    blocks: List[ResidualBlock] = []
    for name, items in by_sensor.items():
        sensor = dataset.sensors[name]
        blocks += sensor.kind.residual_blocks(sensor, items)
    return blocks
