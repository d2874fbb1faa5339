"""Does a configuration fit its bag and its description? Every problem is told, with its line."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, replace
from typing import (
    Callable,
    Dict,
    List,
    Mapping,
    Optional,
    Set,
    Tuple,
    Union,
)

import numpy as np

from atom_calibration.configure.bag_contents import bag_edges, bag_joints
from atom_calibration.configure.tree import MULTIPLE, TransformGraph
from atom_calibration.messages.clouds import POINT_CLOUD
from atom_calibration.messages.headers import frame_name
from atom_calibration.modalities.table import is_labeled, modality_of, ros_modality
from atom_calibration.runtime.graph_names import check_graph_names
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.readable import why_unreadable
from atom_calibration.sources.rig import sensor_from_bag
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.io.urdf import Description
from atom_core.model.config import CalibrationConfig, EdgeConfig, SensorConfig
from atom_core.model.config_section import KeyPath
from atom_core.model.robot import CONTINUOUS, FIXED, PRISMATIC, REVOLUTE, RobotDescription
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

Locate = Callable[[KeyPath], str]

_NO_NAME_OF_ROS = re.compile(r"[.-]")
_CALIBRATED_JOINTS = (REVOLUTE, CONTINUOUS, PRISMATIC)
_SAME_M, _SAME_RAD = 1e-4, 1e-4  # between description and bag; more is told
_LISTED = 8


@dataclass(frozen=True)
class BagFacts:
    """What configuring needs to know of a bag.

    Attributes:
        sensors: those with labels, by name.
        data_topics: where the data of every sensor are, compressed ones by their full name.
        modalities: of every sensor.
        edges: kind, fixed or multiple, of the edges of /tf_static and /tf.
        fixed: ``parent_T_child`` (4, 4) of those of /tf_static, and of those of /tf that stand
            still in what is looked at [m].
        joints: by topic, the names in /joint_states and in other topics with positions.
        robot: of the description.
    """

    sensors: Mapping[str, Sensor]
    data_topics: Mapping[str, str]
    modalities: Mapping[str, Optional[str]]
    edges: Mapping[Edge, str]
    fixed: Mapping[Edge, np.ndarray]
    joints: Mapping[str, Set[str]]
    robot: Optional[RobotDescription] = None

    @property
    def joint_names(self) -> Set[str]:
        """The joints whose positions the bag has, on any topic."""
        return set().union(*self.joints.values())


@dataclass
class Findings:
    """Problems, which forbid going on, and warnings; lines with their place."""

    locate: Locate
    problems: List[str]
    warnings: List[str]

    def problem(self, path: KeyPath, text: str) -> None:
        """Note what is wrong with a value."""
        self.problems.append(f"{self.locate(path)}: {'.'.join(path)} {text}")

    def warn(self, path: KeyPath, text: str) -> None:
        """Note what is probably not meant."""
        self.warnings.append(f"{self.locate(path)}: {'.'.join(path)} {text}")


def bag_facts(
    config: CalibrationConfig,
    bag: BagReader,
    description: Optional[Description],
    findings: Findings,
) -> BagFacts:
    """Read what is needed of a bag; topics and frames that do not fit are problems."""
    sensors: Dict[str, Sensor] = {}
    topics: Dict[str, str] = {}
    modalities: Dict[str, Optional[str]] = {}
    for name, entry in config.sensors.items():
        path = ("sensors", name)
        try:
            topic, sensor = sensor_from_bag(name, entry, bag)
            frame_id = frame_name(bag.first(topic).header.frame_id)
            unreadable = None if sensor is None else why_unreadable(bag, topic, sensor)
        except AtomError as error:
            findings.problem((*path, "topic_name"), f"does not fit the bag: {error}")
            continue
        if unreadable is not None:
            key = "topic_name" if entry.modality else "modality"
            findings.problem((*path, key), f"does not fit the data in the bag: {unreadable}")
        topics[name] = topic
        modalities[name] = modality_of(entry, bag.types[topic])
        if sensor is None:
            findings.warn(path, f"({bag.types[topic]}) is shown but not calibrated: no labels")
        else:
            sensors[name] = sensor
        _warn_of_display(path, topic, bag.types[topic], modalities[name], findings)
        if frame_id != entry.link:
            findings.problem(
                (*path, "link"),
                f"is '{entry.link}', but the data of {topic} in {bag.path} are in frame "
                f"'{frame_id}' (header.frame_id); write that, or correct topic_name",
            )
    awaited = {} if description is None else _needed_joints(config, description)
    joints = bag_joints(bag, set(awaited))
    told = set().union(*joints.values())
    missed = {edge for name, edge in awaited.items() if name not in told}
    edges, fixed = bag_edges(bag, missed, findings.warnings.append)
    # As a static_transform_publisher of tf1 repeats a mount.
    edges.update({s.edge: FIXED for s in config.sensors.values() if s.edge in fixed})
    robot = None if description is None else description.robot
    return BagFacts(sensors, topics, modalities, edges, fixed, joints, robot)


def _warn_of_display(
    path: KeyPath, topic: str, kind: str, modality: Optional[str], findings: Findings
) -> None:
    """Tell what RViz cannot show of a topic with messages of a kind."""
    if _NO_NAME_OF_ROS.search(topic):
        findings.warn(
            (*path, "topic_name"),
            "has '-' or '.', which RViz and every C++ node refuse; remap it to be shown (it "
            "is labeled all the same)",
        )
    if modality is None or not is_labeled(modality):
        return
    if ros_modality(modality).display == "cloud" and kind != POINT_CLOUD:
        findings.warn(
            (*path, "topic_name"),
            f"carries {kind}, which is labeled, and which RViz cannot show; the "
            f"driver's PointCloud2 (xfer_format 0) it can",
        )


def check_rig(
    config: CalibrationConfig, facts: BagFacts, description: Description, findings: Findings
) -> TransformGraph:
    """Compare a configuration with the transforms of its description and its bag."""
    tree = TransformGraph(description.robot, facts.edges)
    if config.world_link not in tree.frames:
        findings.problem(("world_link",), _unknown(config.world_link, tree))
    for name, sensor in config.sensors.items():
        _check_sensor(config, ("sensors", name), sensor, tree, findings)
    for name, edge in config.additional_tfs.items():
        _check_edge(("additional_tfs", name), edge, tree, (FIXED, MULTIPLE), findings)
    try:
        check_graph_names([*config.sensors, *config.additional_tfs])
    except AtomError as error:
        findings.problem(("sensors",), f"have names that ROS cannot tell apart: {error}")
    _check_joints(config, facts, description, findings)
    _check_told(config, facts, description, tree, findings)
    for name, pattern in config.calibration_patterns.items():
        path = ("calibration_patterns", name)
        if pattern.parent_link not in tree.frames:
            findings.problem((*path, "parent_link"), _unknown(pattern.parent_link, tree))
        elif tree.chain(config.world_link, pattern.parent_link) is None:
            text = f"is '{pattern.parent_link}', which does not hang on '{config.world_link}'"
            findings.problem((*path, "parent_link"), f"{text}; use a frame that does")
        above = tree.above.get(pattern.link)
        if above is not None and above.edge.parent != pattern.parent_link:
            findings.problem(
                (*path, "link"),
                f"is '{pattern.link}', which hangs on '{above.edge.parent}' in the transforms; "
                f"make that the parent_link, or choose another name",
            )
    _compare_with_bag(description, facts, findings)
    return tree


def with_modalities(config: CalibrationConfig, facts: BagFacts) -> CalibrationConfig:
    """Return the configuration with the modalities that the bag's messages tell."""
    sensors = {
        name: replace(entry, modality=facts.modalities.get(name))
        for name, entry in config.sensors.items()
    }
    return replace(config, sensors=sensors)


def edges_from_bag(
    config: CalibrationConfig, facts: BagFacts, description: Description
) -> Dict[Edge, np.ndarray]:
    """Return what the bag's /tf_static says otherwise than the description of edges to estimate."""
    wanted = {edge for _, edge in config.estimated_edges}
    described = description.robot.transforms()
    return {
        edge: matrix
        for edge, matrix in facts.fixed.items()
        if edge in wanted and not np.allclose(matrix, described.get(edge, np.nan), 0.0, 1e-9)
    }


# --- the bag ----------------------------------------------------------------------------------


def _needed_joints(config: CalibrationConfig, description: Description) -> Dict[str, Edge]:
    """Return the joints whose motion is needed, by the name under which their position is told."""
    robot = description.robot
    needed = {name: robot.joints[name].edge for name in config.joints if name in robot.joints}
    frames = [entry.link for entry in config.sensors.values()]
    frames += [pattern.parent_link for pattern in config.calibration_patterns.values()]
    for frame in frames:
        joint = robot.joint_above(frame)
        while joint is not None:
            if joint.type != FIXED:
                needed[joint.moved_by] = joint.edge
            joint = robot.joint_above(joint.parent_link)
    return needed


# --- the transforms ---------------------------------------------------------------------------


def _check_sensor(
    config: CalibrationConfig,
    path: KeyPath,
    sensor: SensorConfig,
    tree: TransformGraph,
    findings: Findings,
) -> None:
    if sensor.link not in tree.frames:
        findings.problem((*path, "link"), _unknown(sensor.link, tree))
    if not _check_edge(path, sensor, tree, (FIXED,), findings) or sensor.link not in tree.frames:
        return
    chain = tree.chain(config.world_link, sensor.link)
    if chain is None:
        findings.problem(
            (*path, "link"),
            f"is '{sensor.link}', which does not hang on world_link '{config.world_link}'; record "
            f"the missing transforms, or correct world_link",
        )
    elif sensor.edge not in [item.edge for item in chain]:
        listed = ", ".join(str(item.edge) for item in chain)
        findings.problem(
            (*path, "child_link"),
            f"is '{sensor.child_link}', but the edge from parent_link to it is not between "
            f"'{config.world_link}' and '{sensor.link}' ({listed}); choose one of those",
        )
    elif tree.above[sensor.child_link].from_bag:
        findings.warn(
            (*path, "child_link"),
            f"is '{sensor.child_link}', which only the bag's transforms have: it gets no marker in "
            f"set_initial_estimate, and is not written to the description; estimate the edge above "
            f"it that is in the description, or put this joint into the description",
        )


def _check_edge(
    path: KeyPath,
    entry: Union[SensorConfig, EdgeConfig],
    tree: TransformGraph,
    kinds: Tuple[str, ...],
    findings: Findings,
) -> bool:
    """Check that an entry's edge is there, direct and of a kind that can be estimated."""
    unknown = [
        key for key in ("parent_link", "child_link") if getattr(entry, key) not in tree.frames
    ]
    for key in unknown:
        findings.problem((*path, key), _unknown(getattr(entry, key), tree))
    if unknown:
        return False
    found = tree.between(entry.parent_link, entry.child_link)
    if found is None:
        above = tree.above.get(entry.child_link)
        where = f"hangs on '{above.edge.parent}'" if above else "is the root of its tree"
        findings.problem(
            (*path, "parent_link"),
            f"is '{entry.parent_link}', but '{entry.child_link}' {where}; what is estimated is one "
            f"direct edge",
        )
    elif found.kind not in kinds:
        findings.problem(
            (*path, "child_link"),
            f"is '{entry.child_link}', which "
            + (f"a {found.kind} joint moves" if found.joint else "moves in the bag")
            + "; what is estimated here is fixed (parameters of a moving joint stand in `joints`)",
        )
    return found is not None and found.kind in kinds


def _check_joints(
    config: CalibrationConfig,
    facts: BagFacts,
    description: Description,
    findings: Findings,
) -> None:
    taken = {edge: name for name, edge in config.estimated_edges}
    for name in config.joints:
        path = ("joints", name)
        joint = description.robot.joints.get(name)
        if joint is None:
            moving = [j.name for j in description.robot.joints.values() if j.type != FIXED]
            findings.problem(
                path, f"is no joint of the description; moving ones are {_list(moving)}"
            )
        elif joint.type not in _CALIBRATED_JOINTS:
            findings.problem(
                path,
                f"is {joint.type}; use {', '.join(_CALIBRATED_JOINTS)} (fixed: additional_tfs)",
            )
        elif name not in facts.joint_names:
            findings.problem(
                path,
                f"is not in /joint_states of the bag, which has {_list(sorted(facts.joint_names))}",
            )
        elif joint.edge in taken:
            findings.problem(path, f"is the edge of '{taken[joint.edge]}' already; remove one")


def _check_told(
    config: CalibrationConfig,
    facts: BagFacts,
    description: Description,
    tree: TransformGraph,
    findings: Findings,
) -> None:
    """Tell where a bag leaves open how a joint stands on which a sensor or a board hangs."""
    hanging = {("sensors", name, "link"): entry.link for name, entry in config.sensors.items()}
    for name, pattern in config.calibration_patterns.items():
        hanging["calibration_patterns", name, "parent_link"] = pattern.parent_link
    for path, frame in hanging.items():
        for item in tree.chain(config.world_link, frame) or ():
            joint = description.robot.joints.get(item.joint or "")
            if joint is None or joint.type == FIXED or item.edge in facts.edges:
                continue
            if not {joint.name, joint.moved_by} & facts.joint_names:
                findings.problem(
                    path,
                    f"is '{frame}', which hangs on the {joint.type} joint '{joint.name}', and "
                    f"where that stands neither /joint_states nor /tf of the bag tells; record one",
                )


def _compare_with_bag(description: Description, facts: BagFacts, findings: Findings) -> None:
    """Tell where the bag was recorded with another description, or with no transforms at all."""
    if not facts.edges:
        findings.warn(
            ("bag_file",),
            "has neither /tf nor /tf_static: its transforms are those of the description"
            + (", moved by /joint_states" if facts.joint_names else ""),
        )
    differing: List[str] = []
    for edge, in_bag in facts.fixed.items():
        above = description.robot.joint_above(edge.child)
        if above is None or above.type != FIXED:
            continue
        if above.parent_link != edge.parent:
            differing.append(f"'{edge.child}' hangs on '{edge.parent}'")
            continue
        shift_m, turn_rad = se3.pose_difference(above.parent_T_child_at_zero, in_bag)
        if shift_m > _SAME_M or turn_rad > _SAME_RAD:
            differing.append(f"{edge} {1e3 * shift_m:.1f} mm, {np.degrees(turn_rad):.2f} deg")
    if differing:
        findings.warn(
            ("description_file",),
            f"has other fixed transforms than the bag: {_list(differing)}; the first guess is the "
            f"description's, or with --first_guess bag the bag's",
        )


def _unknown(frame: str, tree: TransformGraph) -> str:
    return (
        f"is '{frame}', which is neither in the description nor in the bag's transforms; frames: "
        f"{_list(_similar(frame, tree.frames))}"
    )


def _similar(frame: str, frames: List[str]) -> List[str]:
    """Return frames, those first that share the most with a name."""
    return sorted(frames, key=lambda f: -difflib.SequenceMatcher(None, frame, f).ratio())


def _list(words: List[str]) -> str:
    shown = ", ".join(words[:_LISTED]) + (" ..." if len(words) > _LISTED else "")
    return shown or "none"
