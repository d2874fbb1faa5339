"""Robot descriptions: URDF and xacro files to the model, and calibrated origins back to the file.

Parsing is urdfdom's, expansion is xacro's: what ROS accepts is accepted here, and what is refused
is refused in the words of ROS.
"""

from __future__ import annotations

import os
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, Mapping, Optional, Tuple

import numpy as np

from atom_core import native
from atom_core.errors import ConfigError, DescriptionError, quoted
from atom_core.geometry import se3
from atom_core.io.atomic import write_text_atomically
from atom_core.io.paths import PackageResolver, PathLike, looked_for, resolve_path
from atom_core.io.urdf_text import OriginEdit, edit_origins
from atom_core.io.xacro_text import expand_xacro, needs_xacro
from atom_core.io.xml_text import xml_flaw
from atom_core.model.robot import (
    FIXED,
    Joint,
    JointLimits,
    JointMimic,
    RobotDescription,
    is_rigid,
)
from atom_core.model.transforms import Edge

__all__ = [
    "Description",
    "WriteReport",
    "parse_urdf",
    "read_description",
    "resolve_path",
    "write_calibrated_description",
]

_WRITTEN_TOLERANCE = 1e-9  # m and entries of rotations: what is read back must agree with
_UNCHANGED_TOLERANCE = 1e-12  # m and entries of rotations: below it the text stays as it was


@dataclass(frozen=True)
class Description:
    """A robot description as it stands in a file, and what it means.

    Attributes:
        path: the file.
        text: its text, as it is.
        urdf: the URDF that it makes: the text itself, or what xacro expands it to.
        robot: links and joints.
        is_xacro: whether it had to be expanded.
        warnings: remarks of xacro and urdfdom on an accepted file.
        xacro_arguments: the values of ``xacro:arg`` that it was expanded with.
        resolve_package: the resolver that found its packages; None for ROS's.
    """

    path: Path
    text: str
    urdf: str
    robot: RobotDescription
    is_xacro: bool
    warnings: Tuple[str, ...] = ()
    xacro_arguments: Mapping[str, str] = field(default_factory=dict)
    resolve_package: Optional[PackageResolver] = field(default=None, repr=False)


@dataclass(frozen=True)
class WriteReport:
    """What became of each value that was to be written into a description.

    Attributes:
        path: the file that was written.
        replaced: edges whose joint has a new origin.
        unchanged: edges whose origin had that value already (to 1e-12).
        missing: (edge, why) of those that could not be written; tell the user.
        missing_joints: (name, why) likewise, of joints given by name.
        flattened: the expanded URDF of a xacro was edited, so macros and formatting are gone.
        reason: why it was flattened, naming the joints; empty otherwise.
    """

    path: Path
    replaced: Tuple[Edge, ...]
    unchanged: Tuple[Edge, ...]
    missing: Tuple[Tuple[Edge, str], ...]
    missing_joints: Tuple[Tuple[str, str], ...]
    flattened: bool = False
    reason: str = ""


# ---------------------------------------------------------------------------------- reading


def read_description(
    path: PathLike,
    resolve_package: Optional[PackageResolver] = None,
    xacro_arguments: Optional[Mapping[str, str]] = None,
) -> Description:
    """Read a URDF or xacro file.

    Args:
        path: the file, also as package://, file:// or with variables; see `resolve_path`.
        resolve_package: folder of a package by name (raises LookupError), for ``$(find package)``;
            ROS's own when None.
        xacro_arguments: values of the file's ``xacro:arg`` by name.

    Raises:
        DescriptionError: the file is absent, xacro or urdfdom refuses it, or it is no tree; one
            line that names the file and what to do.
        NativeModuleError: the compiled module, which holds urdfdom, is not built.
    """
    path = _existing_or_resolved(path, resolve_package)
    arguments = dict(xacro_arguments or {})
    text = _read_text(path)
    is_xacro = needs_xacro(text, path)
    remarks: Tuple[str, ...] = ()
    urdf = text
    if is_xacro:
        urdf, remarks = expand_xacro(path, arguments, resolve_package)
    robot, more_remarks = _parse_file_text(urdf, path, is_xacro)
    return Description(
        path, text, urdf, robot, is_xacro, remarks + more_remarks, arguments, resolve_package
    )


def parse_urdf(urdf: str) -> Tuple[RobotDescription, Tuple[str, ...]]:
    """Return the robot of a URDF text, and the remarks of urdfdom on it.

    Raises:
        DescriptionError: urdfdom refuses the text, or the joints do not make one tree.
        NativeModuleError: the compiled module, which holds urdfdom, is not built.
    """
    core = native.require("Reading a robot description")
    try:
        parsed = core.parse_urdf(urdf)
    except core.UrdfError as error:
        raise DescriptionError(f"urdfdom refuses the description: {error}") from error
    joints = {item["name"]: _joint(item) for item in parsed["joints"]}
    robot = RobotDescription(parsed["name"], parsed["root_link"], tuple(parsed["links"]), joints)
    return robot, tuple(parsed["warnings"])


def _existing_or_resolved(path: PathLike, resolve_package: Optional[PackageResolver]) -> Path:
    if Path(path).exists():  # whatever its name looks like
        return Path(path)
    try:
        return resolve_path(path, resolve_package)
    except ConfigError as error:
        raise DescriptionError(f"robot description {path}: {error}") from error


def _read_text(path: Path) -> str:
    if path.exists() and not path.is_dir() and not path.is_file():
        raise DescriptionError(f"{path}: this is no file but a device or the like; give a URDF")
    try:
        return path.read_bytes().decode("utf-8")  # bytes: line ends must survive an edit
    except FileNotFoundError as error:
        raise DescriptionError(
            f"{path}: there is no such robot description{looked_for(path)}; mend the path or "
            f"create the file"
        ) from error
    except OSError as error:
        raise DescriptionError(
            f"{path}: the robot description cannot be read ({error.strerror}); give a readable file"
        ) from error
    except UnicodeDecodeError as error:
        raise DescriptionError(f"{path}: the text is not UTF-8; save it as UTF-8") from error


def _parse_file_text(
    urdf: str, path: Path, is_xacro: bool
) -> Tuple[RobotDescription, Tuple[str, ...]]:
    remedy = "mend the xacro (`xacro FILE` shows its URDF)" if is_xacro else "mend the file"
    flaw = xml_flaw(urdf)
    if flaw and flaw.is_too_deep:
        raise DescriptionError(f"{path}: {flaw.text}; {remedy}")
    try:
        parsed = parse_urdf(urdf)
    except DescriptionError as error:
        why = f" ({flaw.text})" if flaw else ""
        raise DescriptionError(f"{path}: {error}{why}; {remedy}") from error
    if flaw:  # urdfdom reads on, but nothing could be written into such a file
        raise DescriptionError(f"{path}: {flaw.text}; {remedy}")
    return parsed


def _joint(item: Mapping[str, Any]) -> Joint:
    has_axis = np.any(item["axis"]) or item["type"] != FIXED
    return Joint(
        name=item["name"],
        type=item["type"],
        parent_link=item["parent_link"],
        child_link=item["child_link"],
        parent_T_child_at_zero=item["parent_T_child_at_zero"],
        axis=item["axis"] if has_axis else np.array([1.0, 0.0, 0.0]),
        limits=JointLimits(**item["limits"]) if item["limits"] else None,
        mimic=JointMimic(**item["mimic"]) if item["mimic"] else None,
    )


# ---------------------------------------------------------------------------------- writing


@dataclass(frozen=True)
class _Origin:
    """The origin that a joint shall have."""

    joint: Joint
    parent_T_child: np.ndarray
    comment: Optional[str]

    @property
    def is_new(self) -> bool:
        before = self.joint.parent_T_child_at_zero
        return float(np.abs(self.parent_T_child - before).max()) > _UNCHANGED_TOLERANCE

    def as_edit(self) -> OriginEdit:
        if not self.is_new:
            return OriginEdit(None, None, self.comment)
        xyz, rpy = self.parent_T_child[:3, 3], se3.rpy_from_rotation(self.parent_T_child[:3, :3])
        return OriginEdit(xyz, rpy, self.comment)


def write_calibrated_description(
    description: Description,
    edges: Mapping[Edge, np.ndarray],
    output_path: PathLike,
    comments: Optional[Mapping[Edge, str]] = None,
    joint_origins: Optional[Mapping[str, np.ndarray]] = None,
) -> WriteReport:
    """Write the description with other joint origins.

    The original text is kept, byte by byte, except for the numbers of those origins. Only where a
    joint is made by a macro, the text does not work in the output's folder (includes by a
    relative path) or the output is not called .xacro, the expanded URDF is edited instead, and the
    report says so. What is written
    has been expanded and parsed again: it has the new values to 1e-9 and no other value changed.

    Args:
        description: what to start from.
        edges: ``parent_T_child`` (4, 4) [m] by edge: new origins of *fixed* joints.
        output_path: the file, replaced if it exists (ask the user before).
        comments: text to put as a comment beside the joint, by edge.
        joint_origins: ``parent_T_child`` at position zero (4, 4) by the name of the joint, which
            may be of any type: for joints whose origin was calibrated.

    Returns:
        What was replaced, and what is missing in the file.

    Raises:
        DescriptionError: the result does not read back as it should; nothing is written.
        OutputError: the file cannot be written.
        ValueError: a matrix is no rigid transform.
    """
    output_path = Path(output_path)
    joint_origins = joint_origins or {}
    missing_joints = tuple(
        (name, f"the robot '{description.robot.name}' has no joint '{name}'")
        for name in joint_origins
        if name not in description.robot.joints
    )
    wanted = _wanted_origins(description.robot, edges, joint_origins, comments or {})
    text, reason = _edited_text(description, wanted, output_path)
    write_text_atomically(output_path, text)
    return WriteReport(
        output_path,
        tuple(edge for edge, origin in wanted.items() if origin.is_new),
        tuple(edge for edge, origin in wanted.items() if not origin.is_new),
        _missing_edges(description.robot, edges),
        missing_joints,
        bool(reason),
        reason,
    )


def _missing_edges(
    robot: RobotDescription, edges: Mapping[Edge, np.ndarray]
) -> Tuple[Tuple[Edge, str], ...]:
    """Return the edges that cannot be written as the origin of a fixed joint, with the reason."""
    missing = []
    for edge in edges:
        joint = robot.joint_between(*edge)
        if joint is None:
            missing.append((edge, _why_no_joint(robot, edge)))
        elif joint.type != FIXED:
            reason = f"its joint '{joint.name}' is {joint.type} and moves the link by its position"
            missing.append((edge, reason))
    return tuple(missing)


def _why_no_joint(robot: RobotDescription, edge: Edge) -> str:
    for link in edge:
        if link not in robot.links:
            return f"the robot '{robot.name}' has no link '{link}'"
    if robot.joint_between(edge.child, edge.parent) is not None:
        return f"the joint goes the other way, from '{edge.child}' to '{edge.parent}'"
    above = robot.joint_above(edge.child)
    hangs = f"'{edge.child}' hangs on '{above.parent_link}'" if above else "the latter is the root"
    return f"no joint leads straight from '{edge.parent}' to '{edge.child}'; {hangs}"


def _wanted_origins(
    robot: RobotDescription,
    edges: Mapping[Edge, np.ndarray],
    joint_origins: Mapping[str, np.ndarray],
    comments: Mapping[Edge, str],
) -> Dict[Edge, _Origin]:
    """Return the origins to write, of edges and joints that the robot has."""
    wanted = {}
    for edge, matrix in edges.items():
        joint = robot.joint_between(*edge)
        if joint is not None and joint.type == FIXED:
            wanted[edge] = _Origin(joint, _made_rigid(matrix, str(edge)), comments.get(edge))
    for name, matrix in joint_origins.items():
        joint = robot.joints.get(name)
        if joint is not None:
            rigid = _made_rigid(matrix, name)
            wanted[joint.edge] = _Origin(joint, rigid, comments.get(joint.edge))
    return wanted


def _made_rigid(matrix: np.ndarray, name: str) -> np.ndarray:
    """Return the matrix with its rotation freed of rounding, which xyz and rpy cannot hold."""
    if not is_rigid(matrix):
        raise ValueError(f"the new origin of '{name}' is no rigid transform (4, 4)")
    matrix = np.asarray(matrix, dtype=float)
    quaternion = se3.quaternion_from_rotation(matrix[:3, :3])
    return se3.transform(se3.rotation_from_quaternion(quaternion), matrix[:3, 3])


def _edited_text(
    description: Description, wanted: Mapping[Edge, _Origin], output_path: Path
) -> Tuple[str, str]:
    """Return the text to write, and the reason why it is the expanded one (else empty)."""
    edits = {edge: origin.as_edit() for edge, origin in wanted.items()}
    text, not_literal = edit_origins(description.text, edits)
    if not description.is_xacro:
        if not_literal:
            raise _unwritable(description, f"{_names(wanted, not_literal)} cannot be located")
        _check_result(description, parse_urdf(text)[0], wanted)
        return text, ""
    if not_literal:
        verb = "is" if len(not_literal) == 1 else "are"
        reason = (
            f"{_names(wanted, not_literal)} of {description.path.name} {verb} made by a macro, an "
            f"include or a property"
        )
    elif output_path.suffix != ".xacro":
        reason = f"{output_path.name} is to be a plain URDF by its name"
    else:
        reason = _why_not_in_place(description, text, wanted, output_path)
    if not reason:
        return text, ""
    text, not_literal = edit_origins(description.urdf, edits)
    if not_literal:
        raise _unwritable(description, f"{_names(wanted, not_literal)} cannot be located")
    _check_result(description, parse_urdf(text)[0], wanted)
    return text, f"{reason}, so the expanded URDF was edited instead"


def _why_not_in_place(
    description: Description, text: str, wanted: Mapping[Edge, _Origin], output_path: Path
) -> str:
    """Try an edited xacro where it shall stand; return why it does not work there, or nothing."""
    # Includes are relative to the file, so it has to be expanded in the output's folder.
    trial = output_path.with_name(f".{output_path.name[:200]}.{secrets.token_hex(6)}.tmp")
    try:
        write_text_atomically(trial, text)
        urdf, _ = expand_xacro(
            trial, description.xacro_arguments, description.resolve_package, output_path
        )
        _check_result(description, parse_urdf(urdf)[0], wanted)
    except DescriptionError as error:
        return f"{description.path.name} does not work as {output_path} ({error})"
    finally:
        if trial.exists():
            os.unlink(trial)
    return ""


def _check_result(
    description: Description, written: RobotDescription, wanted: Mapping[Edge, _Origin]
) -> None:
    """Raise DescriptionError unless exactly the wanted origins differ from the original."""
    joints = description.robot.joints
    if set(written.joints) != set(joints):
        raise _unwritable(description, "the joints are others than before")
    expected = {name: joint.parent_T_child_at_zero for name, joint in joints.items()}
    expected.update({item.joint.name: item.parent_T_child for item in wanted.values()})
    for name, joint in written.joints.items():
        error = np.abs(joint.parent_T_child_at_zero - expected[name]).max()
        if joint.edge != joints[name].edge or not error <= _WRITTEN_TOLERANCE:
            raise _unwritable(
                description, f"the origin of joint '{name}' reads back with an error of {error:.1e}"
            )


def _unwritable(description: Description, flaw: str) -> DescriptionError:
    return DescriptionError(
        f"{description.path}: the calibrated description cannot be made from it, because {flaw}; "
        f"expand and simplify the file (`xacro FILE`), then write again"
    )


def _names(wanted: Mapping[Edge, _Origin], edges: Tuple[Edge, ...]) -> str:
    names = quoted(wanted[edge].joint.name for edge in edges)
    return f"joint {names}" if len(edges) == 1 else f"joints {names}"
