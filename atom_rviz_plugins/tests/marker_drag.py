"""A marker of RViz is dragged by its arrows, with the mouse."""

import time

import numpy as np
from screen import PATIENCE_S

from atom_core.geometry import se3

ARROW_M = 0.28  # from the marker's middle to the middle of an arrow
NEAR_M = 0.04  # a seed that is dragged to the middle of the board comes so near
_SOON_S = 3.0  # until a marker that was dragged is elsewhere


def drag_marker(screen, view, world_T_sensor, marker, target, look_anew):
    """Drag a marker along its axes until it is where it shall be.

    RViz sees under the mouse what its last frame had there, which may be before the marker or the
    mouse came. Such a drag turns the view, and nothing is where it was.

    Args:
        screen, view: where RViz is, and how it looks.
        world_T_sensor: (4, 4), of the frame of the marker.
        marker: with a ``position`` (3,) [m].
        target: (3,) [m], in the frame of the marker.
        look_anew: opens RViz again, with its view as it was.
    """
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        for axis in np.eye(3):
            way_m = float((target - marker.position) @ axis)
            if abs(way_m) < NEAR_M / 2:
                continue
            arrow = marker.position + np.sign(way_m) * ARROW_M * axis
            ends = se3.apply(world_T_sensor, np.array([arrow, arrow + way_m * axis]))
            before = marker.position
            screen.drag(*view.pixel(ends))
            if not _moves(marker, before):
                look_anew()
                break
        if np.abs(marker.position - target).max() < NEAR_M:
            return
    raise AssertionError(f"the marker is at {marker.position}, not at {target}")


def _moves(marker, before):
    """Tell whether a marker comes to be elsewhere soon."""
    end_s = time.monotonic() + _SOON_S
    while np.array_equal(marker.position, before) and time.monotonic() < end_s:
        time.sleep(0.05)
    return not np.array_equal(marker.position, before)
