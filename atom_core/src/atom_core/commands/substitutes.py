"""Programs of ATOM that are not here: what serves in their place."""

from __future__ import annotations

import sys

SUBSTITUTES = {
    "pandey2010": "is not here, because its cost hardly depends on what it is to find; calibrate "
    "-json FILE -ssf CAMERA LIDAR estimates a camera and a LiDAR by both",
    "generate_joint_space_tsne": "is not here, because no program writes the table that it reads; "
    "inspect_atom_dataset -json FILE has the positions of the joints, and check tells which "
    "motions are missing",
    "automatic_data_collector": "is a part of collect_data: collect_data --automatic, or its menu",
    "download_atom_examples_data": "is not needed: rosrun atom_examples demo --example rihbot "
    "--output DIR simulates an example robot, its bags and datasets among them",
    "reconfigure_all": "is not needed, since the example robots are read as they are; "
    "configure_calibration_pkg -n PACKAGE configures one of yours",
    "rviz_viewpoint_motion": "is not here, because no camera of RViz is moved for films; save "
    "views in RViz's panel Views and choose among them",
}
_BAD_INPUT = 2


def refuse(name: str) -> int:
    """Say in one line what serves instead of a program; return the exit code."""
    print(f"{name}: {SUBSTITUTES[name]}", file=sys.stderr)
    return _BAD_INPUT
