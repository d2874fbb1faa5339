"""The one interactive marker: a pose that a person drags in RViz.

Sensors, seeds, patterns and corrections of transforms all use it. RViz returns the pose in the
marker's own frame, because the marker is locked to that frame; feedback in another frame comes
from no RViz and is refused.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Quaternion
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from interactive_markers.menu_handler import MenuHandler
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    Marker,
)

from atom_calibration.errors import MessageError
from atom_calibration.messages.headers import frame_name
from atom_calibration.messages.poses import pose_matrix, pose_message
from atom_calibration.runtime import running
from atom_calibration.show import markers

FULL, POSITION, PLANAR, STILL = "full", "position", "planar", "still"
_MOVES = {
    FULL: (("x", "y", "z"), ("x", "y", "z")),  # axes to move along, axes to turn about
    POSITION: (("x", "y", "z"), ()),
    PLANAR: (("x", "y"), ("z",)),
    STILL: ((), ()),
}
_ROUNDING = (
    1e-6  # m and entries of rotations: RViz has 32 bits, so that even a click moves a little
)
# Quaternions (x, y, z, w) of controls: RViz moves along, and turns about, their x axis.
_HALF = 0.5**0.5
_AXES = {
    "x": (_HALF, 0.0, 0.0, _HALF),
    "y": (0.0, 0.0, _HALF, _HALF),
    "z": (0.0, -_HALF, 0.0, _HALF),
}


@dataclass(frozen=True)
class Moved:
    """What a drag in RViz says.

    Attributes:
        frame_T_marker: (4, 4) where the marker is now, in its frame [m].
        stamp: when RViz sent it.
        dropped: the mouse button was released; until then more will follow.
    """

    frame_T_marker: np.ndarray
    stamp: rospy.Time
    dropped: bool


MenuEntries = Sequence[Tuple[str, Callable[[], object]]]
OnMoved = Callable[[Moved], None]


class MarkerServer(InteractiveMarkerServer):
    """A server that listens to RViz whatever ROS's clock does.

    The original refuses whoever speaks within a second after another, by ROS's clock, and to it
    the making of a marker is speech, too: nobody would be heard while that clock stands still
    before a recording begins, nor when the recording has begun anew. Here it is a second of the
    wall's clock after somebody's feedback.
    """

    _TURN_S = 1.0  # so long a marker belongs to the client that moved it last

    def __init__(self, *arguments: Any, **options: Any):
        """Take what the original takes."""
        self._heard: Dict[str, float] = {}  # of a marker: when feedback was accepted [s]
        super().__init__(*arguments, **options)

    def processFeedback(self, feedback: Any) -> None:  # noqa: N802  (the server's name for it)
        """Take feedback from anyone if nobody else moved the marker just now."""
        with self.mutex:
            context = self.marker_contexts.get(feedback.marker_name)
            if context is not None:
                now = time.monotonic()
                last = self._heard.get(feedback.marker_name, -np.inf)
                if context.last_client_id != feedback.client_id and now - last < self._TURN_S:
                    return
                self._heard[feedback.marker_name] = now
                context.last_client_id = feedback.client_id
        super().processFeedback(feedback)

    def publish(self, update: Any) -> None:
        """Publish, also from the timer's thread, which may outlive the topic when a node ends."""
        with running.quiet_at_the_end():
            super().publish(update)


class PoseMarker:
    """One marker on a server; several may share the server.

    Attributes:
        name: on the server.
        frame: its frame.
        frame_T_marker: (4, 4) its pose [m].
        scale: its size [m].
        visible: whether RViz shows it.
    """

    def __init__(
        self,
        server: InteractiveMarkerServer,
        name: str,
        frame: str,
        frame_T_marker: np.ndarray,
        on_moved: Optional[OnMoved] = None,
        *,
        moves: str = FULL,
        scale: float = 0.6,
        shapes: Sequence[Marker] = (),
        menu: MenuEntries = (),
        description: str = "",
    ):
        """Show the marker.

        Args:
            server: to which it belongs.
            name: unique on the server.
            frame: frame of the pose; the marker follows it.
            frame_T_marker: (4, 4) pose [m].
            on_moved: called upon each step of a drag, in a thread of ROS.
            moves: FULL (six degrees of freedom), POSITION, PLANAR (x, y and yaw) or STILL.
            scale: size [m].
            shapes: what is drawn between the arrows, in the marker's own frame; a left click on
                it opens the menu too.
            menu: (title, function) of the entries on the right mouse button.
            description: a text above it.
        """
        self.name, self.frame, self.scale, self.visible = name, frame, scale, True
        self.frame_T_marker = np.array(frame_T_marker, dtype=float)
        self._server, self._on_moved, self._moves = server, on_moved, moves
        self._shapes, self._description = list(shapes), description
        self._handler = _menu_handler(menu) if menu else None
        self._insert()

    def move(self, frame_T_marker: np.ndarray) -> None:
        """Put the marker elsewhere; `on_moved` is not called."""
        self.frame_T_marker = np.array(frame_T_marker, dtype=float)
        if self.visible:
            self._server.setPose(self.name, pose_message(self.frame_T_marker))
            self._server.applyChanges()

    def show(self, visible: bool = True, scale: Optional[float] = None) -> None:
        """Show or hide the marker, or give it another size [m]."""
        if (visible, scale or self.scale) == (self.visible, self.scale):
            return
        self.visible, self.scale = visible, scale or self.scale
        if visible:
            self._insert()
        else:
            self.remove()

    def redraw(self, shapes: Sequence[Marker], description: Optional[str] = None) -> None:
        """Draw other shapes, or another text."""
        self._shapes = list(shapes)
        self._description = self._description if description is None else description
        if self.visible:
            self._insert()

    def remove(self) -> None:
        """Take the marker off the server."""
        self.visible = False
        self._server.erase(self.name)
        self._server.applyChanges()

    def message(self) -> InteractiveMarker:
        """Return the marker as RViz gets it."""
        marker = InteractiveMarker(
            name=self.name,
            description=self._description,
            scale=self.scale,
            pose=pose_message(self.frame_T_marker),
        )
        marker.header.frame_id = self.frame  # the stamp stays zero: locked to the frame
        marker.controls = _controls(self._moves, self.scale)
        if self._shapes or self._handler is not None:
            marker.controls.append(_body(self._shapes, self._handler is not None))
        return marker

    def _insert(self) -> None:
        self._server.insert(self.message(), self._feedback)
        if self._handler is not None:
            self._handler.apply(self._server, self.name)
        self._server.applyChanges()

    def _feedback(self, feedback: Any) -> None:
        """Take a pose from RViz; called by the server."""
        if feedback.event_type not in (
            InteractiveMarkerFeedback.POSE_UPDATE,
            InteractiveMarkerFeedback.MOUSE_UP,
        ):
            return
        problem = _problem(feedback, self.frame)
        if problem:
            rospy.logwarn(f"marker '{self.name}': {problem}; the move is ignored")
            self.move(self.frame_T_marker)
            return
        dragged = pose_matrix(feedback.pose)
        if not np.allclose(dragged, self.frame_T_marker, rtol=0.0, atol=_ROUNDING):
            self.frame_T_marker = dragged
        dropped = feedback.event_type == InteractiveMarkerFeedback.MOUSE_UP
        if dropped:  # while it is dragged, an echo would pull it back
            self._server.applyChanges()
        if self._on_moved is not None:
            self._on_moved(Moved(self.frame_T_marker.copy(), feedback.header.stamp, dropped))


def _problem(feedback: Any, frame: str) -> str:
    """Return why a pose from RViz cannot be used; empty when it can."""
    if frame_name(feedback.header.frame_id) not in ("", frame):
        return f"its pose came in frame '{feedback.header.frame_id}' instead of '{frame}'"
    try:
        pose_matrix(feedback.pose)
    except MessageError as error:
        return str(error)
    return ""


def _menu_handler(menu: MenuEntries) -> MenuHandler:
    handler = MenuHandler()
    for title, function in menu:
        handler.insert(title, callback=lambda _feedback, call=function: call())
    return handler


def _controls(moves: str, scale: float) -> List[InteractiveMarkerControl]:
    """Return arrows to move along and rings to turn about, each by the axes' names.

    Args:
        moves: see `PoseMarker`.
        scale: size of the marker [m].
    """
    along, about = _MOVES[moves]
    kinds = [(axis, "move", InteractiveMarkerControl.MOVE_AXIS) for axis in along]
    kinds += [(axis, "rotate", InteractiveMarkerControl.ROTATE_AXIS) for axis in about]
    controls = []
    for axis, verb, mode in kinds:
        control = InteractiveMarkerControl(name=f"{verb}_{axis}", interaction_mode=mode)
        control.orientation = Quaternion(*_AXES[axis])
        if moves == POSITION:  # its own are red, green and blue, as labels and sensors are
            control.markers = markers.arrows(np.eye(3)["xyz".index(axis)], scale)
        controls.append(control)
    return controls


def _body(shapes: Sequence[Marker], with_menu: bool) -> InteractiveMarkerControl:
    button = InteractiveMarkerControl.MENU if with_menu else InteractiveMarkerControl.NONE
    return InteractiveMarkerControl(
        name="body", interaction_mode=button, always_visible=True, markers=list(shapes)
    )
