"""The collector of ``collect`` fed by topics, with its services and its menu."""

from __future__ import annotations

import time
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError  # the builtin from 3.11 on
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Dict, List, NamedTuple, Optional

import message_filters
import numpy as np
import rospy
from std_srvs.srv import SetBool, SetBoolResponse

from atom_calibration.collect.collector import Collector, Setup
from atom_calibration.collect.expectation import PointExpectation
from atom_calibration.collect.live_clocks import LiveClocks
from atom_calibration.collect.selection import Moment, StopMoments, SwitchedMoments
from atom_calibration.collect.time_order import TimeOrder
from atom_calibration.errors import CollectionError, MessageError
from atom_calibration.labels.label_messages import set_labels
from atom_calibration.modalities.frames import Frame, decode
from atom_calibration.msg import SensorLabels
from atom_calibration.nodes.collecting.collector_menu import CollectorMenu
from atom_calibration.nodes.collecting.collector_state import StateBoard
from atom_calibration.nodes.collecting.labeler_node import MOST_WAITING
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.runtime.inbox import Inbox
from atom_calibration.sources.live_topics import LiveTopics, message_class
from atom_calibration.sources.live_transforms import LiveTransforms
from atom_calibration.sources.receipts import ReceiptTimes
from atom_calibration.sources.rig import Rig
from atom_calibration.srv import (
    DeleteCollection,
    DeleteCollectionResponse,
    GetDataset,
    GetDatasetResponse,
    SaveCollection,
    SaveCollectionResponse,
)
from atom_core.errors import AtomError
from atom_core.io.dataset_json import dumps
from atom_core.model.config import CalibrationConfig
from atom_core.model.sensor import Sensor

_BUFFER_BYTES = 2**25
_SAVE_WITHIN_S = 2.0  # a request waits so long for the labels of the time it was made
_SAVE_WINDOW_S = 1.0  # it takes what was seen in the last second
_STALE_S = 5.0
_TF_PATIENCE_S = 0.5
_ANSWER_WITHIN_S = 30.0


class _Room(NamedTuple):
    """How much waits until there is time for it.

    Attributes:
        unlabeled: data of a sensor, until their labels come.
        labeled: data of all sensors with their labels.
        hold_s: by so much a sensor's labels may be later than those of others [s].
    """

    unlabeled: int
    labeled: int
    hold_s: float


_FOR_THE_NEWEST, _FOR_ALL = _Room(30, 60, 1.5), _Room(MOST_WAITING, 500, 15.0)


@dataclass
class _Save:
    """A request for a collection of a time [s], to be answered before the wall's clock's end."""

    time_s: float
    end_wall_s: float
    answer: Future


class LabelSubscribers:
    """The labelers' topics, subscribed before any data flow.

    Attributes:
        filters: by sensor.
    """

    def __init__(self, config: CalibrationConfig, board: StateBoard):
        """Subscribe; the state of the sensors is shown on the board."""
        self.filters = {
            name: message_filters.Subscriber(
                topic_of(name, "labels"), SensorLabels, queue_size=MOST_WAITING
            )
            for name in config.sensors
        }
        for labels in self.filters.values():
            labels.registerCallback(board.see)


def forget_before(data: Any, _labels: SensorLabels, waiting: Dict[rospy.Time, Any]) -> None:
    """Forget the data that wait and are older than what was just labeled.

    Labels come in the order of their data, and not of all of them: else as many as the queue holds
    would be kept for ever, a gigabyte of large pictures.
    """
    for stamp in [stamp for stamp in waiting if stamp < data.header.stamp]:
        del waiting[stamp]


class LiveCollector:
    """Takes collections out of labeled data as they come.

    One thread works (`work`); services, the menu and subscribers leave it what is to be done.

    Attributes:
        collector: the one that offline collection uses too.
        was_automatic: whether collections were ever to be taken wherever the board stands still.
        last_data_s: when labeled data came last, by the wall's clock; None: never.
    """

    def __init__(
        self,
        setup: Setup,
        transforms: LiveTransforms,
        board: StateBoard,
        automatic: bool,
        receipts: ReceiptTimes,
        all_messages: bool = False,
    ):
        """Prepare.

        Args:
            setup: what is collected, and where to.
            transforms: of the running system.
            board: where the state is shown.
            automatic: begin with collecting wherever the board stands still.
            receipts: of sensors whose stamps are not used.
            all_messages: let data wait, instead of passing over the oldest.
        """
        self._setup, self._transforms, self._board = setup, transforms, board
        self._receipts = receipts
        self._clocks = LiveClocks(setup.sensors, receipts.sensors)
        self._moments = self._new_moments(automatic)
        self.collector = Collector(setup, self._moments)
        self.was_automatic = automatic
        self.last_data_s: Optional[float] = None
        self._last_data_time = rospy.Time()
        self._labeled: Dict[str, rospy.Time] = {}  # stamp of the newest labels by sensor
        self._newest: Dict[str, Frame] = {}  # by sensor
        self._expectation = PointExpectation(setup)
        room = _FOR_ALL if all_messages else _FOR_THE_NEWEST
        self._most_unlabeled, self._inbox = room.unlabeled, Inbox(room.labeled)
        self._order = TimeOrder(setup.config.sensors, room.hold_s)
        self._saves: List[_Save] = []
        self._menu: Optional[CollectorMenu] = None
        self._pairs: List[message_filters.TimeSynchronizer] = []
        board.switch(automatic)

    @property
    def count(self) -> int:
        """Number of collections."""
        return len(self._setup.store.keys)

    def listen(self, rig: Rig, topics: LiveTopics, labels: LabelSubscribers) -> None:
        """Pair data with their labels; take up data that came already."""
        for topic, sensor in rig.topics.items():
            kind = message_class(topics.types[topic])
            data = message_filters.Subscriber(
                topic, kind, queue_size=self._most_unlabeled, buff_size=_BUFFER_BYTES
            )
            data.registerCallback(self._receipts.note, sensor.name)
            pair = message_filters.TimeSynchronizer(
                [data, labels.filters[sensor.name]], self._most_unlabeled
            )
            pair.registerCallback(self._receive, sensor)
            pair.registerCallback(forget_before, pair.queues[0])
            self._pairs.append(pair)
            labels.filters[sensor.name].registerCallback(self._receive_labels, sensor)
            if sensor.name not in self._receipts:  # nobody knows when these came
                for message in topics.early(topic):
                    data.callback(message)
            data.registerCallback(self._clocks.note, sensor.name)

    def serve(self, marker_size_m: float) -> None:
        """Advertise the services, show the menu."""
        rospy.Service("~save_collection", SaveCollection, self._serve_save)
        rospy.Service("~delete_collection", DeleteCollection, self._serve_delete)
        rospy.Service("~get_dataset", GetDataset, self._serve_get)
        rospy.Service("~toggle_automatic_data_collector", SetBool, self._serve_toggle)
        self._menu = CollectorMenu(
            self._setup.config.world_link,
            marker_size_m,
            self._from_menu(self._save),
            self._from_menu(self._toggle),
            self._from_menu(self._delete_last),
        )
        self._show()
        self._collections_changed()
        self._board.tell("waiting for labels")

    def work(self, timeout_s: float) -> None:
        """Do what is there to be done; wait for it if there is nothing.

        Raises:
            CollectionError: a driver sets no stamps.
        """
        for warning in self._clocks.check():
            self._setup.warn(warning)
        task = self._inbox.get(timeout_s)
        if task is not None:
            task()
        for save in self._saves[:]:
            late = time.monotonic() > save.end_wall_s
            if late or self._order.released_s >= save.time_s:
                self._saves.remove(save)
                self._answer(save.answer, partial(self._take_now, save.time_s))
        self._board.publish_if_due()

    def finish(self, take_last_stop: bool) -> None:
        """Work off what has come by now, and take the stop that lasted until the end."""
        self._inbox.close()
        while True:
            task = self._inbox.get(0.0)
            if task is None:
                break
            task()
        if take_last_stop:
            self._add(self._order.flush())
            self._guarded(self.collector.finish)

    # --- data -------------------------------------------------------------------------------

    def _receive(self, data: Any, labels: SensorLabels, sensor: Sensor) -> None:
        self._data_came()
        self._inbox.put(partial(self._take_in, sensor, data, labels))

    def _data_came(self) -> None:
        self.last_data_s, self._last_data_time = time.monotonic(), rospy.Time.now()

    def _receive_labels(self, labels: SensorLabels, sensor: Sensor) -> None:
        """Notice labels of data that were labeled before: somebody moved a seed."""
        again = self._labeled.get(sensor.name) == labels.header.stamp
        self._labeled[sensor.name] = labels.header.stamp
        if again:
            self._data_came()
            self._inbox.put(partial(self._label_again, sensor, labels))

    def _take_in(self, sensor: Sensor, data: Any, labels: SensorLabels) -> None:
        try:
            stamped = self._receipts.stamped(data, sensor.name)
            frame = set_labels(decode(sensor, stamped), labels)
        except MessageError as error:
            rospy.logwarn_throttle(5.0, f"a message is left out: {error}")
            return
        if self._order.goes_back(frame):
            self._begin_anew()
        self._newest[sensor.name] = frame
        if self._order.is_late(frame):
            behind_s = self._order.newest_s - frame.stamp_s
            rospy.logwarn_throttle(
                5.0,
                f"data of '{sensor.name}' are left out: they are {behind_s:.1f} s older than "
                f"those of other sensors; {self._clocks.why_behind(behind_s)}",
            )
        self._add(self._order.add(frame))

    def _label_again(self, sensor: Sensor, labels: SensorLabels) -> None:
        frame = self._newest.get(sensor.name)
        if frame is None or frame.stamp_s != self._receipts.time_s(labels, sensor.name):
            return
        frame.unpack()
        set_labels(frame, labels)
        if frame.stamp_s <= self._order.released_s:  # else it is added with these labels
            self.collector.label_again(frame)

    def _add(self, frames: List[Frame]) -> None:
        for frame in frames:
            self._expectation.add(frame)
            self._guarded(partial(self.collector.add, frame))
            frame.pack()

    def _begin_anew(self) -> None:
        """Forget the data of before; the stop that lasted until their end is taken first."""
        rospy.logwarn(
            "time went back: what was not collected until then is forgotten; stops that were are "
            "not taken by themselves again (Save takes them)"
        )
        self._add(self._order.flush())
        self._guarded(self.collector.finish)
        self._order.clear()
        for pair in self._pairs:
            with pair.lock:
                for queue in pair.queues:
                    queue.clear()
        self._moments = self._new_moments(self._moments.on)
        self.collector.begin_anew(self._moments)

    def _new_moments(self, on: bool) -> SwitchedMoments:
        return SwitchedMoments(StopMoments(self._setup.patterns), on)

    def _guarded(self, take: Callable[[], List[str]]) -> None:
        """Let the collector work; what it cannot write is told, and the node goes on."""
        try:
            keys = take()
        except AtomError as error:
            rospy.logerr(str(error))
            self._board.tell(str(error))
            self.collector.refused.append(str(error))
            return
        for key in keys:
            self._taken(key)

    def _taken(self, key: str) -> None:
        self._collections_changed()
        seen, advice = self.collector.quality.of_one(key), self.collector.quality.advice()
        rospy.loginfo(f"collection {key}: {seen or 'nothing is known of how good it is'}")
        self._tell("\n".join([f"collection {key} is taken", *advice]))

    def _collections_changed(self) -> None:
        cameras = {n: s.camera for n, s in self._setup.sensors.items() if s.camera is not None}
        aspects = {name: camera.width / camera.height for name, camera in cameras.items()}
        self._board.collections_changed(self.collector.quality.guidance(), aspects)

    # --- requests ---------------------------------------------------------------------------

    def _serve_save(self, _request: Any) -> SaveCollectionResponse:
        key, problem = self._asked(self._save)
        return SaveCollectionResponse(not problem, problem, key or "")

    def _serve_delete(self, request: Any) -> DeleteCollectionResponse:
        _, problem = self._asked(partial(self._delete, request.collection_name))
        return DeleteCollectionResponse(not problem, problem)

    def _serve_get(self, _request: Any) -> GetDatasetResponse:
        text, problem = self._asked(self._dataset)
        return GetDatasetResponse(not problem, problem, text or "")

    def _serve_toggle(self, request: Any) -> SetBoolResponse:
        text, problem = self._asked(partial(self._switch, bool(request.data)))
        return SetBoolResponse(not problem, problem or text)

    def _asked(self, request: Callable[[Future], None]) -> Any:
        """Leave a request to the working thread; return its result and what went wrong."""
        try:
            return self._inbox.ask(request).result(_ANSWER_WITHIN_S), ""
        except AtomError as error:
            return None, str(error)
        except FutureTimeoutError:
            return None, "the collector is ending, or busy; try again"

    def _from_menu(self, request: Callable[[Future], None]) -> Callable[[], None]:
        def leave() -> None:
            self._inbox.ask(request)

        return leave

    def _answer(self, answer: Future, act: Callable[[], str]) -> None:
        """Do what was asked for, and tell the user when it cannot be done."""
        try:
            answer.set_result(act())
        except AtomError as error:
            self._tell(str(error), rospy.logwarn)
            answer.set_exception(error)

    # --- what is done, in the working thread ------------------------------------------------

    def _save(self, answer: Future) -> None:
        if self.last_data_s is None or not np.isfinite(self._order.newest_s) or self._is_stale():
            self._answer(answer, self._no_data)
            return
        end_wall_s = time.monotonic() + _SAVE_WITHIN_S
        self._saves.append(_Save(self._order.newest_s, end_wall_s, answer))

    def _is_stale(self) -> bool:
        """Tell whether data have ceased to come; while a recording is paused they have not.

        A clock that never went is no recording's: /use_sim_time was left behind.
        """
        quiet_s, now = time.monotonic() - (self.last_data_s or 0.0), rospy.Time.now()
        passed_s = quiet_s if now.is_zero() else abs((now - self._last_data_time).to_sec())
        return min(quiet_s, passed_s) > _STALE_S

    def _no_data(self) -> str:
        since = "yet" if self.last_data_s is None else f"for more than {_STALE_S:g} s"
        raise CollectionError(
            f"no labels have come {since}; are the sensors, or the bag, and the labelers running?"
        )

    def _take_now(self, time_s: float) -> str:
        if self._order.released_s < time_s:  # a sensor has stopped, or the clock has
            self._add(self._order.flush())
        self._transforms.wait_until(time_s, _TF_PATIENCE_S)
        window_s = max(_SAVE_WINDOW_S, self._setup.config.max_duration_between_msgs_s)
        key = self.collector.take(Moment(time_s - window_s, time_s), asked=True)
        assert key is not None  # what is asked for is taken, or refused
        self._taken(key)
        return key

    def _delete(self, key: str, answer: Future) -> None:
        self._answer(answer, partial(self._delete_now, key))

    def _delete_last(self, answer: Future) -> None:
        keys = self._setup.store.keys
        self._delete(keys[-1] if keys else "", answer)

    def _delete_now(self, key: str) -> str:
        self.collector.delete(key)
        self._collections_changed()
        self._tell(f"collection {key} is deleted")
        return key

    def _dataset(self, answer: Future) -> None:
        self._answer(answer, lambda: dumps(self._setup.store.document()[0]))

    def _toggle(self, answer: Future) -> None:
        self._switch(not self._moments.on, answer)

    def _switch(self, on: bool, answer: Future) -> None:
        self._moments.on = on
        self.was_automatic |= on
        self._board.switch(on)
        text = f"automatic data collection is {'on' if on else 'off'}"
        self._tell(text)
        answer.set_result(text)

    def _tell(self, text: str, log: Callable[[str], None] = rospy.loginfo) -> None:
        log(text)
        self._board.tell(text)
        self._show()

    def _show(self) -> None:
        if self._menu is not None:
            self._menu.show(self.count, self._moments.on)
