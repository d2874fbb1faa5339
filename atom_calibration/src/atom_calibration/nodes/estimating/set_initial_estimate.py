"""Drag the sensors in RViz to where they are, and save that as the first guess.

One marker for each free sensor and additional tf, in its parent's frame. The node publishes all
fixed transforms of the description, the edited ones among them; robot_state_publisher publishes
only those of moving joints (set_initial_estimate.launch renames its /tf_static), so that nobody
competes, and what RViz shows follows the drag.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from atom_calibration.errors import MessageError
from atom_calibration.messages.cameras import camera_from_info
from atom_calibration.messages.poses import transforms_message
from atom_calibration.msg import GuessState, SensorGuess
from atom_calibration.nodes.estimating.guess_watch import GuessWatch
from atom_calibration.runtime import options, running
from atom_calibration.runtime.actions import Actions
from atom_calibration.runtime.graph_names import check_graph_names, graph_name, topic_of
from atom_calibration.show import markers
from atom_calibration.show.menu_sphere import MenuSphere
from atom_calibration.show.pose_marker import MarkerServer, MenuEntries, Moved, PoseMarker
from atom_calibration.sources.described_bag import first_guess_file
from atom_calibration.srv import (
    GetSensorInteractiveMarker,
    GetSensorInteractiveMarkerResponse,
    SetSensorInteractiveMarker,
    SetSensorInteractiveMarkerResponse,
)
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser, examples
from atom_core.editing.first_guess import FirstGuess, values_from_dataset
from atom_core.errors import ConfigError
from atom_core.geometry import se3
from atom_core.io.config_yaml import read_config
from atom_core.io.urdf import read_description
from atom_core.model.colours import Colour, colour_of, in_order, packed, sensor_colours
from atom_core.model.config import CalibrationConfig
from atom_core.model.modality import modality_named

NODE = "set_initial_estimate"
EXAMPLE = """
rosrun atom_calibration set_initial_estimate -c config.yml -d cell.urdf.xacro
roslaunch my_robot_calibration set_initial_estimate.launch from_dataset:=$PWD/data/dataset.json
"""
_MENU_PLACE_M = (1.0, 0.0, 1.0)  # in the world, as ATOM has it
_GREY_PLACE = 8  # in the palette: of what is no sensor
_BODY_IN_SCALE = 0.25  # size of the ball in the middle of a marker


def main() -> int:
    """Run the node; return its exit code."""
    return running.run(NODE, parser(), _run)


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config_file)
    description = args.description_file or _description(args.config_file)
    guess = FirstGuess(config, read_description(description))
    check_graph_names([*config.sensors, *guess.edges])
    remarks = [f"{remark}, so it has no marker" for remark in guess.remarks]
    if args.from_dataset:
        placed = values_from_dataset(Path(args.from_dataset))
        missing = guess.start_from(placed.values)
        remarks += placed.remarks
        remarks += [
            f"'{name}' is not in {args.from_dataset} and starts where the description has it"
            for name in missing
        ]
    running.start(NODE)
    for remark in remarks:
        rospy.logwarn(remark)
    output = args.filename or description
    SetInitialEstimate(config, guess, output, args.marker_scale)
    code, moved = running.wait(), guess.unsaved
    kept = guess.keep_unsaved(output)
    if kept is not None:
        sys.stderr.write(
            f"{NODE}: nobody saved where {', '.join(moved)} was put; that is in {kept}: rename it "
            f"to {output.name}, or begin with description_file:={kept}\n"
        )
    return code


def _description(config_file: Path) -> Path:
    """Return the first guess of the package of a configuration.

    Raises:
        ConfigError: there is none.
    """
    file = first_guess_file(config_file)
    if not file.exists():
        raise ConfigError(
            f"{file} is not there, with which the package of {config_file} would begin; run "
            f"`rosrun PKG configure`, or name the description: -d FILE"
        )
    return file


class SetInitialEstimate:
    """Markers, transforms, frustums and services around a `FirstGuess`."""

    def __init__(self, config: CalibrationConfig, guess: FirstGuess, output: Path, scale: float):
        """Show the markers and publish the transforms.

        Args:
            config: names, frames and topics of the sensors.
            guess: what is edited.
            output: the file that is saved.
            scale: size of the markers [m].
        """
        self._config, self._guess, self._output = config, guess, output
        self._colours = sensor_colours(config.sensors)
        self._start = {name: guess.value(name) for name in guess.edges}
        self._told: Tuple[str, bool] = ("", False)
        self._watch: Optional[GuessWatch] = None
        self._actions = Actions(lambda words: self._menu.show(words), self._tell)
        self._state = running.Publisher("~state", GuessState, queue_size=2, latch=True)
        names = running.Publisher("~names", MarkerArray, queue_size=2, latch=True)
        held = [name for name in config.sensors if name not in guess.edges]
        names.publish(markers.sensor_names(config, self._colours, held))
        self._names = names  # lives as long as the node
        self._fixed = running.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self._server = MarkerServer(NODE)
        self._markers = self._sensor_markers(scale)
        self._menu = MenuSphere(
            self._server,
            config.world_link,
            _MENU_PLACE_M,
            self._common_entries(),
            scale=scale,
            diameter_m=_BODY_IN_SCALE * scale,
            words="save, reset: right mouse button",
        )
        self._frustums = [
            _Frustum(name, entry.topic_name, entry.link, self._colours[name])
            for name, entry in config.sensors.items()
            if entry.modality is None or modality_named(entry.modality).has_camera_info
        ]
        for name in guess.edges:
            self._serve(name)
        self._actions.serve("save", self.save)
        self._actions.serve("reset_all", self.reset_all)
        self._publish()
        self._tell_state()
        self._watch = GuessWatch(config, self._colours, self._tell_state)

    def save(self) -> str:
        """Write the description; return what to tell the user.

        Raises:
            AtomError: it cannot be written.
        """
        return self._guess.save(self._output).sentence

    def reset(self, name: str) -> str:
        """Put one sensor back to where it was at the start."""
        self._guess.reset(name)
        self._follow()
        return f"'{name}' is where it was at the start"

    def reset_all(self) -> str:
        """Put everything back."""
        for name in self._guess.edges:
            self._guess.reset(name)
        self._follow()
        return "everything is where it was at the start"

    def _sensor_markers(self, scale: float) -> Dict[str, PoseMarker]:
        made: Dict[str, PoseMarker] = {}
        by_edge: Dict[Any, List[str]] = {}
        for name, edge in self._guess.edges.items():
            by_edge.setdefault(edge, []).append(name)
        for edge, names in by_edge.items():
            first = names[0]
            grey = colour_of(_GREY_PLACE)
            marker = PoseMarker(
                self._server,
                first,
                edge.parent,
                self._guess.value(first),
                self._moved(first),
                scale=scale,
                description=", ".join(names),
                shapes=[markers.sphere("", _BODY_IN_SCALE * scale, self._colours.get(first, grey))],
                menu=self._entries(first),
            )
            made.update(dict.fromkeys(names, marker))
        return made

    def _entries(self, name: str) -> MenuEntries:
        save, reset_all = self._common_entries()
        return [save, self._actions.entry(f"Reset {name}", lambda: self.reset(name)), reset_all]

    def _common_entries(self) -> MenuEntries:
        return [
            self._actions.entry("Save", self.save),
            self._actions.entry("Reset all", self.reset_all),
        ]

    def _moved(self, name: str) -> Any:
        def moved(move: Moved) -> None:
            with self._actions.lock:
                self._guess.set(name, move.frame_T_marker)
                self._publish()
                self._tell_state()

        return moved

    def _follow(self) -> None:
        """Put markers where the values are, and publish these."""
        for name, marker in self._markers.items():
            marker.move(self._guess.value(name))
        self._publish()

    def _publish(self) -> None:
        transforms = self._guess.fixed_transforms()
        self._fixed.publish(transforms_message(transforms, rospy.Time.now()))
        if self._watch is not None:
            self._watch.moved()

    def _tell(self, words: str, success: bool) -> None:
        """Tell the panel what came of what was asked for."""
        self._told = (words, not success)
        self._tell_state()

    def _tell_state(self) -> None:
        fits = self._watch.fits if self._watch is not None else {}
        state = GuessState(output=str(self._output), unsaved=bool(self._guess.unsaved))
        state.message, state.failed = self._told
        for name in in_order(self._config.sensors):
            guess = SensorGuess(sensor=name, colour=packed(self._colours[name]))
            guess.held = name not in self._guess.edges
            if not guess.held:
                places = self._start[name], self._guess.value(name)
                guess.moved_m, guess.moved_rad = se3.pose_difference(*places)
            fit = fits.get(name)
            guess.off_board_m = np.nan if fit is None else fit.off.median_m
            if fit is not None:
                guess.seen_by, guess.points = fit.camera, fit.off.points
            state.sensors.append(guess)
        self._state.publish(state)

    def _serve(self, name: str) -> None:
        marker = self._markers[name]

        def show(request: Any) -> SetSensorInteractiveMarkerResponse:
            if not (0 <= request.scale < np.inf):
                return SetSensorInteractiveMarkerResponse(False, "scale is a size in metres")
            with self._actions.lock:
                marker.show(request.visible, request.scale or None)
            return SetSensorInteractiveMarkerResponse(True, "")

        def tell(_request: Any) -> GetSensorInteractiveMarkerResponse:
            return GetSensorInteractiveMarkerResponse(marker.visible, marker.scale)

        below = f"~{graph_name(name)}"
        rospy.Service(f"{below}/set_sensor_interactive_marker", SetSensorInteractiveMarker, show)
        rospy.Service(f"{below}/get_sensor_interactive_marker", GetSensorInteractiveMarker, tell)
        self._actions.serve(f"{graph_name(name)}/reset", lambda: self.reset(name))


class _Frustum:
    """What one camera sees, drawn once its intrinsics are known; it follows the camera's frame."""

    def __init__(self, name: str, topic: str, frame: str, colour: Colour):
        self._frame, self._colour, self._markers = frame, colour, MarkerArray()
        topic_name = topic_of(name, "frustum")
        self._publisher = running.Publisher(topic_name, MarkerArray, queue_size=1, latch=True)
        info = f"{topic.rpartition('/')[0]}/camera_info"
        self._subscriber = rospy.Subscriber(info, CameraInfo, self._draw, queue_size=1)
        # RViz forgets what it shows whenever a recording begins anew, so a latch is not enough.
        self._timer = rospy.Timer(rospy.Duration.from_sec(1.0), self._publish, reset=True)

    def _draw(self, message: Any) -> None:
        self._subscriber.unregister()
        try:
            camera = camera_from_info(message)
        except MessageError as error:
            rospy.logwarn(f"no frustum for frame '{self._frame}': {error}")
            return
        self._markers = MarkerArray([markers.frustum(camera, self._frame, self._colour)])
        self._publish()

    def _publish(self, _event: Any = None) -> None:
        if self._markers.markers:
            self._publisher.publish(self._markers)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=NODE, description=__doc__.split("\n")[0], epilog=examples(EXAMPLE))
    add_option(
        made,
        "config_file",
        "-c",
        "--calibration_file",
        required=True,
        type=Path,
        metavar="FILE",
        help="config.yml",
    )
    add_option(
        made,
        "description_file",
        "-d",
        type=Path,
        metavar="FILE",
        help="URDF or xacro to start from (default: the first guess of the config's package)",
    )
    add_option(
        made,
        "filename",
        "-f",
        type=Path,
        metavar="FILE",
        help="what is saved (default: the description_file)",
    )
    options.add_marker_scale_option(made)
    add_option(
        made,
        "from_dataset",
        metavar="FILE",
        default="",
        help="dataset.json: sensors start where the boards they share put them, not where the "
        "description does",
    )
    return made
