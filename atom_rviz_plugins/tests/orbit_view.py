"""RViz's view "Orbit" as a camera: where on the screen a point of the scene is."""

from __future__ import annotations

import numpy as np

BACKGROUND = (17, 34, 51)  # nothing else has this colour
_VERTICAL_ANGLE = np.pi / 4  # Ogre's, whatever the size of the window


class OrbitView:
    """Looks at a place from another one, the z axis of the fixed frame upwards."""

    def __init__(self, focus, eye):
        """Both (3,) in the fixed frame [m]."""
        self.focus, self.eye = np.asarray(focus, float), np.asarray(eye, float)
        ahead = self.focus - self.eye
        self.distance_m = float(np.linalg.norm(ahead))
        self._ahead = ahead / self.distance_m
        right = np.cross(self._ahead, [0.0, 0.0, 1.0])
        self._right = right / np.linalg.norm(right)
        self._up = np.cross(self._right, self._ahead)
        self._window = None

    def layout(self):
        """Return the entry `Views` of a layout."""
        pitch = np.arcsin(-self._ahead[2])
        yaw = np.arctan2(-self._ahead[1], -self._ahead[0]) % (2 * np.pi)
        view = {
            "Class": "rviz/Orbit",
            "Name": "Current View",
            "Target Frame": "<Fixed Frame>",
            "Distance": self.distance_m,
            "Pitch": float(pitch),
            "Yaw": float(yaw),
            "Focal Point": dict(zip("XYZ", map(float, self.focus))),
            "Focal Shape Fixed Size": False,
            "Focal Shape Size": 0.001,
            "Near Clip Distance": 0.01,
        }
        return {"Current": view}

    def look_for(self, screen):
        """Find the window that shows the scene, by its background."""
        self._window = screen.wait_for(BACKGROUND, timeout_s=60)

    def pixel(self, points):
        """Return where points (..., 3) of the fixed frame [m] are on the screen (..., 2)."""
        left, top, right, bottom = self._window
        height = bottom - top + 1
        focal_px = height / 2 / np.tan(_VERTICAL_ANGLE / 2)
        from_eye = np.asarray(points, float) - self.eye
        depth_m = from_eye @ self._ahead
        across = focal_px * (from_eye @ self._right) / depth_m
        down = -focal_px * (from_eye @ self._up) / depth_m
        return np.stack([(left + right + 1) / 2 + across, (top + bottom + 1) / 2 + down], axis=-1)


def layout(view, displays, tools, panels=(), fixed_frame="world"):
    """Return a layout of RViz, to be written as YAML."""
    return {
        "Panels": list(panels),
        "Visualization Manager": {
            "Displays": list(displays),
            "Global Options": {
                "Background Color": "; ".join(map(str, BACKGROUND)),
                "Fixed Frame": fixed_frame,
                "Frame Rate": 10,
            },
            "Tools": [{"Class": name} for name in tools],
            "Views": view.layout(),
        },
        "Window Geometry": {
            "X": 0,
            "Y": 0,
            "Width": 1390,
            "Height": 870,
            "Hide Left Dock": False,
            "Hide Right Dock": True,
        },
    }


def cloud(name, topic, size_px=None, selectable=True):
    """Return RViz's display of a cloud: grey and small, or of a size and in its own colours."""
    display = {"Class": "rviz/PointCloud2", "Name": name, "Enabled": True, "Topic": topic}
    display.update({"Style": "Points", "Color Transformer": "FlatColor", "Color": "150; 150; 150"})
    if size_px is not None:
        display.update({"Size (Pixels)": size_px, "Color Transformer": "RGB8"})
        del display["Color"]
    if not selectable:
        display["Selectable"] = False
    return display
