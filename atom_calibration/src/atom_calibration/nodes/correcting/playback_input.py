"""What RViz sends to correct labels: which sensor it means, and which points or pixels."""

from __future__ import annotations

import time
from typing import Any, Mapping, Set

import numpy as np

from atom_calibration.errors import MessageError
from atom_calibration.messages.clouds import point_cloud
from atom_calibration.messages.headers import frame_name
from atom_calibration.modalities.frames import Frame
from atom_calibration.show.playback_view import Shown
from atom_core.model.sensor import Sensor

_INDEX_FIELDS = ("idx", "index")  # of labeled points; of the cloud they were chosen in


class KeyPress:
    """Which clouds belong to one press of a key: the tool sends one message for each.

    Attributes:
        has_step: something was corrected by this press.
    """

    WITHIN_S = 0.5  # of the wall's clock, since the first

    def __init__(self) -> None:
        """Begin with none."""
        self._kind, self._began_s = "", -np.inf
        self._sensors: Set[str] = set()
        self.has_step = False

    def is_still(self, kind: str, sensor: str) -> bool:
        """Take note of a cloud; return whether it belongs to the press before.

        Args:
            kind: what the key means.
            sensor: whose cloud; a sensor's second one is of another press.
        """
        now_s = time.monotonic()
        still = (
            kind == self._kind
            and sensor not in self._sensors
            and now_s - self._began_s <= self.WITHIN_S
        )
        if not still:
            self._kind, self._began_s, self._sensors = kind, now_s, set()
            self.has_step = False
        self._sensors.add(sensor)
        return still


def sensor_of(header: Any, sensors: Mapping[str, Sensor], shown: Mapping[str, Shown]) -> str:
    """Return the range sensor whose points a message has, by frame and stamp.

    Args:
        header: of the message; a stamp of zero means what is shown now.
        sensors: by name.
        shown: the collection, by sensor.

    Raises:
        MessageError: no sensor has that frame, or what is shown has another stamp.
    """
    frame_id = frame_name(header.frame_id)
    ranging = [s for s in sensors.values() if s.kind.measures_range]
    named = [s.name for s in ranging if s.frame == frame_id]
    if not named:
        frames = ", ".join(f"{s.frame} ({s.name})" for s in ranging) or "none"
        raise MessageError(
            f"points in frame '{frame_id}' are of no range sensor; the dataset has {frames}"
        )
    now = [name for name in named if _is_of(header, shown[name].frame)]
    if not now:
        raise MessageError(
            f"these points of {', '.join(named)} are of another collection than the one that is "
            f"shown; choose them again"
        )
    if len(now) > 1:
        raise MessageError(f"these points may be of {' or '.join(now)}, which share their frame")
    return now[0]


def chosen_points(message: Any) -> np.ndarray:
    """Return the indices (n,) of chosen points in their sensor's data.

    Raises:
        MessageError: the cloud is cut off, has no indices, or there is one that is no number.
    """
    points = point_cloud(message)
    fields = [name for name in _INDEX_FIELDS if name in (points.dtype.names or ())]
    if not fields:
        raise MessageError(
            "the chosen points carry no field 'index'; choose them with the tool Label points"
        )
    values = np.asarray(points[fields[0]], dtype=float)
    if not np.all(np.isfinite(values)):
        raise MessageError(f"a chosen point has no number in its field '{fields[0]}'")
    return np.rint(values).astype(int)


def pixel_of(message: Any, frame: Frame) -> np.ndarray:
    """Return the pixel (2,) of a click in the picture of a frame.

    Raises:
        MessageError: it is of another collection's picture, or no number.
    """
    check_shown(message, frame)
    pixel = np.array([message.point.x, message.point.y])
    if not np.all(np.isfinite(pixel)):
        raise MessageError(f"{frame.sensor.name}: a click is not a number")
    return pixel


def pixels_of(message: Any, frame: Frame) -> np.ndarray:
    """Return the corners (n, 2) [px] of a polygon in the picture of a frame.

    Raises:
        MessageError: it is of another collection's picture.
    """
    check_shown(message, frame)
    return np.array([[p.x, p.y] for p in message.polygon.points], dtype=float).reshape(-1, 2)


def check_shown(message: Any, frame: Frame) -> None:
    """Refuse what was drawn into the picture of another collection than the one that is shown.

    Raises:
        MessageError: it was.
    """
    if not _is_of(message.header, frame):
        raise MessageError(
            f"{frame.sensor.name}: this was drawn into the picture of another collection; draw it "
            f"again"
        )


def _is_of(header: Any, frame: Frame) -> bool:
    stamp = frame.header["stamp"]
    return header.stamp.is_zero() or (header.stamp.secs, header.stamp.nsecs) == (
        stamp["secs"],
        stamp["nsecs"],
    )
