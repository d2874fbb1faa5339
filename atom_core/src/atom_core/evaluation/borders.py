"""The board's physical border in an image, as a continuous line.

From hand annotations where they exist; else from the board's pose by that camera's own corners
alone, never from a solve that includes the range sensor under test.
"""

from __future__ import annotations

import numpy as np

from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.geometry.polyline import clip_segments, segments_of
from atom_core.geometry.rectangle import Rectangle

_STEP_M = 0.01  # chords this short leave distortion's bending far below a hundredth of a pixel


def projected_border(camera: Camera, camera_T_pattern: np.ndarray, border: Rectangle) -> np.ndarray:
    """Return the border's segments (m, 2, 2) in the image, distorted and clipped [px].

    Args:
        camera: intrinsics.
        camera_T_pattern: (4, 4) the board's pose.
        border: the board's edges [m].

    Returns:
        Short chords; none where the border is behind the camera or out of the image.
    """
    outline = border.sample(_STEP_M)
    points = se3.apply(camera_T_pattern, np.column_stack([outline, np.zeros(len(outline))]))
    segments = segments_of(camera.project(points), closed=True)
    # A chord with both ends a little outside may still cross a corner of the image.
    near = camera.in_image(points, margin_px=-float(max(camera.width, camera.height)))
    whole = near & np.roll(near, -1)
    return clipped_to_image(segments[whole], camera)


def clipped_to_image(segments: np.ndarray, camera: Camera) -> np.ndarray:
    """Return the parts of segments (m, 2, 2) [px] that lie in the image."""
    size = np.array([camera.width, camera.height], dtype=float)
    return clip_segments(segments, np.array([-0.5, -0.5]), size - 0.5)
