"""A seed marker as RViz has it, and a hand that moves it by the feedback that RViz would send."""

import threading

import numpy as np
import rospy
from visualization_msgs.msg import (
    InteractiveMarkerFeedback,
    InteractiveMarkerInit,
    InteractiveMarkerUpdate,
)

from atom_calibration.messages.poses import pose_matrix, pose_message
from atom_core.geometry import se3


class MarkerHand:
    """The marker of a sensor; `position` follows the server.

    The whole state comes on one topic and each change on another; whichever is newer counts, since
    on a busy machine the second may be connected later than the first and miss a change.
    """

    def __init__(self, sensor):
        self.name, self.shown, self.position, self.entries = sensor, None, None, {}
        self._lock, self._newest = threading.Lock(), -1
        server = f"/{sensor}/data_labeler"
        rospy.Subscriber(f"{server}/update_full", InteractiveMarkerInit, self._init)
        rospy.Subscriber(f"{server}/update", InteractiveMarkerUpdate, self._update)
        self._feedback = rospy.Publisher(
            f"{server}/feedback", InteractiveMarkerFeedback, queue_size=9
        )

    def _init(self, message):
        self._take(message.seq_num, message.markers)

    def _update(self, message):
        if message.type == InteractiveMarkerUpdate.UPDATE:  # not a mere sign of life
            self._take(message.seq_num, message.markers, message.poses)

    def _take(self, number, markers, poses=()):
        with self._lock:
            if number > self._newest:
                self._newest = number
                self._show(markers)
                for pose in poses:
                    self._place(pose.pose)

    def _show(self, markers):
        for marker in markers:
            self.shown = marker
            self.entries = {entry.title: entry.id for entry in marker.menu_entries}
            self._place(marker.pose)

    def _place(self, pose):
        self.position = pose_matrix(pose)[:3, 3]

    @property
    def colour(self):
        (body,) = (control for control in self.shown.controls if control.name == "body")
        colour = body.markers[0].color
        return tuple(round(value, 2) for value in (colour.r, colour.g, colour.b))

    def is_ready(self):
        return self.shown is not None and self._feedback.get_num_connections() > 0

    def drag(self, position):
        for event in (InteractiveMarkerFeedback.POSE_UPDATE, InteractiveMarkerFeedback.MOUSE_UP):
            self.tell(event, position)

    def click(self):
        for event in (InteractiveMarkerFeedback.MOUSE_DOWN, InteractiveMarkerFeedback.MOUSE_UP):
            self.tell(event, self.position)

    def choose(self, entry):
        self.tell(InteractiveMarkerFeedback.MENU_SELECT, self.position, self.entries[entry])

    def tell(self, event, position, entry=0):
        message = InteractiveMarkerFeedback(
            client_id="rviz",
            marker_name=self.name,
            event_type=event,
            menu_entry_id=entry,
            pose=pose_message(se3.transform(np.eye(3), position)),
        )
        message.header.frame_id, message.header.stamp = self.shown.header.frame_id, rospy.Time.now()
        self._feedback.publish(message)
