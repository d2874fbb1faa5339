"""A first guess that includes the description, where a copy of its text would not work."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from atom_core.errors import AtomError
from atom_core.io.atomic import write_bytes_atomically, write_text_atomically
from atom_core.io.urdf import Description, read_description

_INCLUDING = """<?xml version="1.0"?>
<!-- The first guess is the description as it is. set_initial_estimate replaces this file. -->
<robot name={name} xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:include filename={file}/>
</robot>
"""


def write_including_description(description: Description, file_text: str, path: Path) -> bool:
    """Write a xacro that includes a description; the file stays as it is when that fails.

    Args:
        description: what the file shall mean.
        file_text: the description's file as the configuration writes it.
        path: the file, which exists.

    Returns:
        Whether it was written: it expands to the same joints.
    """
    before = path.read_bytes()
    text = _INCLUDING.format(
        name=quoteattr(description.robot.name),
        file=quoteattr(_include_path(description, file_text)),
    )
    write_text_atomically(path, text)
    try:
        if _same_joints(read_description(path), description):
            return True
    except AtomError:
        pass
    write_bytes_atomically(path, before)
    return False


def _include_path(description: Description, file_text: str) -> str:
    scheme = "package://"
    if file_text.startswith(scheme):
        package, _, inside = file_text[len(scheme) :].partition("/")
        return f"$(find {package})/{inside}"
    return str(description.path.resolve())


def _same_joints(one: Description, other: Description) -> bool:
    ours, theirs = one.robot.joints, other.robot.joints
    return set(ours) == set(theirs) and all(
        joint.edge == theirs[name].edge
        and np.allclose(joint.parent_T_child_at_zero, theirs[name].parent_T_child_at_zero, 0, 1e-12)
        for name, joint in ours.items()
    )
