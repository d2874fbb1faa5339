"""The simulated cell live: /clock, the sensors' topics, a marker that moves the board."""

from __future__ import annotations

import threading
import time
from typing import Any, Callable, List, NamedTuple, Optional

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, JointState
from std_srvs.srv import (
    SetBool,
    SetBoolRequest,
    SetBoolResponse,
    Trigger,
    TriggerRequest,
    TriggerResponse,
)
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import (
    InteractiveMarker,
    InteractiveMarkerControl,
    InteractiveMarkerFeedback,
    Marker,
)

from atom_calibration.runtime import running
from atom_calibration.show.pose_marker import MarkerServer
from atom_core.geometry import se3
from atom_examples.cell_simulator import messages
from atom_examples.cell_simulator.devices import CameraDevice, Device, Packing, devices_of
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.scene import Person
from atom_examples.cell_simulator.trajectory import TICK_S
from atom_examples.cell_simulator.world import World

NODE = "cell_simulator"
MARKER = "board"
START_S = 1000.0
_LIVE = 5  # stream of random numbers of one seed
_FRONT_M = np.array([0.0, -0.6, 1.1])  # where the board stands at the start
_EYE_M = np.array([0.0, 1.3, 2.0])  # what it faces
_PERSON_M = np.array([0.9, -0.2])  # from the middle of the board


def run(seed: int, initial_estimate: str, depth_encoding: str, rtf: float, **of_world: Any) -> int:
    """Run the node until it is shut down; arguments as of `LiveCell` and `World`."""
    try:
        rospy.set_param("/use_sim_time", True)
    except OSError:
        raise SimulatorError(
            "no ROS master answers; start one with roscore, or use collab_cell_simulation.launch"
        ) from None
    # Takes seconds; only as long as this is no node does Ctrl-C end it at once.
    world = World(seed, **of_world)

    def live() -> int:
        running.start(NODE)
        LiveCell(world, initial_estimate, depth_encoding, rtf).spin()
        return 0

    try:
        return running.guarded(NODE, live)
    finally:
        world.scene.close()


class _Output(NamedTuple):
    """A device with its publishers; it is due every so many ticks."""

    device: Device
    period: int
    publish: rospy.Publisher
    publish_info: Optional[rospy.Publisher]


class LiveCell:
    """The world with its clock. Sensors work in the thread of ``spin``, which owns the graphics."""

    def __init__(self, world: World, initial_estimate: str, depth_encoding: str, rtf: float):
        """Advertise everything.

        Args:
            world: the cell.
            initial_estimate: "exact" or "disturbed", the mounts on tf and in /robot_description.
            depth_encoding: 16UC1 or 32FC1.
            rtf: seconds simulated in a second, at most.
        """
        self.world, self._packing, self._rtf = world, Packing(depth_encoding), rtf
        self._lock = threading.Lock()
        self._steps = threading.Semaphore(0)
        self._tick, self._paused = 0, False
        description = world.description(initial_estimate)
        rospy.set_param("/robot_description", description.urdf)
        self._still, self._joints = messages.split_edges(description.robot, world.home)
        self._outputs = [_advertised(device, self._packing) for device in devices_of(world)]
        self._clock = _publisher("/clock", Clock, 10)
        self._tf = _publisher("/tf", TFMessage, 10)
        self._tf_static = running.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._joint_states = _publisher("/joint_states", JointState, 10)
        self._truth = _publisher("/ground_truth/pattern", PoseStamped, 10)
        self._start = _start_pose(world)
        self._board = self._start
        self._marker = BoardMarker(world, self._start, self._move_board)
        rospy.Service("~step", Trigger, self._step)
        rospy.Service("~reset", Trigger, self._reset)
        rospy.Service("~pause", SetBool, self._pause)

    def spin(self) -> None:
        """Make time pass until the node is asked to end."""
        self._tf_static.publish(messages.transforms(self._still, self._stamp()))
        next_wall = time.monotonic()
        while not running.stopped():
            if self._paused and not self._steps.acquire(timeout=0.05):
                next_wall = time.monotonic()
                continue
            self._publish_tick()
            self._tick += 1
            next_wall += TICK_S / self._rtf
            now = time.monotonic()
            if now < next_wall:
                time.sleep(next_wall - now)
            else:
                next_wall = now  # too slow: the simulated time falls behind, it never jumps

    def _publish_tick(self) -> None:
        stamp = self._stamp()
        with self._lock:
            board = self._board
        self.world.scene.place_board(board)
        self.world.scene.place_person(_person_beside(self.world, board))
        self._clock.publish(Clock(stamp))
        told = self.world.as_told(self._joints, _LIVE, self._tick)
        self._tf.publish(messages.transforms(told, stamp))
        self._joint_states.publish(messages.joint_state(self.world.home, stamp))
        head = messages.header(self.world.rig.world, stamp)
        self._truth.publish(PoseStamped(head, messages.pose(board)))
        for number, output in enumerate(self._outputs):
            if running.stopped():  # on a busy machine all sensors together take seconds
                return
            if self._tick % output.period == 0:
                self._publish_sensor(number, output, stamp)

    def _publish_sensor(self, number: int, output: _Output, stamp: rospy.Time) -> None:
        device, world = output.device, self.world
        off = rospy.Duration(world.stamp_error_s(_LIVE, number, self._tick))
        head = messages.header(device.settings.frame, stamp + off)
        if output.publish.get_num_connections() > 0:
            rng = np.random.default_rng([world.seed, _LIVE, number, self._tick])
            seen = device.capture(world.scene, rng)
            message = device.pack(seen, head, self._packing)
            output.publish.publish(message)
        if output.publish_info is not None and isinstance(device, CameraDevice):
            output.publish_info.publish(device.info(head))

    def _stamp(self) -> rospy.Time:
        return rospy.Time(0, int(START_S * 1e9) + self._tick * int(TICK_S * 1e9))

    def _move_board(self, world_T_pattern: np.ndarray) -> None:
        with self._lock:
            self._board = world_T_pattern

    def _step(self, _request: TriggerRequest) -> TriggerResponse:
        self._paused = True
        self._steps.release()
        return TriggerResponse(True, f"{TICK_S} s; ~pause with false lets time pass again")

    def _reset(self, _request: TriggerRequest) -> TriggerResponse:
        self._move_board(self._start)
        self._marker.put(self._start)
        self._paused = False
        return TriggerResponse(True, "the board is where it began")

    def _pause(self, request: SetBoolRequest) -> SetBoolResponse:
        self._paused = bool(request.data)
        return SetBoolResponse(True, "paused" if self._paused else "running")


class BoardMarker:
    """The interactive marker in the middle of the board: six degrees of freedom."""

    def __init__(
        self, world: World, world_T_pattern: np.ndarray, moved: Callable[[np.ndarray], None]
    ):
        """Show the marker.

        Args:
            world: the cell.
            world_T_pattern: where the board is.
            moved: called with ``world_T_pattern`` when a user moves the marker.
        """
        self._moved = moved
        pattern = world.scene.board.pattern
        middle = pattern.border.centre_in_pattern
        self._pattern_T_marker = se3.transform(np.eye(3), middle)
        self._server = MarkerServer(f"{NODE}/board_marker")
        marker = InteractiveMarker(name=MARKER, description="board", scale=0.7)
        marker.header.frame_id = world.rig.world
        marker.pose = messages.pose(world_T_pattern @ self._pattern_T_marker)
        marker.controls = _controls(np.append(2 * pattern.border.half_size, 0.004))
        self._server.insert(marker, self._feedback)
        self._server.applyChanges()

    def put(self, world_T_pattern: np.ndarray) -> None:
        """Move the marker to the board."""
        self._server.setPose(MARKER, messages.pose(world_T_pattern @ self._pattern_T_marker))
        self._server.applyChanges()

    def _feedback(self, feedback: InteractiveMarkerFeedback) -> None:
        if feedback.event_type == InteractiveMarkerFeedback.POSE_UPDATE:
            marker = messages.matrix_of(feedback.pose)
            self._moved(marker @ se3.inverse(self._pattern_T_marker))


def _controls(size_m: np.ndarray) -> List[InteractiveMarkerControl]:
    plate = Marker(type=Marker.CUBE)
    plate.scale.x, plate.scale.y, plate.scale.z = (float(v) for v in size_m)
    plate.color.r = plate.color.g = plate.color.b = 0.9
    plate.color.a = 0.6
    plate.pose.orientation.w = 1.0
    body = InteractiveMarkerControl(
        name="move",
        always_visible=True,
        markers=[plate],
        interaction_mode=InteractiveMarkerControl.MOVE_3D,
    )
    body.orientation.w = 1.0
    controls = [body]
    half = float(np.sqrt(0.5))
    for name, axis in (("x", (half, 0, 0)), ("z", (0, half, 0)), ("y", (0, 0, half))):
        for kind, mode in (
            ("move", InteractiveMarkerControl.MOVE_AXIS),
            ("turn", InteractiveMarkerControl.ROTATE_AXIS),
        ):
            control = InteractiveMarkerControl(name=f"{kind}_{name}", interaction_mode=mode)
            control.orientation.w = half
            control.orientation.x, control.orientation.y, control.orientation.z = axis
            controls.append(control)
    return controls


def _advertised(device: Device, packing: Packing) -> _Output:
    period = max(int(round(1.0 / (device.settings.rate_hz * TICK_S))), 1)
    info = device.info_topic and _publisher(device.info_topic, CameraInfo, 2)
    return _Output(device, period, _publisher(device.topic(packing), device.message, 2), info)


def _publisher(topic: str, kind: type, queue: int) -> rospy.Publisher:
    return running.Publisher(topic, kind, queue_size=queue)


def _start_pose(world: World) -> np.ndarray:
    away = (_FRONT_M - _EYE_M) / np.linalg.norm(_FRONT_M - _EYE_M)
    x = np.cross(away, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(away, x), away])
    middle = world.scene.board.pattern.border.centre_in_pattern
    return se3.transform(rotation, _FRONT_M - rotation @ middle)


def _person_beside(world: World, world_T_pattern: np.ndarray) -> Person:
    middle = world.scene.board.pattern.border.centre_in_pattern
    x, y = se3.apply(world_T_pattern, middle[None])[0, :2] + _PERSON_M
    return Person(float(x), float(y), 0.4)
