"""The robots that there are: a folder each, with what describes it."""

from __future__ import annotations

from pathlib import Path
from typing import List, NamedTuple

from atom_core.io.paths import package_folder
from atom_examples.cell_simulator.errors import SimulatorError

PACKAGE = "atom_examples"
_SCENARIO = "scenario"


class Robot(NamedTuple):
    """A robot's folder.

    Attributes:
        name: of the robot.
        folder: what describes it.
        recording: which of its recordings is meant; empty: the first.
    """

    name: str
    folder: Path
    recording: str = ""

    @property
    def config(self) -> Path:
        """What is calibrated: ATOM's config.yml."""
        return self.folder / "config" / "config.yml"

    @property
    def sensors(self) -> Path:
        """How its sensors measure and err."""
        return self.folder / "config" / "sensors.yaml"

    @property
    def scenario(self) -> Path:
        """Where its boards are, and how its joints move."""
        name = f"{_SCENARIO}_{self.recording}" if self.recording else _SCENARIO
        return self.folder / "config" / f"{name}.yaml"

    @property
    def further_recordings(self) -> List[str]:
        """Names of recordings beside the first, with other boards, postures or sights."""
        paths = sorted((self.folder / "config").glob(f"{_SCENARIO}_*.yaml"))
        return [path.stem[len(_SCENARIO) + 1 :] for path in paths]

    def recorded_as(self, recording: str) -> Robot:
        """Return the robot with another recording meant.

        Raises:
            SimulatorError: there is none of this name.
        """
        if recording and recording not in self.further_recordings:
            there = ", ".join(self.further_recordings) or "none beside the first"
            raise SimulatorError(
                f"robot '{self.name}' has no recording '{recording}'; there are: {there}"
            )
        return self._replace(recording=recording)


def robots_folder() -> Path:
    """Return the folder of all of them."""
    return package_folder(PACKAGE) / "robots"


def robot_names() -> List[str]:
    """Return the names of all robots that can be simulated."""
    paths = robots_folder().glob("*/config/scenario.yaml")
    return sorted(path.parents[1].name for path in paths)


def robot_named(name: str) -> Robot:
    """Return a robot.

    Args:
        name: of an example, or the path of a folder that is laid out like one.

    Raises:
        SimulatorError: there is none.
    """
    if name in robot_names():
        return Robot(name, robots_folder() / name)
    folder = Path(name)
    if (folder / "config" / "scenario.yaml").is_file():
        return Robot(folder.resolve().name, folder)
    raise SimulatorError(
        f"there is no robot '{name}'; use {', '.join(robot_names())}, or a folder "
        f"with config/scenario.yaml"
    )
