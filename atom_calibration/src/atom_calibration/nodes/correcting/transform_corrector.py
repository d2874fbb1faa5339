"""Correct transforms of a dataset by dragging them in RViz: odometry, boards, mounts.

Shown are the transforms, clouds, labels and boards of one collection, beside those of a reference
collection in grey. Topics: ~data (MarkerArray), /tf_static.
"""

from __future__ import annotations

import argparse
import threading
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np
import rospy
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from atom_calibration.messages.poses import transform_message
from atom_calibration.modalities.table import ros_modality
from atom_calibration.runtime import running
from atom_calibration.show import markers
from atom_calibration.show.pose_marker import FULL, PLANAR, STILL, MarkerServer, Moved, PoseMarker
from atom_core.commands.common import add_option
from atom_core.editing.transform_corrections import TransformCorrections, chosen_edges
from atom_core.errors import AtomError, OutputError, SelectionError
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset, board_edge, pose, range_points
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

NODE = "transform_corrector"
EXAMPLE = (
    "rosrun atom_calibration transform_corrector -json dataset.json -pll odom -cll base_footprint"
)
_MENU_PLACE = (1.0, 0.0, 1.0)  # in the world [m]
_MOST_POINTS = 6000  # of a cloud that are drawn
_GREY, _WHITE = (0.6, 0.6, 0.6), (0.9, 0.9, 0.9)


def main() -> int:
    """Run the node; return its exit code."""
    args = parser().parse_args(rospy.myargv()[1:])
    return running.guarded(NODE, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    output = args.output or args.dataset.with_name("dataset_corrected.json")
    if output.exists() and not args.overwrite:
        raise OutputError(f"{output}: exists already; add --overwrite, or give another --output")
    dataset = read_dataset(args.dataset)
    edges = chosen_edges(args.parent_link_list, args.child_link_list)
    corrections = TransformCorrections(dataset, edges, args.patterns)
    running.start(NODE)
    moves = PLANAR if args.two_dimensional else FULL
    TransformCorrector(corrections, output, moves, args.marker_scale, args.reference_collection)
    return running.wait()


class TransformCorrector:
    """Markers, transforms, pictures of the data and services around `TransformCorrections`."""

    def __init__(
        self,
        corrections: TransformCorrections,
        output: Path,
        moves: str,
        scale: float,
        reference: str = "",
    ):
        """Show the first collection.

        Args:
            corrections: what is edited.
            output: the file that is saved.
            moves: FULL or PLANAR.
            scale: size of the markers [m].
            reference: key of the collection that is shown in grey; empty: none.
        """
        self._corrections, self._output = corrections, output
        self._lock = threading.RLock()
        self._fixed = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self._data = rospy.Publisher("~data", MarkerArray, queue_size=2, latch=True)
        self._server = MarkerServer(NODE)
        self._reference = _in_world(corrections.dataset, reference) if reference else []
        self._markers: Dict[Edge, PoseMarker] = {}
        for number, edge in enumerate(corrections.edges):
            self._markers[edge] = self._marker_of(edge, markers.colour_of(number), moves, scale)
        place = np.eye(4)
        place[:3, 3] = _MENU_PLACE
        self._menu = PoseMarker(
            self._server,
            "menu",
            corrections.dataset.world,
            place,
            moves=STILL,
            scale=scale,
            shapes=[markers.sphere("", 0.25 * scale, _WHITE)],
            menu=self._entries(),
        )
        for name in ("save", "undo", "next", "previous"):
            action = getattr(self, name)
            rospy.Service(f"~{name}", Trigger, lambda _, a=action: self._answer(a))
        self._show()

    def _marker_of(
        self, edge: Edge, colour: markers.Colour, moves: str, scale: float
    ) -> PoseMarker:
        value = self._corrections.value(edge)
        return PoseMarker(
            self._server,
            str(edge),
            edge.parent,
            np.eye(4) if value is None else value,
            self._moved(edge),
            moves=moves,
            scale=scale,
            description=str(edge),
            shapes=[markers.sphere("", 0.25 * scale, colour)],
            menu=[(f"Reset {edge}", self._act(lambda: self.reset(edge))), *self._entries()],
        )

    def save(self) -> str:
        """Write the corrected dataset."""
        return self._corrections.save(self._output)

    def undo(self) -> str:
        """Take back the last drag."""
        undone = self._corrections.undo()
        self._show()
        return "taken back" if undone else "there is nothing to take back"

    def reset(self, edge: Edge) -> str:
        """Put an edge back to what the dataset had."""
        self._corrections.reset_edge(edge)
        self._show()
        return f"{edge} is as it was"

    def next(self) -> str:
        """Show the next collection."""
        return self._turn(1)

    def previous(self) -> str:
        """Show the collection before."""
        return self._turn(-1)

    def _turn(self, steps: int) -> str:
        self._corrections.turn(steps)
        self._show()
        return self._corrections.place

    def _entries(self) -> List[Any]:
        named = [("Next collection", self.next), ("Previous collection", self.previous)]
        named += [("Undo", self.undo), ("Save", self.save)]
        return [(title, self._act(action)) for title, action in named]

    def _act(self, action: Any) -> Any:
        def act() -> None:
            answer = self._answer(action)
            self._menu.redraw([markers.sphere("", 0.25 * self._menu.scale, _WHITE)], answer.message)
            (rospy.loginfo if answer.success else rospy.logerr)(answer.message)

        return act

    def _answer(self, action: Any) -> TriggerResponse:
        with self._lock:
            try:
                return TriggerResponse(True, action())
            except AtomError as error:
                return TriggerResponse(False, str(error))

    def _moved(self, edge: Edge) -> Any:
        def moved(move: Moved) -> None:
            with self._lock:
                self._corrections.set(edge, move.frame_T_marker, move.dropped)
                self._publish_transforms()

        return moved

    def _show(self) -> None:
        """Draw the collection that is chosen."""
        for edge, marker in self._markers.items():
            value = self._corrections.value(edge)
            if value is not None:
                marker.move(value)
            marker.show(value is not None)
        self._menu.redraw(
            [markers.sphere("", 0.25 * self._menu.scale, _WHITE)], self._corrections.place
        )
        self._publish_transforms()
        shapes = _in_sensor_frames(self._corrections.dataset, self._corrections.collection)
        clear = Marker(action=Marker.DELETEALL)
        self._data.publish(MarkerArray([clear, *markers.numbered([*shapes, *self._reference])]))

    def _publish_transforms(self) -> None:
        stamp = rospy.Time.now()
        transforms = self._corrections.dataset.collections[self._corrections.collection].transforms
        self._fixed.publish(
            TFMessage([transform_message(e, m, stamp) for e, m in transforms.items()])
        )


def _in_sensor_frames(dataset: Dataset, key: str) -> List[Marker]:
    """Return clouds, labeled points and boards of a collection, each in its own frame."""
    shapes: List[Marker] = []
    collection = dataset.collections[key]
    for number, sensor in enumerate(dataset.sensors.values()):
        colour = markers.colour_of(number)
        cloud = _cloud(dataset, key, sensor)
        if cloud is not None:
            shapes.append(markers.points(sensor.frame, cloud, 0.01, colour, "clouds"))
    for detection, _ in dataset.detections():
        sensor = dataset.sensors[detection.sensor]
        if detection.collection == key and sensor.kind.measures_range:
            labeled = _thinned(range_points(dataset, detection).inside)
            shapes.append(markers.points(sensor.frame, labeled, 0.02, (0.1, 0.9, 0.1), "labels"))
    for number, pattern in enumerate(dataset.patterns.values()):
        if board_edge(pattern) in collection.transforms:
            shapes += markers.board(pattern, markers.colour_of(number))
    return shapes


def _in_world(dataset: Dataset, key: str) -> List[Marker]:
    """Return the clouds of a collection in grey, in the world."""
    if key not in dataset.collections:
        raise SelectionError(
            f"there is no collection '{key}' to compare with; use one of "
            f"{', '.join(dataset.collections)}"
        )
    shapes = []
    for sensor in dataset.sensors.values():
        cloud = _cloud(dataset, key, sensor)
        if cloud is not None:
            world_T_sensor = pose(
                dataset.collections[key], dataset.graph, dataset.world, sensor.frame
            )
            cloud = se3.apply(world_T_sensor, cloud)
            shapes.append(markers.points(dataset.world, cloud, 0.01, _GREY, "reference"))
    return shapes


def _cloud(dataset: Dataset, key: str, sensor: Sensor) -> Optional[np.ndarray]:
    """Return what a sensor measured, thinned (n, 3) [m]; None of images, and without data."""
    to_cloud = ros_modality(sensor.modality).cloud
    if to_cloud is None or not dataset.data.has_data(key, sensor.name):
        return None
    return _thinned(to_cloud(dataset.data.read(key, sensor.name)))


def _thinned(points: np.ndarray) -> np.ndarray:
    points = points[np.all(np.isfinite(points), axis=1)]
    return points[:: max(len(points) // _MOST_POINTS, 1)]


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = argparse.ArgumentParser(
        prog=NODE, description=__doc__.split("\n")[0], epilog=f"example: {EXAMPLE}"
    )
    add_option(
        made,
        "dataset",
        "-json",
        "--json_file",
        required=True,
        type=Path,
        metavar="FILE",
        help="the dataset's JSON",
    )
    _add_choice(made)
    add_option(
        made, "two_dimensional", "-2d", action="store_true", help="move in x, y and yaw only"
    )
    add_option(
        made,
        "marker_scale",
        "-s",
        type=running.positive,
        default=0.6,
        metavar="M",
        help="size of the markers in metres (default: 0.6)",
    )
    add_option(
        made,
        "output",
        "-o",
        type=Path,
        metavar="FILE",
        help="what is saved (default: dataset_corrected.json beside the dataset)",
    )
    add_option(made, "overwrite", "-ow", action="store_true", help="replace an existing file")
    return made


def _add_choice(made: argparse.ArgumentParser) -> None:
    """Add the options that say what is corrected, and beside what it is shown."""
    for name, short, what in (("parent", "-pll", "parents"), ("child", "-cll", "children")):
        add_option(
            made,
            f"{name}_link_list",
            short,
            nargs="*",
            default=[],
            metavar="FRAME",
            help=f"{what} of the edges to correct",
        )
    add_option(
        made,
        "patterns",
        "-p",
        nargs="*",
        default=[],
        metavar="NAME",
        help="boards whose pose is to be corrected (for calibrate --anchor_patterns)",
    )
    add_option(
        made,
        "reference_collection",
        "-rc",
        default="",
        metavar="KEY",
        help="collection whose clouds are shown in grey",
    )
