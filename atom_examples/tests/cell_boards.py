"""Board poses in front of a sensor."""

import numpy as np

from atom_core.geometry import se3
from atom_core.synthetic.board import facing
from atom_core.synthetic.rgb import _square_px
from atom_examples.cell_simulator.scene import Person

AWAY = Person(50.0, 50.0, 0.0)


def before(camera_T_pattern_distance_m, tilt_rad, roll_rad, towards, pattern):
    """Return ``sensor_T_pattern`` of a board in the direction ``towards`` (x/z, y/z)."""
    away = np.array([*towards, 1.0])
    centre = camera_T_pattern_distance_m * away / np.linalg.norm(away)
    z = se3.rotation_from_rotation_vector(np.array([tilt_rad, 0.0, 0.0])) @ away
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    upright = np.column_stack([x, np.cross(z, x), z])
    rotation = upright @ se3.rotation_from_rpy(np.array([0.0, 0.0, roll_rad]))
    return se3.transform(rotation, centre - rotation @ np.append(pattern.border.centre, 0.0))


def random_view(camera, pattern, rng, least_px=25.0, largest_angle_deg=55.0):
    """Return a pose with squares of at least ``least_px``, not too slanted, mostly in view."""
    while True:
        pose = before(
            rng.uniform(1.2, 2.4),
            rng.uniform(-0.9, 0.9),
            rng.uniform(-np.pi, np.pi),
            rng.uniform((-0.35, -0.2), (0.35, 0.2)),
            pattern,
        )
        corners = se3.apply(pose, pattern.corners_of(np.arange(pattern.corner_count)))
        squares = _square_px(camera, pose, corners, pattern.square_m)
        if (
            facing(pose, pattern.border) > np.cos(np.radians(largest_angle_deg))
            and squares.min() >= least_px
            and camera.in_image(corners, 12.0).sum() >= 30
        ):
            return pose, corners, squares
