"""How a person tells a range sensor where the board is: marker, service, click on a depth image."""

from __future__ import annotations

from typing import Any, Callable, List, Optional

import numpy as np
import rospy
from geometry_msgs.msg import PointStamped

from atom_calibration.errors import CollectionError
from atom_calibration.labels.manual_seeds import check_inside
from atom_calibration.modalities.frames import Frame
from atom_calibration.modalities.seeds import SeedInput
from atom_calibration.nodes.collecting.seed_marker import OnSeed, SeedMarker
from atom_calibration.runtime.graph_names import topic_of
from atom_calibration.srv import SetSeed, SetSeedResponse
from atom_core.errors import AtomError
from atom_core.io.seeds import Seed
from atom_core.model.sensor import Sensor


class SeedListener:
    """The marker on /SENSOR/data_labeler, the service /SENSOR/set_seed, clicks on depth images."""

    def __init__(
        self,
        sensor: Sensor,
        seeds: SeedInput,
        on_seed: OnSeed,
        last: Callable[[], Optional[Frame]],
    ):
        """Listen.

        Args:
            sensor: one that needs seeds.
            seeds: what a seed of its modality means.
            on_seed: is told the seed, or None: automatic again; called in threads of ROS.
            last: returns the last data, in which a seed has to lie; None: there are none yet.
        """
        self._sensor, self._on_seed, self._last = sensor, on_seed, last
        self._marker = SeedMarker(sensor, seeds, on_seed)
        rospy.Service(topic_of(sensor.name, "set_seed"), SetSeed, self._serve)
        if seeds.from_clicks:
            clicks = f"{sensor.topic}/labeled/mouse_click"
            rospy.Subscriber(clicks, PointStamped, self._click, queue_size=1)

    def show(self, frame: Frame, by_hand: Optional[np.ndarray]) -> None:
        """Let the marker show what a labeled frame says."""
        self._marker.show(frame, by_hand)

    def _serve(self, request: Any) -> SetSeedResponse:
        try:
            return SetSeedResponse(True, self._set(list(request.position)))
        except AtomError as error:
            return SetSeedResponse(False, str(error))

    def _click(self, message: PointStamped) -> None:
        try:
            rospy.loginfo(self._set([message.point.x, message.point.y]))
        except AtomError as error:
            rospy.logwarn(str(error))

    def _set(self, position: List[float]) -> str:
        """Set, or with nothing clear, the seed; return what to tell the user."""
        sensor = self._sensor
        if not position:
            self._on_seed(None)
            return f"sensor '{sensor.name}': seeds are automatic again"
        form = sensor.kind.seed
        if form is None:
            raise CollectionError(f"sensor '{sensor.name}': a {sensor.kind.noun} needs no seed")
        count, unit = form.size, form.unit
        if len(position) != count or not np.all(np.isfinite(position)):
            raise CollectionError(
                f"sensor '{sensor.name}': a seed has to be {count} finite numbers ({unit}), not "
                f"{[round(v, 3) for v in position]}"
            )
        seed, frame = Seed(sensor.name, np.array(position)), self._last()
        if frame is not None:
            check_inside(seed, frame, "choose a place on the board")
        self._on_seed(seed.position)
        return f"sensor '{sensor.name}': the board is looked for at {position} {unit}"
