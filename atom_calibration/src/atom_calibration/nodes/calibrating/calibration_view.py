"""A live view of a calibration: what RViz and the panel show while the solver runs, and after.

Topics, all latched: below /calibrate state, patterns, sensors, names, ghost, points (of all
sensors) and images (of all cameras); TOPIC/labeled3d of each range sensor, TOPIC/labeled2d of each
camera and depth camera; /tf_static. The services /calibrate/show_collection (an empty name: all of
them), /calibrate/next and /calibrate/previous choose the collection that is shown;
/calibrate/leave_out solves again without what a sensor saw in a collection. Fixed transforms that
come on /calibrate/description_tf_static (of robot_state_publisher, renamed) go on to /tf_static,
with the calibrated ones in the place of theirs: so nobody competes.
"""

from __future__ import annotations

import threading
import time
import traceback
from functools import partial
from typing import Any, Callable, Dict, List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from atom_calibration.messages.images import image_message
from atom_calibration.msg import CalibrationState, SensorSigma
from atom_calibration.runtime import running
from atom_calibration.runtime.graph_names import graph_name
from atom_calibration.show import calibrated_tf, calibration_markers
from atom_calibration.show.calibration_state import (
    JUDGING,
    RUNNING,
    Status,
    sigma_messages,
    state_message,
)
from atom_calibration.show.estimate import Estimate
from atom_calibration.show.overlays import Overlays, mosaic
from atom_calibration.show.view_options import ALL, ViewOptions
from atom_calibration.srv import (
    LeaveOut,
    LeaveOutResponse,
    ShowCollection,
    ShowCollectionResponse,
)
from atom_core.calibration.calibrate import Calibration
from atom_core.calibration.options import CalibrationOptions
from atom_core.editing.left_out import LeftOut
from atom_core.errors import AtomError, CalibrationError
from atom_core.model.colours import sensor_colours
from atom_core.model.dataset import Dataset
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.solvers.base import Iteration
from atom_core.solvers.choice import default_solver

STATE, BOARDS, SENSORS = "/calibrate/state", "/calibrate/patterns", "/calibrate/sensors"
GHOST, POINTS, IMAGES = "/calibrate/ghost", "/calibrate/points", "/calibrate/images"
NAMES = "/calibrate/names"
TF, DESCRIPTION_TF = "/tf_static", "/calibrate/description_tf_static"
_QUEUE = {Image: 2, PointCloud2: 10}  # large ones; nothing else is to be missed


class CalibrationView:
    """Watches the command `calibrate` and publishes where it stands, in a thread of its own.

    A view that fails says so and the calibration goes on without it.
    """

    def __init__(self, options: ViewOptions):
        """Prepare; nothing is published before the calibration begins."""
        self._options = options
        self._changed = threading.Condition()
        self._pending = self._busy = self._failed = False
        self._shown, self._status = options.collection, Status(RUNNING)
        self._first: Optional[Estimate] = None
        self._ghost: Optional[Estimate] = None
        self._estimate: Optional[Estimate] = None
        self._sent: Dict[str, List[Marker]] = {}
        self._left_out: Optional[LeftOut] = None  # there is none before the calibration has ended
        self._leaving = threading.Lock()
        self._sigmas: List[SensorSigma] = []
        self._description_tf: List[TransformStamped] = []

    # ------------------------------------------------------------------- the command tells

    def begin(self, dataset: Dataset) -> None:
        """Open the topics; wait until somebody looks, if that was asked for.

        Raises:
            CalibrationError: there is no such collection to show, or the node is to end.
        """
        keys = list(dataset.collections)
        if self._shown not in (ALL, *keys):
            raise CalibrationError(
                f"--show_collection {self._shown}: there is no such collection; use one of "
                f"{', '.join(keys)}"
            )
        self._dataset = dataset
        self._sensor_colours = sensor_colours(dataset.config.sensors)
        self._collection_colours = calibration_markers.collection_colours(keys)
        self._open(dataset)
        threading.Thread(target=self._work, daemon=True).start()
        self._tell("waiting for RViz to look" if self._options.wait_s else "reading the data")
        end = time.monotonic() + self._options.wait_s
        while time.monotonic() < end and not self._is_watched() and not running.stopped():
            running.pause(0.05)
        if running.stopped():
            raise CalibrationError("asked to end before anything was solved")
        self._tell("reading the data")

    def progress(self, iteration: Iteration) -> Optional[bool]:
        """Show an iteration; return whether the solver shall go on."""
        estimate, before = Estimate.of_iteration(self._dataset, iteration), self._estimate
        if self._first is None:
            self._first = self._ghost = estimate
            if self._options.input_ghost:
                self._ghost = estimate.with_transforms_of(self._dataset)
            self._overlays = Overlays(estimate, self._collection_colours)
        self._show(estimate, Status(RUNNING))
        if before is None or self._options.slow_s:
            self._settled()
        if before is None or before.number != estimate.number:  # a new round begins where it was
            running.pause(self._options.slow_s)
        return not running.stopped()

    def end(self, calibration: Calibration, options: CalibrationOptions) -> None:
        """Show the answer, and leave it there."""
        self._left_out = LeftOut(calibration, options)
        self._show_answer(calibration)
        threading.Thread(target=self._get_ready, args=(self._left_out,), daemon=True).start()

    def _show_answer(self, calibration: Calibration) -> None:
        verdict = calibration_verdict(calibration_results(calibration, default_solver()))
        self._sigmas = sigma_messages(calibration, verdict.sensors)
        status = Status(calibration.status, verdict.sentence, verdict.grade)
        self._show(Estimate.of_calibration(calibration), status)
        self._settled()

    # ------------------------------------------------------------------------- what is shown

    def _open(self, dataset: Dataset) -> None:
        def topic(name: str, kind: Any) -> rospy.Publisher:
            return running.Publisher(name, kind, queue_size=_QUEUE.get(kind, 100), latch=True)

        self._publishers = {
            STATE: topic(STATE, CalibrationState),
            POINTS: topic(POINTS, PointCloud2),
            IMAGES: topic(IMAGES, Image),
            TF: topic(TF, TFMessage),
        }
        for name in (BOARDS, SENSORS, NAMES, GHOST):
            self._publishers[name] = topic(name, MarkerArray)
        for sensor in dataset.sensors.values():
            base = sensor.topic or f"/{graph_name(sensor.name)}"
            if sensor.kind.measures_range:
                self._publishers[f"3d {sensor.name}"] = topic(f"{base}/labeled3d", PointCloud2)
            if sensor.camera is not None:
                self._publishers[f"2d {sensor.name}"] = topic(f"{base}/labeled2d", Image)
        rospy.Service("/calibrate/leave_out", LeaveOut, self._leave_out)
        rospy.Service("/calibrate/show_collection", ShowCollection, self._show_collection)
        rospy.Subscriber(DESCRIPTION_TF, TFMessage, self._hear_description)
        rospy.Service("/calibrate/next", Trigger, lambda _: self._turn(1))
        rospy.Service("/calibrate/previous", Trigger, lambda _: self._turn(-1))

    def _hear_description(self, message: TFMessage) -> None:
        """Pass on what does not move; republished with every change."""
        with self._changed:
            self._description_tf = calibrated_tf.merged(self._description_tf, message.transforms)
            self._pending = self._estimate is not None
            self._changed.notify_all()
            if self._estimate is None:  # nothing is calibrated yet
                self._publishers[TF].publish(TFMessage(self._description_tf))

    def _tell(self, message: str) -> None:
        """Tell what goes on before the first iteration."""
        self._publishers[STATE].publish(
            CalibrationState(running=True, status=RUNNING, message=message)
        )

    def _is_watched(self) -> bool:
        return self._publishers[BOARDS].get_num_connections() > 0

    def _show(self, estimate: Estimate, status: Status) -> None:
        with self._changed:
            self._estimate, self._status, self._pending = estimate, status, True
            self._changed.notify_all()

    def _show_collection(self, request: Any) -> ShowCollectionResponse:
        key, known = request.collection_name, list(self._dataset.collections)
        if key not in (ALL, *known):
            return ShowCollectionResponse(
                False, f"there is no collection '{key}'; use one of {', '.join(known)}"
            )
        return ShowCollectionResponse(True, self._choose(key))

    def _leave_out(self, request: Any) -> LeaveOutResponse:
        """Solve again, while what is shown stays; a refusal changes nothing."""
        if self._left_out is None:
            return LeaveOutResponse(False, "the calibration has not ended yet")
        with self._leaving:
            left_out = self._left_out
            act = left_out.leave_out if request.leave_out else left_out.take_in
            try:
                words = act(request.sensor, request.collection_name)
            except AtomError as error:
                return LeaveOutResponse(False, str(error))
            if left_out.solved is None:
                self._show_answer(left_out.first)
            else:
                self._sigmas = []
                self._show(Estimate.of_solved(left_out.solved), Status(JUDGING, words))
                threading.Thread(target=self._judge, args=(left_out,), daemon=True).start()
        rospy.loginfo(words)
        return LeaveOutResponse(True, words)

    def _judge(self, left_out: LeftOut) -> None:
        """Show what an answer is worth, unless it is no longer the one that is shown."""
        solution = left_out.solved
        assert solution is not None
        try:
            now, failure = left_out.now, ""
        except AtomError as error:
            failure = f"it is not known what this answer is worth: {error}"
        with self._leaving:
            if left_out.solved is not solution:
                return
            if failure:
                self._show(Estimate.of_solved(solution), Status(JUDGING, failure))
            else:
                self._show_answer(now)

    def _get_ready(self, left_out: LeftOut) -> None:
        with self._leaving:
            try:
                left_out.get_ready()
            except AtomError as error:  # a click will be told the same
                rospy.logwarn(str(error))

    def _turn(self, steps: int) -> TriggerResponse:
        """Go through all and then each collection."""
        keys = [ALL, *(self._first.used_collections() if self._first else [])]
        now = keys.index(self._shown) if self._shown in keys else 0
        return TriggerResponse(True, self._choose(keys[(now + steps) % len(keys)]))

    def _choose(self, key: str) -> str:
        """Show one collection, or all; return a sentence for the user."""
        with self._changed:
            self._shown, self._pending = key, self._estimate is not None
            self._changed.notify_all()
        return f"collection {key}" if key else "all collections"

    def _settled(self) -> None:
        """Wait until all that was to be shown is published."""
        with self._changed:
            while self._pending or self._busy:
                self._changed.wait()

    # ------------------------------------------------------------------------ the thread

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._pending:
                    self._changed.wait()
                self._pending, self._busy = False, True
                estimate, status, shown = self._estimate, self._status, self._shown
            try:
                if not self._failed and estimate is not None:
                    self._publish(estimate, status, shown)
            except Exception:  # noqa: BLE001 - results are worth more than the view of them
                self._failed = True
                rospy.logerr(f"the view has failed, the solver goes on:\n{traceback.format_exc()}")
            finally:
                with self._changed:
                    self._busy = False
                    self._changed.notify_all()

    def _publish(self, estimate: Estimate, status: Status, shown: str) -> None:
        """Publish everything, the state last; on the way only what somebody looks at."""
        if status.name == JUDGING:  # a click waits for it
            self._publish_state(estimate, status, shown)
        first = self._first or estimate
        everything = estimate is first or status.name != RUNNING
        keys = [shown] if shown else estimate.used_collections()
        world = estimate.dataset.world
        send = Sender(self._publishers, everything)

        def markers_of(name: str, make: Callable[[], List[Marker]]) -> None:
            send(name, lambda: MarkerArray(self._changes(name, make())))

        markers_of(
            BOARDS,
            lambda: calibration_markers.boards(estimate, keys, self._collection_colours),
        )
        markers_of(
            SENSORS,
            lambda: calibration_markers.sensors(estimate, first, keys, self._sensor_colours),
        )
        markers_of(NAMES, lambda: calibration_markers.names(estimate, keys, self._sensor_colours))
        markers_of(GHOST, lambda: calibration_markers.ghost(self._ghost or first, keys))
        send(TF, lambda: TFMessage(self._transforms(estimate, shown)))
        self._publish_points(send, estimate, keys, world)
        self._publish_images(send, estimate, shown)
        self._publish_state(estimate, status, shown)

    def _publish_state(self, estimate: Estimate, status: Status, shown: str) -> None:
        left_out = self._left_out.places if self._left_out is not None else ()
        first = self._first or estimate
        message = state_message(estimate, first, status, shown, self._sensor_colours, left_out)
        message.header.stamp = rospy.Time.now()
        message.sigmas = self._sigmas
        self._publishers[STATE].publish(message)

    def _transforms(self, estimate: Estimate, shown: str) -> List[TransformStamped]:
        calibrated = calibrated_tf.transforms(estimate, self._options.tf, shown or None)
        return calibrated_tf.merged(self._description_tf, calibrated)

    def _publish_points(
        self, send: Sender, estimate: Estimate, keys: List[str], world: str
    ) -> None:
        names = [
            name for name, sensor in estimate.dataset.sensors.items() if sensor.kind.measures_range
        ]
        if not send.wanted(POINTS, *(f"3d {name}" for name in names)):
            return
        tables = calibration_markers.labeled_points(
            estimate,
            keys,
            self._sensor_colours,
            self._collection_colours if self._options.by_collection else None,
        )
        for name, table in tables.items():
            send(f"3d {name}", partial(calibration_markers.cloud, world, table))
        if tables:
            whole = np.concatenate(list(tables.values()))
            send(POINTS, lambda: calibration_markers.cloud(world, whole))

    def _publish_images(self, send: Sender, estimate: Estimate, shown: str) -> None:
        sensors = estimate.dataset.sensors
        names = [name for name, sensor in sensors.items() if sensor.camera is not None]
        if not names or not send.wanted(IMAGES, *(f"2d {name}" for name in names)):
            return
        ended = self._left_out is not None
        clouds = self._sensor_colours if ended else {}  # while it runs they would cost time
        pictures = self._overlays.pictures(estimate, shown or None, clouds)
        for name, picture in pictures.items():
            send(f"2d {name}", partial(_image, picture, sensors[name].frame))
        send(IMAGES, lambda: _image(mosaic(pictures), estimate.dataset.world))

    def _changes(self, name: str, now: List[Marker]) -> List[Marker]:
        before, self._sent[name] = self._sent.get(name, []), now
        return calibration_markers.replaced(before, now)


class Sender:
    """Publishes what somebody looks at, or everything; what nobody wants is not even made."""

    def __init__(self, publishers: Dict[str, rospy.Publisher], everything: bool):
        """Remember both."""
        self._publishers, self._everything = publishers, everything

    def wanted(self, *names: str) -> bool:
        """Tell whether any of these topics shall be published."""
        return self._everything or any(
            self._publishers[name].get_num_connections() for name in names
        )

    def __call__(self, name: str, make: Callable[[], Any]) -> None:
        """Publish a message, if it is wanted."""
        if self.wanted(name):
            self._publishers[name].publish(make())


def _image(picture: np.ndarray, frame: str) -> Image:
    message = image_message(picture, "bgr8")
    message.header.stamp, message.header.frame_id = rospy.Time.now(), frame
    return message
