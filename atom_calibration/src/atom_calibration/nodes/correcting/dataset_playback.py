"""Go through the collections of a dataset and correct their labels in RViz.

Shown are data, labels and transforms of one collection. Points chosen with the tool "Label points",
clicks and polygons in images (TOPIC/labeled2d) correct it; each correction can be undone. In the
mode "Border" of an image a board's border is drawn, for evaluations (annotation_SENSOR.json). Saved
is dataset_corrected.json beside the dataset: on request, when another collection is shown, and at
the end.
"""

from __future__ import annotations

import argparse
import threading
from functools import partial
from pathlib import Path
from typing import Any, Callable, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import PointStamped, PolygonStamped
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from atom_calibration.msg import BorderStroke, CollectionStates, LabelState, PlaybackState
from atom_calibration.nodes.correcting.playback_input import (
    KeyPress,
    check_shown,
    chosen_points,
    pixel_of,
    pixels_of,
    sensor_of,
)
from atom_calibration.nodes.correcting.playback_topics import CollectionTopics
from atom_calibration.runtime import options, running
from atom_calibration.show import playback_view as view
from atom_calibration.show.menu_sphere import BLUE, ORANGE, MenuSphere
from atom_calibration.show.pose_marker import MarkerServer, MenuEntries
from atom_calibration.srv import (
    DeleteLabel,
    DeleteLabelResponse,
    SelectPattern,
    SelectPatternResponse,
    ShowCollection,
    ShowCollectionResponse,
)
from atom_core.commands.atom_options import DATASET_PLAYBACK, add_meaningless_options
from atom_core.commands.common import add_dataset_option, add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.editing.drawn_borders import LEAVE, DrawnBorders
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.errors import AtomError, OutputError
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

NODE = "dataset_playback"
EXAMPLE = """
rosrun atom_calibration dataset_playback -json dataset.json
roslaunch my_robot_calibration dataset_playback.launch dataset:=$PWD/data/dataset.json
"""
_POINT_TOPICS = {
    "add": "/rviz/selected_points",
    "add_border": "/rviz/selected_border_points",
    "remove": "/rviz/selected_remove_points",
    "clear": "/rviz/selected_clear_all_points",
}
_MENU_PLACE_M = (0.0, 0.0, 1.0)  # above the world's origin; orange: something is not saved
_LAST_WORDS_S = 0.5  # until the answer to `quit` has been heard
_BUFFER_BYTES = 2**25


def main() -> int:
    """Run the node; return its exit code."""
    return running.run(NODE, parser(), _run)


def _run(args: argparse.Namespace) -> int:
    dataset = read_dataset(args.dataset)
    output = options.corrected_file(args)
    corrections = LabelCorrections(dataset)
    if args.collection:
        corrections.show(args.collection)
    running.start(NODE)
    playback = DatasetPlayback(corrections, output, args.marker_size)
    code = running.wait()
    playback.finish()
    return code


class DatasetPlayback:
    """Services, topics and the menu around `LabelCorrections`."""

    def __init__(self, corrections: LabelCorrections, output: Path, marker_size_m: float):
        """Advertise, and show the collection.

        Args:
            corrections: what is edited.
            output: the file that is saved.
            marker_size_m: diameter of the sphere with the menu.
        """
        self._corrections, self._output = corrections, output
        self._lock = threading.RLock()
        self._polygon_removes_border = self._has_saved = False
        self._press = KeyPress()
        self._figures: Optional[Tuple[Dataset, str, List[LabelState]]] = None
        self._borders = DrawnBorders(corrections.dataset)
        self._topics = CollectionTopics(corrections, self._borders)
        self._state = running.Publisher("~state", PlaybackState, queue_size=10, latch=True)
        self._matrix = running.Publisher("~collections", CollectionStates, queue_size=2, latch=True)
        self._menu = MenuSphere(
            MarkerServer(NODE),
            corrections.dataset.world,
            _MENU_PLACE_M,
            self._entries(),
            scale=marker_size_m,
            diameter_m=marker_size_m,
        )
        with self._lock:
            self._show_collection()
            self._tell(f"{self._corrections.place}; corrections go to {output}")
        self._serve()
        self._listen()

    # --- what can be asked for ----------------------------------------------------------------

    def next(self) -> str:
        """Show the next collection; what is not saved is saved."""
        return self._turn(lambda: self._corrections.turn(1))

    def previous(self) -> str:
        """Show the collection before."""
        return self._turn(lambda: self._corrections.turn(-1))

    def undo(self) -> str:
        """Take back the last correction."""
        return self._step(self._corrections.undo)

    def redo(self) -> str:
        """Make it again."""
        return self._step(self._corrections.redo)

    def reset(self) -> str:
        """Put the collection's labels back to what the dataset had."""
        return self._step(self._corrections.reset)

    def save(self) -> str:
        """Write the corrected dataset."""
        words = self._corrections.save(self._output)
        self._has_saved = True
        return words

    def quit(self) -> str:
        """Save what is not saved, and end."""
        words = self.save() if self._corrections.unsaved else "nothing was left to save"
        # not rospy's timer, which waits for ever where ROS's clock stands still
        threading.Timer(_LAST_WORDS_S, running.end_waiting).start()
        return words

    def finish(self) -> None:
        """Save what is not saved; tell where nothing is corrected."""
        with self._lock:
            if self._corrections.unsaved:
                rospy.loginfo(self.save())
            elif not self._has_saved:
                source = self._corrections.dataset.source
                rospy.loginfo(
                    f"nothing was corrected, and {self._output} is not written; "
                    f"the next step takes {source}"
                )

    def _turn(self, turn: Callable[[], str]) -> str:
        """Show another collection, even where the corrections so far cannot be saved."""
        turn()
        self._show_collection()
        if not self._corrections.unsaved:
            return self._corrections.place
        try:
            return f"{self._corrections.place}; {self.save()}"
        except OutputError as error:
            raise OutputError(f"{self._corrections.place}, but nothing is saved: {error}") from None

    def _step(self, act: Callable[[], str]) -> str:
        before = self._corrections.collection
        words = act()
        if self._corrections.collection != before:
            self._show_collection()
        else:
            self._topics.show_all_labels()
        return words

    def _select_pattern(self, name: str) -> str:
        words = self._corrections.select_pattern(name)
        self._topics.show_all_labels()  # with the border of this one
        return words

    def _toggle_polygons(self) -> str:
        return self._set_polygons(not self._polygon_removes_border)

    def _set_polygons(self, remove_border: bool) -> str:
        self._polygon_removes_border = remove_border
        done = "lose their border pixels" if remove_border else "are labeled anew"
        return f"depth images {done} inside a polygon"

    # --- services, topics, menu ---------------------------------------------------------------

    def _serve(self) -> None:
        for name in ("next", "previous", "undo", "redo", "reset", "save", "quit"):
            action = getattr(self, name)
            rospy.Service(f"~{name}", Trigger, lambda _, a=action: TriggerResponse(*self._do(a)))
        corrections = self._corrections
        rospy.Service(
            "~show_collection",
            ShowCollection,
            lambda r: ShowCollectionResponse(
                *self._do(lambda: self._turn(lambda: corrections.show(r.collection_name)))
            ),
        )
        rospy.Service(
            "~delete_label",
            DeleteLabel,
            lambda r: DeleteLabelResponse(
                *self._do(
                    lambda: self._corrected(
                        r.sensor, corrections.delete_label(r.sensor, r.pattern_name)
                    )
                )
            ),
        )
        rospy.Service(
            "~select_pattern",
            SelectPattern,
            lambda r: SelectPatternResponse(
                *self._do(lambda: self._select_pattern(r.pattern_name))
            ),
        )
        rospy.Service(
            "~polygon_removes_border",
            SetBool,
            lambda r: SetBoolResponse(*self._do(lambda: self._set_polygons(bool(r.data)))),
        )

    def _entries(self) -> MenuEntries:
        return [
            (title, partial(self._do, act))
            for title, act in (
                ("Next collection", self.next),
                ("Previous collection", self.previous),
                ("Undo", self.undo),
                ("Redo", self.redo),
                ("Reset collection", self.reset),
                ("Polygons remove border on/off", self._toggle_polygons),
                ("Save", self.save),
            )
        ]

    def _listen(self) -> None:
        for kind, topic in _POINT_TOPICS.items():
            rospy.Subscriber(
                topic,
                PointCloud2,
                self._hear(partial(self._points, kind)),
                queue_size=20,
                buff_size=_BUFFER_BYTES,
            )
        for name, sensor in self._topics.sensors.items():
            if not sensor.kind.has_camera_info:
                continue
            topic = f"{view.data_topic(sensor)}/{view.IMAGES}"
            for ending, message, act in (
                ("mouse_click", PointStamped, self._clicked),
                ("right_click", PointStamped, self._right_clicked),
                ("polygon", PolygonStamped, self._polygon),
                ("border", BorderStroke, self._border),
            ):
                heard = self._hear(partial(act, name))
                rospy.Subscriber(f"{topic}/{ending}", message, heard, queue_size=20)

    def _hear(self, act: Callable[[Any], str]) -> Callable[[Any], None]:
        def hear(message: Any) -> None:
            self._do(lambda: act(message))

        return hear

    def _do(self, act: Callable[[], str]) -> Tuple[bool, str]:
        """Do something; tell what came of it. Nothing that goes wrong here ends the node."""
        with self._lock:
            try:
                words = act()
            except AtomError as error:
                self._tell(str(error), failed=True)
                return False, str(error)
            self._tell(words)
            return True, words

    # --- corrections --------------------------------------------------------------------------

    def _points(self, kind: str, message: Any) -> str:
        """Correct the label of a cloud; clouds chosen by one key press are one step to undo."""
        sensor = sensor_of(message.header, self._topics.sensors, self._topics.shown)
        steps, same_press = self._corrections.undo_steps, self._press.is_still(kind, sensor)
        words = self._corrected(sensor, self._correct_points(kind, sensor, message))
        if self._corrections.undo_steps > steps:
            if same_press and self._press.has_step:
                self._corrections.join_last_steps()
            self._press.has_step = True
        return words

    def _correct_points(self, kind: str, sensor: str, message: Any) -> str:
        corrections = self._corrections
        if kind == "clear":
            return corrections.delete_label(sensor)
        indices = chosen_points(message)
        if kind == "remove":
            return corrections.remove_points(sensor, indices)
        return corrections.add_points(sensor, indices, border=kind == "add_border")

    def _clicked(self, sensor: str, message: Any) -> str:
        pixel = pixel_of(message, self._topics.shown[sensor].frame)
        click = self._topics.shown[sensor].frame.ros.click
        assert click is not None
        return self._corrected(sensor, click(self._corrections, sensor, pixel))

    def _right_clicked(self, sensor: str, message: Any) -> str:
        pixel = pixel_of(message, self._topics.shown[sensor].frame)
        return self._corrected(sensor, self._corrections.remove_corner(sensor, pixel))

    def _polygon(self, sensor: str, message: Any) -> str:
        polygon = pixels_of(message, self._topics.shown[sensor].frame)
        correct = self._topics.shown[sensor].frame.ros.polygon
        assert correct is not None
        removes_border = self._polygon_removes_border
        return self._corrected(sensor, correct(self._corrections, sensor, polygon, removes_border))

    def _border(self, sensor: str, message: Any) -> str:
        """Draw a board's border: a point, or what a key does."""
        corrections = self._corrections
        place = DetectionKey(corrections.collection, sensor, corrections.pattern)
        if message.key != LEAVE:
            check_shown(message, self._topics.shown[sensor].frame)
        if not message.key:
            words = self._borders.click(place, np.array([message.x, message.y]))
            return self._corrected(sensor, words)
        press = self._borders.press(place, message.key)
        if press.collection != self._corrections.collection:
            self._turn(lambda: self._corrections.show(press.collection))
        return self._corrected(sensor, press.words)

    def _corrected(self, sensor: str, words: str) -> str:
        self._topics.show_labels(sensor)
        return words

    # --- what is told -------------------------------------------------------------------------

    def _show_collection(self) -> None:
        """Publish the collection, and print how good its labels are."""
        self._topics.show_collection()
        rospy.loginfo("\n" + view.quality_table(self._corrections.place, self._label_states()))

    def _label_states(self) -> List[LabelState]:
        """Return the figures of the labels, computed once for each state of the dataset."""
        now = (self._corrections.dataset, self._corrections.collection)
        if self._figures is None or self._figures[0] is not now[0] or self._figures[1] != now[1]:
            problems = {name: shown.problem for name, shown in self._topics.shown.items()}
            self._figures = (*now, view.label_states(self._corrections, problems))
        return self._figures[2]

    def _tell(self, words: str, failed: bool = False) -> None:
        """Publish the state with a sentence for the user."""
        (rospy.logwarn if failed else rospy.loginfo)(words)
        corrections = self._corrections
        self._state.publish(
            PlaybackState(
                dataset=str(corrections.dataset.source),
                output=str(self._output),
                collection=corrections.collection,
                pattern_name=corrections.pattern,
                number=corrections.keys.index(corrections.collection) + 1,
                collections=len(corrections.keys),
                undo_steps=corrections.undo_steps,
                polygon_removes_border=self._polygon_removes_border,
                redo_steps=corrections.redo_steps,
                unsaved=corrections.unsaved,
                labels=self._label_states(),
                failed=failed,
                message=words,
            )
        )
        self._matrix.publish(view.collection_states(corrections.dataset))
        self._menu.show(corrections.place, ORANGE if corrections.unsaved else BLUE)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(
        prog=NODE,
        description=__doc__,
        epilog=examples(EXAMPLE),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_dataset_option(made)
    options.add_corrected_options(made)
    add_option(
        made,
        "collection",
        "-c",
        default="",
        metavar="KEY",
        help="collection to begin with (default: the first)",
    )
    options.add_marker_size_option(made, 0.3)
    add_meaningless_options(made, DATASET_PLAYBACK)
    return made
