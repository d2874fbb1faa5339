"""The transform tree of a system: edges of its description, of its bag, and of its patterns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, Iterable, List, Mapping, Optional, Tuple

import networkx

from atom_core.model.config import CalibrationConfig
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import Edge

MULTIPLE = "multiple"  # ATOM's word for an edge that is not the same in all collections


@dataclass(frozen=True)
class TreeEdge:
    """One edge.

    Attributes:
        edge: parent and child.
        kind: type of the joint, or MULTIPLE.
        joint: name of the joint in the description; None when it is only in the bag.
        from_bag: only the bag's transforms have it.
    """

    edge: Edge
    kind: str
    joint: Optional[str] = None
    from_bag: bool = False


class TransformGraph:
    """Which frame hangs on which.

    Attributes:
        above: the edge that leads to a frame, by frame.
    """

    def __init__(self, robot: RobotDescription, bag_edges: Mapping[Edge, str]):
        """Join the edges of a description with those that only a bag has.

        Args:
            robot: the description.
            bag_edges: kind, FIXED or MULTIPLE, of the edges of /tf_static and /tf.
        """
        self.above: Dict[str, TreeEdge] = {}
        self._links = set(robot.links)
        for joint in robot.joints.values():
            self.above[joint.child_link] = TreeEdge(joint.edge, joint.type, joint.name)
        for edge, kind in bag_edges.items():
            if edge.child not in self.above:
                self.above[edge.child] = TreeEdge(edge, kind, from_bag=True)

    @property
    def frames(self) -> List[str]:
        """All frames, sorted."""
        parents = {edge.edge.parent for edge in self.above.values()}
        return sorted({*self.above, *parents, *self._links})

    def chain(self, ancestor: str, frame: str) -> Optional[List[TreeEdge]]:
        """Return the edges from an ancestor down to a frame; None when it is no ancestor."""
        edges: List[TreeEdge] = []
        visited = {frame}
        while frame != ancestor:
            edge = self.above.get(frame)
            if edge is None or edge.edge.parent in visited:
                return None
            edges.append(edge)
            frame = edge.edge.parent
            visited.add(frame)
        return edges[::-1]

    def between(self, parent: str, child: str) -> Optional[TreeEdge]:
        """Return the edge straight from a parent to a child, or None."""
        edge = self.above.get(child)
        return edge if edge is not None and edge.edge.parent == parent else None


def networkx_graph(config: CalibrationConfig, tree: TransformGraph) -> networkx.DiGraph:
    """Return the tree with everything that is estimated; attributes are named as ATOM's.

    Nodes that matter carry ``role``: world, sensor or pattern; edges that are estimated carry
    ``estimated``: the names of what they are estimated for.
    """
    graph = networkx.DiGraph()
    graph.add_nodes_from(tree.frames)
    estimated = _estimated(config)
    joints = {name: entry.params_to_calibrate for name, entry in config.joints.items()}
    for item in tree.above.values():
        names = estimated.get(item.edge, ())
        _add(graph, item.edge, item.kind, names, joints.get(item.joint or "", ()), item)
    for name, pattern in config.calibration_patterns.items():
        edge = Edge(pattern.parent_link, pattern.link)
        kind = FIXED if pattern.fixed else MULTIPLE
        _add(graph, edge, kind, (name,), (), TreeEdge(edge, kind))
        graph.nodes[pattern.link].update(role="pattern", names=[name])
    for name, sensor in config.sensors.items():
        node = graph.nodes[sensor.link]
        node.update(role="sensor", names=[*node.get("names", []), name])
    graph.nodes[config.world_link].setdefault("role", "world")
    return graph


def graph_document(graph: networkx.DiGraph) -> Dict[str, Any]:
    """Return the graph as node-link JSON, as ATOM's transforms_graph.json."""
    return {
        "directed": True,
        "multigraph": False,
        "graph": {},
        "nodes": [{"id": node, **attributes} for node, attributes in sorted(graph.nodes.items())],
        "links": [
            {"source": parent, "target": child, **attributes}
            for parent, child, attributes in sorted(graph.edges(data=True), key=lambda e: e[:2])
        ],
    }


def _estimated(config: CalibrationConfig) -> Dict[Edge, Tuple[str, ...]]:
    found: Dict[Edge, Tuple[str, ...]] = {}
    for name, edge in config.estimated_edges:
        found[edge] = (*found.get(edge, ()), name)
    return found


def _add(
    graph: networkx.DiGraph,
    edge: Edge,
    kind: str,
    names: Iterable[str],
    joint_parameters: Iterable[str],
    item: TreeEdge,
) -> None:
    graph.add_edge(
        edge.parent,
        edge.child,
        weight=1,
        type=kind,
        parent=edge.parent,
        child=edge.child,
        is_transformation_calibrated=bool(list(names)),
        estimated=list(names),
        joint_params_calibrated=list(joint_parameters),
        joint_name=item.joint,
        from_bag=item.from_bag,
    )
