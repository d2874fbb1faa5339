"""Correct transforms of a dataset by dragging them in RViz: odometry, boards, mounts.

Shown are the transforms, clouds, labels and boards of one collection, beside those of a reference
collection in grey. Topics: ~data, ~names (MarkerArray), /tf_static.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional

import numpy as np
import rospy
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from atom_calibration.messages.poses import transforms_message
from atom_calibration.modalities.table import ros_modality
from atom_calibration.runtime import options, running
from atom_calibration.runtime.actions import Actions
from atom_calibration.show import markers
from atom_calibration.show.menu_sphere import MenuSphere
from atom_calibration.show.pose_marker import (
    FULL,
    PLANAR,
    MarkerServer,
    MenuEntries,
    Moved,
    PoseMarker,
)
from atom_core.commands.atom_options import TRANSFORM_CORRECTOR, add_meaningless_options
from atom_core.commands.common import add_dataset_option, add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.editing.transform_corrections import TransformCorrections, chosen_edges
from atom_core.errors import SelectionError
from atom_core.geometry import se3
from atom_core.io.dataset_json import read_dataset
from atom_core.model.colours import Colour, colour_of, sensor_colours
from atom_core.model.dataset import Dataset, board_edge, pose, range_points
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

NODE = "transform_corrector"
EXAMPLE = """
rosrun atom_calibration transform_corrector -json dataset.json -pll odom -cll base_footprint
roslaunch atom_calibration transform_corrector.launch json:=a.json parents:=odom children:=base_link
"""
_MENU_PLACE_M = (1.0, 0.0, 0.4)  # in the world, below what is dragged
_BODY_IN_SCALE = 0.25  # size of the ball in the middle of a marker
_LETTERS_IN_SCALE = 0.25  # height of those above the menu
_MOST_POINTS = 6000  # of a cloud that are drawn
_GREY, _LIGHT = (0.6, 0.6, 0.6), (0.9, 0.9, 0.9)


def main() -> int:
    """Run the node; return its exit code."""
    return running.run(NODE, parser(), correct)


def correct(args: argparse.Namespace, name: str = NODE) -> int:
    """Run with parsed options, as a node of this name; return the exit code."""
    output = options.corrected_file(args)
    dataset = read_dataset(args.dataset)
    edges = chosen_edges(args.parent_link_list, args.child_link_list)
    corrections = TransformCorrections(dataset, edges, args.patterns)
    running.start(name)
    moves = PLANAR if args.two_dimensional else FULL
    TransformCorrector(corrections, output, moves, args.marker_scale, args.reference_collection)
    code = running.wait()
    kept = corrections.keep_unsaved(output)
    if kept:
        sys.stderr.write(f"{name}: {kept}\n")
    return code


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
        self._actions = Actions(lambda words: self._menu.show(words))
        self._fixed = running.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self._data = running.Publisher("~data", MarkerArray, queue_size=2, latch=True)
        self._server = MarkerServer(NODE)
        self._reference = _in_world(corrections.dataset, reference) if reference else []
        self._markers: Dict[Edge, PoseMarker] = {}
        colours = sensor_colours(corrections.dataset.config.sensors)
        mounted = {
            sensor.edge: colours[name] for name, sensor in corrections.dataset.sensors.items()
        }
        for edge in corrections.edges:
            self._markers[edge] = self._marker_of(edge, mounted.get(edge, _GREY), moves, scale)
        self._names = running.Publisher("~names", MarkerArray, queue_size=2, latch=True)
        self._names.publish(_frame_names(corrections))
        self._menu = MenuSphere(
            self._server,
            corrections.dataset.world,
            _MENU_PLACE_M,
            self._entries(),
            scale=scale,
            diameter_m=_BODY_IN_SCALE * scale,
            letters_m=_LETTERS_IN_SCALE * scale,
        )
        for name in ("save", "undo", "next", "previous"):
            self._actions.serve(name, getattr(self, name))
        self._show()
        self._menu.show(f"{self._corrections.place}\nright mouse button: next, undo, save")

    def _marker_of(self, edge: Edge, colour: Colour, moves: str, scale: float) -> PoseMarker:
        value = self._corrections.value(edge)
        return PoseMarker(
            self._server,
            str(edge),
            edge.parent,
            np.eye(4) if value is None else value,
            self._moved(edge),
            moves=moves,
            scale=scale,
            shapes=[markers.sphere("", _BODY_IN_SCALE * scale, colour)],
            menu=[
                self._actions.entry(f"Reset {edge}", lambda: self.reset(edge)),
                *self._entries(),
            ],
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

    def _entries(self) -> MenuEntries:
        return [
            self._actions.entry("Next collection", self.next),
            self._actions.entry("Previous collection", self.previous),
            self._actions.entry("Undo", self.undo),
            self._actions.entry("Save", self.save),
        ]

    def _moved(self, edge: Edge) -> Any:
        def moved(move: Moved) -> None:
            with self._actions.lock:
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
        self._menu.show(self._corrections.place)
        self._publish_transforms()
        shapes = _in_sensor_frames(self._corrections.dataset, self._corrections.collection)
        clear = Marker(action=Marker.DELETEALL)
        self._data.publish(MarkerArray([clear, *markers.numbered([*shapes, *self._reference])]))

    def _publish_transforms(self) -> None:
        stamp = rospy.Time.now()
        transforms = self._corrections.dataset.collections[self._corrections.collection].transforms
        self._fixed.publish(transforms_message(transforms, stamp))


def _frame_names(corrections: TransformCorrections) -> MarkerArray:
    """Return the names of the sensors, and of the frames whose transforms are corrected."""
    config = corrections.dataset.config
    shown = markers.sensor_names(config, sensor_colours(config.sensors))
    sensors = {entry.link for entry in config.sensors.values()}
    frames = {frame for edge in corrections.edges for frame in (edge.parent, edge.child)}
    for frame in sorted(frames - sensors):
        shown.markers.append(markers.name(frame, frame, _LIGHT, f"frame {frame}"))
    return shown


def _in_sensor_frames(dataset: Dataset, key: str) -> List[Marker]:
    """Return clouds, labeled points and boards of a collection, each in its own frame."""
    shapes: List[Marker] = []
    collection = dataset.collections[key]
    colours = sensor_colours(dataset.config.sensors)
    for sensor in dataset.sensors.values():
        cloud = _cloud(dataset, key, sensor)
        if cloud is not None:
            shapes.append(markers.points(sensor.frame, cloud, 0.01, colours[sensor.name], "clouds"))
    for detection, _ in dataset.detections():
        sensor = dataset.sensors[detection.sensor]
        if detection.collection == key and sensor.kind.measures_range:
            labeled = _thinned(range_points(dataset, detection).inside)
            shapes.append(markers.points(sensor.frame, labeled, 0.02, (0.1, 0.9, 0.1), "labels"))
    for number, pattern in enumerate(dataset.patterns.values()):
        if board_edge(pattern) in collection.transforms:
            shapes += markers.board(pattern, colour_of(number))
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
    made = OptionParser(prog=NODE, description=__doc__.split("\n")[0], epilog=examples(EXAMPLE))
    add_dataset_option(made)
    _add_choice(made)
    add_option(
        made, "two_dimensional", "-2d", action="store_true", help="move in x, y and yaw only"
    )
    options.add_marker_scale_option(made)
    options.add_corrected_options(made)
    add_meaningless_options(made, TRANSFORM_CORRECTOR)
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
