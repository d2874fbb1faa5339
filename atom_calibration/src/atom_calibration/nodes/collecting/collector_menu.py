"""The sphere in RViz whose menu saves collections."""

from __future__ import annotations

from typing import Callable

import numpy as np

from atom_calibration.show import markers
from atom_calibration.show.pose_marker import STILL, MarkerServer, PoseMarker
from atom_core.geometry import se3

SERVER, MARKER = "data_labeler", "menu"
_PLACE_M = np.array([0.0, 0.0, 1.0])
_OFF, _ON = (0.4, 0.4, 0.9), (0.2, 0.8, 0.3)


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
        self._world, self._size_m = world, size_m
        self._server = MarkerServer(SERVER)
        self._marker = PoseMarker(
            self._server,
            MARKER,
            world,
            se3.transform(np.eye(3), _PLACE_M),
            moves=STILL,
            scale=size_m,
            shapes=[self._sphere(False)],
            description="collect data",
            menu=[
                ("Save collection", save),
                ("Automatic data collection on/off", toggle),
                ("Delete last collection", delete_last),
            ],
        )

    def show(self, collections: int, automatic: bool) -> None:
        """Say how many collections there are; green: they are taken by themselves."""
        words = f"{collections} collections" + (", automatic" if automatic else "")
        self._marker.redraw([self._sphere(automatic)], words)

    def _sphere(self, automatic: bool) -> markers.Marker:
        return markers.sphere(self._world, self._size_m, _ON if automatic else _OFF)
