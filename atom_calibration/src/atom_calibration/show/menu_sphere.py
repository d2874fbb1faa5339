"""The sphere in RViz that stays where it is, with a menu and a line of text."""

from __future__ import annotations

from typing import List, Optional, Tuple

import numpy as np
from interactive_markers.interactive_marker_server import InteractiveMarkerServer

from atom_calibration.show import markers
from atom_calibration.show.pose_marker import STILL, MenuEntries, PoseMarker
from atom_core.geometry import se3
from atom_core.model.colours import Colour

NAME = "menu"  # on its server
GREY, BLUE = (0.9, 0.9, 0.9), (0.4, 0.4, 0.9)
ORANGE, GREEN = (0.95, 0.6, 0.1), (0.2, 0.8, 0.3)
_MOST_LETTERS = 80


class MenuSphere:
    """One sphere on a server of markers."""

    def __init__(
        self,
        server: InteractiveMarkerServer,
        world: str,
        place_m: Tuple[float, float, float],
        menu: MenuEntries,
        *,
        scale: float,
        diameter_m: float,
        colour: Colour = GREY,
        words: str = "",
        letters_m: Optional[float] = None,
    ):
        """Show it.

        Args:
            server: to which it belongs.
            world: frame.
            place_m: where its middle is, in the world.
            menu: (title, function) of the entries; called in a thread of ROS.
            scale: size of the marker [m], by which the text stands above it.
            diameter_m: of the sphere.
            colour: of the sphere.
            words: the text.
            letters_m: their height [m], right above the sphere; None: as RViz writes titles.
        """
        self._diameter_m, self._colour, self._letters_m = diameter_m, colour, letters_m
        self._marker = PoseMarker(
            server,
            NAME,
            world,
            se3.transform(np.eye(3), np.array(place_m)),
            moves=STILL,
            scale=scale,
            shapes=self._shapes(words),
            menu=menu,
            description=words if letters_m is None else "",
        )

    def show(self, words: str, colour: Optional[Colour] = None) -> None:
        """Say something else, of which 80 characters are shown; None: in the same colour."""
        self._colour = self._colour if colour is None else colour
        words = words[:_MOST_LETTERS]
        self._marker.redraw(self._shapes(words), words if self._letters_m is None else "")

    def _shapes(self, words: str) -> List[markers.Marker]:
        shapes = [markers.sphere("", self._diameter_m, self._colour)]
        if self._letters_m is not None:
            above_m = 0.5 * self._diameter_m + (1.0 + words.count("\n")) * self._letters_m
            shapes.append(markers.text("", words, self._letters_m, GREY, above_m))
        return shapes
