"""The interactive marker, on a server that only writes down what it is told."""

import numpy as np
import pytest
import rospy
from visualization_msgs.msg import InteractiveMarkerControl, InteractiveMarkerFeedback

from atom_calibration.messages.poses import pose_matrix, pose_message
from atom_calibration.show import markers
from atom_calibration.show.pose_marker import FULL, PLANAR, POSITION, STILL, PoseMarker
from atom_core.geometry import se3

POSE = se3.from_rpy(np.array([1.0, -2.0, 0.5]), np.array([0.3, -0.2, 1.1]))
OTHER = se3.from_rpy(np.array([0.1, 0.2, 0.3]), np.array([-0.5, 0.4, 0.0]))


class Server:
    """Stands in for an InteractiveMarkerServer, which needs a master."""

    def __init__(self):
        self.shown, self.feedback, self.menu, self.applied = {}, {}, {}, 0

    def insert(self, marker, feedback_cb, feedback_type=None):
        self.shown[marker.name] = marker
        (self.feedback if feedback_type is None else self.menu)[marker.name] = feedback_cb

    def setPose(self, name, pose):  # noqa: N802  (the server's name for it)
        self.shown[name].pose = pose

    def get(self, name):
        return self.shown.get(name)

    def setCallback(self, *_):  # noqa: N802
        pass

    def erase(self, name):
        self.shown.pop(name, None)

    def applyChanges(self):  # noqa: N802
        self.applied += 1


def feedback(matrix, frame="beam", event=InteractiveMarkerFeedback.POSE_UPDATE, stamp_s=7.0):
    message = InteractiveMarkerFeedback(
        marker_name="m", event_type=event, pose=pose_message(matrix)
    )
    message.header.frame_id, message.header.stamp = frame, rospy.Time.from_sec(stamp_s)
    return message


@pytest.fixture
def server():
    return Server()


@pytest.fixture
def moves():
    return []


@pytest.fixture
def marker(server, moves):
    return PoseMarker(server, "m", "beam", POSE, moves.append)


def shown_pose(server):
    return pose_matrix(server.shown["m"].pose)


def test_it_stands_where_it_was_put_and_is_locked_to_its_frame(server, marker):
    message = server.shown["m"]
    np.testing.assert_allclose(pose_matrix(message.pose), POSE, atol=1e-12)
    assert message.header.frame_id == "beam"
    assert message.header.stamp.is_zero()
    assert server.applied == 1


@pytest.mark.parametrize(
    ("kind", "translations", "rotations"),
    [(FULL, "xyz", "xyz"), (POSITION, "xyz", ""), (PLANAR, "xy", "z"), (STILL, "", "")],
)
def test_controls_move_along_and_turn_about_the_axes_they_are_named_after(
    server, kind, translations, rotations
):
    controls = PoseMarker(server, "m", "beam", POSE, moves=kind).message().controls
    axes = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
    by_mode = {InteractiveMarkerControl.MOVE_AXIS: "", InteractiveMarkerControl.ROTATE_AXIS: ""}
    for control in controls:
        q = control.orientation
        turned = se3.rotation_from_quaternion(np.array([q.x, q.y, q.z, q.w]))
        axis = control.name[-1]
        np.testing.assert_allclose(turned @ [1, 0, 0], axes[axis], atol=1e-12)
        by_mode[control.interaction_mode] += axis
    assert tuple(by_mode.values()) == (translations, rotations)


def test_a_drag_is_told_with_pose_stamp_and_whether_it_ended(server, marker, moves):
    server.feedback["m"](feedback(OTHER))
    server.feedback["m"](feedback(OTHER, event=InteractiveMarkerFeedback.MOUSE_UP, stamp_s=8.0))
    np.testing.assert_allclose(moves[0].frame_T_marker, OTHER, atol=1e-12)
    assert [(m.stamp.to_sec(), m.dropped) for m in moves] == [(7.0, False), (8.0, True)]
    np.testing.assert_allclose(marker.frame_T_marker, OTHER, atol=1e-12)


def test_a_click_that_only_rounds_the_pose_does_not_move_it(server, marker, moves):
    rounded = POSE.astype(np.float32).astype(float)
    server.feedback["m"](feedback(rounded, event=InteractiveMarkerFeedback.MOUSE_UP))
    assert moves[0].dropped
    np.testing.assert_array_equal(moves[0].frame_T_marker, POSE)


def test_other_events_move_nothing(server, marker, moves):
    for event in (
        InteractiveMarkerFeedback.KEEP_ALIVE,
        InteractiveMarkerFeedback.MOUSE_DOWN,
        InteractiveMarkerFeedback.BUTTON_CLICK,
    ):
        server.feedback["m"](feedback(OTHER, event=event))
    assert not moves
    np.testing.assert_allclose(marker.frame_T_marker, POSE, atol=1e-12)


def test_a_pose_in_another_frame_or_without_numbers_is_ignored(server, marker, moves):
    bad = feedback(OTHER)
    bad.pose.position.x = float("nan")
    lost = feedback(OTHER)
    lost.pose.orientation.x = lost.pose.orientation.y = 0.0
    lost.pose.orientation.z = lost.pose.orientation.w = 0.0
    for message in (feedback(OTHER, frame="elsewhere"), bad, lost):
        server.feedback["m"](message)
    assert not moves
    np.testing.assert_allclose(shown_pose(server), POSE, atol=1e-12)


def test_moving_it_by_program_calls_nobody(server, marker, moves):
    marker.move(OTHER)
    assert not moves
    np.testing.assert_allclose(shown_pose(server), OTHER, atol=1e-12)


def test_a_hidden_marker_comes_back_where_it_was_moved_meanwhile(server, marker):
    marker.show(False)
    assert "m" not in server.shown
    marker.move(OTHER)
    assert "m" not in server.shown
    marker.show(True, scale=0.9)
    np.testing.assert_allclose(shown_pose(server), OTHER, atol=1e-12)
    assert server.shown["m"].scale == pytest.approx(0.9)


def test_the_menu_calls_its_functions(server):
    called = []
    menu = [("Save", lambda: called.append("save")), ("Reset", lambda: called.append("reset"))]
    marker = PoseMarker(
        server, "m", "beam", POSE, menu=menu, shapes=[markers.sphere("", 0.1, (1, 0, 0))]
    )
    entries = server.shown["m"].menu_entries
    assert [entry.title for entry in entries] == ["Save", "Reset"]
    assert marker.message().controls[-1].interaction_mode == InteractiveMarkerControl.MENU
    chosen = feedback(POSE, event=InteractiveMarkerFeedback.MENU_SELECT)
    chosen.menu_entry_id = entries[1].id
    server.menu["m"](chosen)
    assert called == ["reset"]
