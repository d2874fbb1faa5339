"""The sphere in RViz whose menu goes through a dataset."""

from __future__ import annotations

from typing import Callable, Mapping

import numpy as np

from atom_calibration.show import markers
from atom_calibration.show.pose_marker import STILL, MarkerServer, PoseMarker
from atom_core.geometry import se3

SERVER, MARKER = "dataset_playback", "menu"
_PLACE_M = np.array([0.0, 0.0, 1.0])
_SAVED, _UNSAVED = (0.4, 0.4, 0.9), (0.95, 0.6, 0.1)


class PlaybackMenu:
    """A sphere above the world's origin; orange: something is not saved."""

    def __init__(self, world: str, size_m: float, entries: Mapping[str, Callable[[], None]]):
        """Show it.

        Args:
            world: frame.
            size_m: diameter of the sphere.
            entries: what each does, by its title; called in a thread of ROS.
        """
        self._world, self._size_m = world, size_m
        self._marker = PoseMarker(
            MarkerServer(SERVER),
            MARKER,
            world,
            se3.transform(np.eye(3), _PLACE_M),
            moves=STILL,
            scale=size_m,
            shapes=[self._sphere(False)],
            description="dataset playback",
            menu=list(entries.items()),
        )

    def show(self, words: str, unsaved: bool) -> None:
        """Say which collection is shown."""
        self._marker.redraw([self._sphere(unsaved)], words)

    def _sphere(self, unsaved: bool) -> markers.Marker:
        return markers.sphere(self._world, self._size_m, _UNSAVED if unsaved else _SAVED)
