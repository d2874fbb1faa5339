"""Names of sensors in the names of topics, services and nodes, where ROS allows fewer signs.

RViz and every C++ node refuse `-` and `.`; `atom_rviz_plugins/src/logic/graph_name.cpp` has the
same rule.
"""

from __future__ import annotations

import re
from typing import Dict, Iterable

from atom_core.errors import ConfigError

_NOT_IN_ROS = re.compile(r"[^A-Za-z0-9_]")


def graph_name(name: str) -> str:
    """Return the name of a sensor or an edge as ROS has it: `_` for what is refused there."""
    return _NOT_IN_ROS.sub("_", name)


def topic_of(sensor: str, what: str) -> str:
    """Return the name of a topic or service that belongs to a sensor, such as `/lidar_1/labels`."""
    return f"/{graph_name(sensor)}/{what}"


def labeler_of(sensor: str) -> str:
    """Return the name of the node that labels a sensor."""
    return f"{graph_name(sensor)}_labeler"


def check_graph_names(names: Iterable[str]) -> None:
    """Refuse names that are the same to ROS: their labels and seeds would be mixed.

    Raises:
        ConfigError: naming two of them.
    """
    taken: Dict[str, str] = {}
    for name in names:
        other = taken.setdefault(graph_name(name), name)
        if other != name:
            raise ConfigError(
                f"'{other}' and '{name}' are both '{graph_name(name)}' in the names of topics and "
                f"services, which have neither '-' nor '.'; rename one of them"
            )
