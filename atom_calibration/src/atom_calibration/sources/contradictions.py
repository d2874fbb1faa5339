"""What a recording contradicts itself in: intrinsics, frames, stamps, transforms.

None of it can be repaired, and all of it gives a wrong calibration in silence.
"""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_calibration.errors import BagError
from atom_calibration.messages.headers import frame_name, stamp_s
from atom_calibration.messages.poses import edge_of
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

_BACK_S = 1.0  # stamps of one sensor that are in disorder by less are a slow driver's
_SAME_INTRINSICS = 1e-3  # of a focal length and of a coefficient: 1 px at the edge of an image
_SAME_M, _SAME_RAD = 1e-3, 1e-3  # poses that say the same of an edge
_OTHER_M, _OTHER_RAD = 3e-3, 5e-3  # poses that cannot both be right
_SWITCHES = 20  # poses that leave for another place, and are back with the next message
_MUCH_SMALLER = 0.2  # than another step
_STAYS_SO_S = 1.0  # around a message in which an edge contradicts itself


class _Intrinsics(NamedTuple):
    """What a CameraInfo says: ``region`` is x, y, width and height in the full resolution."""

    size: Tuple[int, int]
    K: Tuple[float, ...]
    D: Tuple[float, ...]
    binning: Tuple[int, int]
    region: Tuple[int, int, int, int]


class MessageWatch:
    """Looks at the messages of a recording as they come, in the order of their recording."""

    def __init__(self, path: Any, infos: Mapping[str, Sensor], start_s: float):
        """Know the cameras.

        Args:
            path: what messages call the recording.
            infos: cameras by the topic of their intrinsics.
            start_s: when the recording begins [s].
        """
        self._path, self._infos, self._start_s = path, infos, start_s
        self._known: Dict[str, _Intrinsics] = {}
        self._last_s: Dict[str, float] = {}
        self._frames: Dict[str, str] = {}

    def see_info(self, topic: str, message: Any, recorded_s: float) -> None:
        """Refuse intrinsics that are not those of the beginning.

        Raises:
            BagError: naming the camera, when, and what changed.
        """
        roi = message.roi
        said = _Intrinsics(
            (message.width, message.height),
            tuple(message.K),
            tuple(message.D),
            (message.binning_x, message.binning_y),
            (roi.x_offset, roi.y_offset, roi.width, roi.height),
        )
        known = self._known.setdefault(topic, said)
        if _same_camera(known, said):
            return
        raise BagError(
            f"{self._path}: sensor '{self._infos[topic].name}', topic {topic}: its intrinsics "
            f"change {recorded_s - self._start_s:.1f} s after the beginning ({_camera(known)}, "
            f"then {_camera(said)}); a bag must have one lens, zoom and image size: cut it there "
            f"with `rosbag filter`, or record it again"
        )

    def see(self, sensor: Sensor, message: Any, recorded_s: float) -> None:
        """Refuse a stamp that lies before an earlier message's, and data of another frame.

        Raises:
            BagError: naming the sensor and when.
        """
        stamp, frame = stamp_s(message), frame_name(message.header.frame_id)
        first = self._frames.setdefault(sensor.name, frame)
        if frame != first:
            raise BagError(
                f"{self._path}: sensor '{sensor.name}', topic {sensor.topic}: its data are in "
                f"frame '{first}' at first, and {recorded_s - self._start_s:.1f} s after the "
                f"beginning in frame '{frame}'; one topic must have the data of one sensor in one "
                f"frame: cut the bag there with `rosbag filter`, or record it again with one driver"
            )
        last_s = self._last_s.setdefault(sensor.name, stamp)
        if stamp < last_s - _BACK_S:
            raise BagError(
                f"{self._path}: sensor '{sensor.name}', topic {sensor.topic}: its stamps jump back "
                f"by {last_s - stamp:.1f} s, {recorded_s - self._start_s:.1f} s after the "
                f"beginning; was a recording played twice while this bag was recorded? Cut it "
                f"there with `rosbag filter`, or record it again"
            )
        self._last_s[sensor.name] = max(stamp, last_s)


def _same_camera(a: _Intrinsics, b: _Intrinsics) -> bool:
    if a == b:
        return True
    if a._replace(K=b.K, D=b.D) != b or len(a.D) != len(b.D):
        return False
    k_apart = np.abs(np.subtract(a.K, b.K)) / max(a.K[0], 1.0)
    d_apart = np.abs(np.subtract(a.D, b.D))
    return bool(np.all(np.append(k_apart, d_apart) <= _SAME_INTRINSICS))


def _camera(said: _Intrinsics) -> str:
    text = f"{said.size[0]} x {said.size[1]} pixels, f = {said.K[0]:.1f} px"
    text += f", binning {said.binning[0]} x {said.binning[1]}" if max(said.binning) > 1 else ""
    x, y, width, height = said.region
    return text + (f", region of {width} x {height} from ({x}, {y})" if width else "")


PoseTuple = Tuple[float, ...]  # x, y, z [m] and the quaternion x, y, z, w of a transform


class _Switches(NamedTuple):
    """How often an edge was back where it had just left.

    Steps that lead elsewhere count against it: readings that scatter or shake are back by chance.
    Those much smaller than its returns do not: so a robot moves from message to message.
    ``taken`` is what the last step has taken off, which is given back where the next one returns.
    ``size`` is that of the last return (`_size`), ``stamps_s`` are those of the last ones.
    """

    returns: int = 0
    taken: int = 0
    size: float = 0.0
    stamps_s: Tuple[float, ...] = ()

    def after(self, size: float, is_back: bool, at_s: float) -> _Switches:
        """Return the count after a step of a size that returns, or leads elsewhere."""
        if is_back:
            stamps_s = (*self.stamps_s[1 - _SWITCHES :], at_s)
            return _Switches(self.returns + 1 + self.taken, 0, size, stamps_s)
        if size <= _MUCH_SMALLER * self.size:
            return self._replace(taken=0)
        taken = min(self.returns, 1)
        return self._replace(returns=self.returns - taken, taken=taken)


class _Seen(NamedTuple):
    """The last two poses of an edge, and how often it was back: by any step, and by far ones."""

    last: PoseTuple
    before: PoseTuple
    any_step: _Switches = _Switches()
    far: _Switches = _Switches()


_ONE_OF_THEM = "if two programs publish it, record again with one of them"
_LEFT_OVER = (
    "record again without the program that is wrong, e.g. a static_transform_publisher that is "
    "left over"
)


class DoubtfulEdge(NamedTuple):
    """A transform that messages contradict each other in.

    Attributes:
        edge: the transform.
        only_its_pose: what else stands where is not in doubt.
        what: how they do.
        remedy: what to do.
    """

    edge: Edge
    only_its_pose: bool
    what: str
    remedy: str = _ONE_OF_THEM


class Contradiction(NamedTuple):
    """That nobody knows where an edge is, in some spans of time.

    Attributes:
        sentence: how messages contradict each other, and what to do.
        spans_s: from which stamp to which, in order.
    """

    sentence: str
    spans_s: Tuple[Tuple[float, float], ...]

    def covers(self, time_s: float) -> bool:
        """Tell whether it is so at a time [s]."""
        return any(start_s <= time_s <= end_s for start_s, end_s in self.spans_s)

    def and_from(self, start_s: float, end_s: float) -> Contradiction:
        """Return it with another span; what lies before the last one is known already."""
        last_start_s, last_end_s = self.spans_s[-1]
        if start_s > last_end_s:
            return self._replace(spans_s=(*self.spans_s, (start_s, end_s)))
        last = last_start_s, max(end_s, last_end_s)
        return self._replace(spans_s=(*self.spans_s[:-1], last))


class EdgeWatch:
    """Looks at the transforms of a recording; two programs that publish one edge are noticed.

    Attributes:
        contradicted: edges of which messages say what cannot all be right, by far.
    """

    def __init__(self) -> None:
        """Know no edge."""
        self.contradicted: Dict[Edge, Contradiction] = {}
        self._moving: Dict[Edge, _Seen] = {}
        self._fixed: Dict[Edge, PoseTuple] = {}  # the first pose of each
        self._counting: Dict[Edge, PoseTuple] = {}  # the last one, which counts
        self._beside_fixed: Dict[Edge, PoseTuple] = {}  # what moving ones said first of these
        self._parents: Dict[str, str] = {}
        self._doubtful: Dict[Edge, DoubtfulEdge] = {}

    @property
    def doubtful(self) -> List[DoubtfulEdge]:
        """Fixed edges that have two values or move, frames with two parents, poses to and fro."""
        return list(self._doubtful.values())

    def begin_anew(self) -> None:
        """Forget how edges moved: time goes back. What is in doubt stays so."""
        self.contradicted.clear()
        self._moving, self._beside_fixed = {}, {}

    def see_parent(self, edge: Edge) -> None:
        """Note which frame stands in which."""
        known = self._parents.setdefault(edge.child, edge.parent)
        if known != edge.parent and edge not in self._doubtful:
            self._doubtful[edge] = DoubtfulEdge(
                edge,
                False,
                f"frame '{edge.child}' stands in '{known}' and in '{edge.parent}': /tf and "
                f"/tf_static place it twice, and the last message counts",
            )

    def see_fixed(self, message: Any, topic: str = "/tf_static") -> None:
        """Note a TransformStamped of /tf_static, or of what stands for it in a bag."""
        edge, pose = edge_of(message), _pose_tuple(message)
        self.see_parent(edge)
        self._counting[edge] = pose
        apart_m, apart_rad = _apart(self._fixed.setdefault(edge, pose), pose)
        is_new = edge not in self._doubtful or self._doubtful[edge].only_its_pose
        if is_new and (apart_m > _SAME_M or apart_rad > _SAME_RAD):
            self._doubtful[edge] = DoubtfulEdge(
                edge,
                True,
                f"transform '{edge}' has several values in {topic}, which differ by "
                f"{1e3 * apart_m:.1f} mm and {math.degrees(apart_rad):.2f} deg, and the last one "
                f"counts",
            )

    def see_moving(self, message: Any, topic: str = "/tf") -> None:
        """Note a TransformStamped of /tf, or what another topic says of an edge.

        Where it leaves again and again for another place, far from the one before, and is back
        with the next message, it is among the contradicted.
        """
        edge, pose, at_s = edge_of(message), _pose_tuple(message), stamp_s(message)
        self.see_parent(edge)
        if edge in self._counting:
            self._compare_with_fixed(edge, pose, at_s, topic)
        seen = self._moving.get(edge) or _Seen(pose, pose)
        step_m, step_rad = _apart(pose, seen.last)
        is_step = step_m > _SAME_M or step_rad > _SAME_RAD
        is_far = step_m > _OTHER_M or step_rad > _OTHER_RAD
        size = _size(step_m, step_rad)
        is_back = is_step and _size(*_apart(pose, seen.before)) <= _MUCH_SMALLER * size
        any_step = seen.any_step.after(size if is_step else 0.0, is_back, at_s)
        far = seen.far.after(size if is_far else 0.0, is_far and is_back, at_s)
        self._moving[edge] = _Seen(pose, seen.last, any_step, far)
        if not is_back or max(any_step.returns, far.returns) < _SWITCHES:
            return
        what = (
            f"transform '{edge}' of {topic} goes to and fro between two values, "
            f"{1e3 * step_m:.1f} mm and {math.degrees(step_rad):.2f} deg apart"
        )
        if is_far and far.returns >= _SWITCHES:
            what += ": two programs publish it and contradict each other"
            doubt = DoubtfulEdge(edge, False, what, "record again with one of them")
            self._contradict(doubt, *_around(far.stamps_s))
            return
        flickers = f"{_ONE_OF_THEM}; if its readings flicker, let its driver smooth them"
        self._doubtful.setdefault(edge, DoubtfulEdge(edge, False, what, flickers))

    def _compare_with_fixed(self, edge: Edge, pose: PoseTuple, at_s: float, topic: str) -> None:
        """Note that an edge of /tf_static is elsewhere in a message of another topic."""
        apart_m, apart_rad = _apart(self._counting[edge], pose)
        moved_m, moved_rad = _apart(self._beside_fixed.setdefault(edge, pose), pose)
        if apart_m <= _SAME_M and apart_rad <= _SAME_RAD:
            return
        if moved_m > _OTHER_M or moved_rad > _OTHER_RAD:
            what = f"transform '{edge}' stands still in /tf_static, and moves in {topic}"
            doubt = DoubtfulEdge(edge, False, what, _LEFT_OVER)
            self._contradict(doubt, (-math.inf, at_s + _STAYS_SO_S))
        else:
            what = (
                f"transform '{edge}' has one pose in /tf_static and another one in {topic}, "
                f"{1e3 * apart_m:.1f} mm and {math.degrees(apart_rad):.2f} deg apart, and that of "
                f"/tf_static counts"
            )
            self._doubtful.setdefault(edge, DoubtfulEdge(edge, True, what, _LEFT_OVER))

    def _contradict(self, doubt: DoubtfulEdge, *spans_s: Tuple[float, float]) -> None:
        known = self._doubtful.get(doubt.edge)
        if known is None or known.only_its_pose:
            self._doubtful[doubt.edge] = doubt
        sentence = f"{doubt.what}; {doubt.remedy}"
        found = self.contradicted.get(doubt.edge, Contradiction(sentence, spans_s[:1]))
        for span_s in spans_s:
            found = found.and_from(*span_s)
        self.contradicted[doubt.edge] = found._replace(sentence=sentence)


def _around(stamps_s: Sequence[float]) -> List[Tuple[float, float]]:
    """Return the times around stamps [s] at which two programs contradict each other.

    A program that publishes seldom does so between its messages, too. One that is late while the
    robot moves agrees with the other one where it stands.
    """
    reach_s = max(_STAYS_SO_S, 3.0 * float(np.median(np.diff(stamps_s))))
    return [(stamp - reach_s, stamp + reach_s) for stamp in stamps_s]


def _size(distance_m: float, angle_rad: float) -> float:
    """Return how large a step is, as one number."""
    return distance_m / _SAME_M + angle_rad / _SAME_RAD


def _pose_tuple(message: Any) -> PoseTuple:
    t, q = message.transform.translation, message.transform.rotation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def _apart(a: PoseTuple, b: PoseTuple) -> Tuple[float, float]:
    """Return how far two poses are from each other [m], [rad]; there are many of them."""
    distance_m = math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    chord = math.sqrt(
        min(sum((x - sign * y) ** 2 for x, y in zip(a[3:], b[3:])) for sign in (1, -1))
    )
    return distance_m, 4.0 * math.asin(min(chord / 2.0, 1.0))
