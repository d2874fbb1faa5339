"""Whether the description that the answer is written into agrees with the data."""

from __future__ import annotations

from pathlib import Path
from typing import List

from atom_core.model.believed_edges import edges_apart
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import Dataset
from atom_core.model.robot import FIXED, RobotDescription


def description_caveats(dataset: Dataset, robot: RobotDescription, path: Path) -> List[Caveat]:
    """Return which sensors a calibrated description would put elsewhere than the dataset has them.

    It is written with the estimated edges alone; all others stay as they are in it.

    Args:
        dataset: to be calibrated.
        robot: what the answer is to be written into.
        path: its file.
    """
    fixed = {
        joint.edge: joint.parent_T_child(0.0)
        for joint in robot.joints.values()
        if joint.type == FIXED
    }
    return [
        Caveat(
            apart.sensors,
            f"the description ({path}) has '{apart.edge}' {apart.words} from where the transforms "
            f"of the data have it, and a calibrated one is as far off",
            "correct the description, or what published the transforms and collect again",
        )
        for apart in edges_apart(dataset, fixed)
    ]
