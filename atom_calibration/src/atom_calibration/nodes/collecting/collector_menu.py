"""The sphere in RViz whose menu saves collections."""

from __future__ import annotations

from typing import Callable

from atom_calibration.show.menu_sphere import BLUE, GREEN, MenuSphere
from atom_calibration.show.pose_marker import MarkerServer

SERVER = "data_labeler"
_PLACE_M = (0.0, 0.0, 1.0)


class CollectorMenu:
    """A sphere above the world's origin: save, automatic on and off, delete the last one."""

    def __init__(
        self,
        world: str,
        size_m: float,
        save: Callable[[], None],
        toggle: Callable[[], None],
        delete_last: Callable[[], None],
    ):
        """Show it.

        Args:
            world: frame.
            size_m: diameter of the sphere.
            save: what the entry does; called in a thread of ROS, as the others.
            toggle: automatic collection on or off.
            delete_last: of the collections.
        """
        menu = [
            ("Save collection", save),
            ("Automatic data collection on/off", toggle),
            ("Delete last collection", delete_last),
        ]
        self._sphere = MenuSphere(
            MarkerServer(SERVER),
            world,
            _PLACE_M,
            menu,
            scale=size_m,
            diameter_m=size_m,
            colour=BLUE,
            words="collect data",
        )

    def show(self, collections: int, automatic: bool) -> None:
        """Say how many collections there are; green: they are taken by themselves."""
        words = f"{collections} collections" + (", automatic" if automatic else "")
        self._sphere.show(words, GREEN if automatic else BLUE)
