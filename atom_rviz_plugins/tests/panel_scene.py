"""What the pages of the panel show of a cell with seven sensors; notes what services are called."""

from __future__ import annotations

import rospy
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from atom_calibration.msg import (
    CalibrationState,
    CollectionState,
    CollectionStates,
    CollectorState,
    GuessState,
    LabelState,
    PatternState,
    PlaybackState,
    ResidualBar,
    ResidualSummary,
    SensorDetection,
    SensorGuess,
    SensorGuidance,
    SensorSigma,
    SensorState,
    ViewedBoard,
)
from atom_calibration.srv import (
    DeleteCollection,
    DeleteCollectionResponse,
    LeaveOut,
    LeaveOutResponse,
    SaveCollection,
    SaveCollectionResponse,
)

SENSORS = {
    **dict.fromkeys(("rgb_1", "rgb_2", "rgb_3"), "rgb"),
    "depth_1": "depth",
    **dict.fromkeys(("lidar_1", "lidar_2", "lidar_3"), "lidar3d"),
}
KEYS = [f"{number:03d}" for number in range(23)]
LARGE = {f"front_left_upper_{number}": "rgb" if number % 2 else "lidar3d" for number in range(12)}
MANY_KEYS = [f"{number:03d}" for number in range(120)]
WRONG = ("lidar_2", "007")  # the only bar that is wrong
KINDS = {"rgb": ("reprojection",), "depth": ("orthogonal", "border")}
MISSING = ["6 more boards", "near", "left", "right", "top", "bottom", "tilted another way"]
WORDS = "a sentence of the length that messages have, since they say what, where and what to do, "


class PanelScene:
    """Publishes what all nodes tell, once: it is latched."""

    def __init__(self):
        self.calls = []
        self._publishers = {}
        self.show(SENSORS, KEYS)
        collect, delete = "/collect_data/save_collection", "/collect_data/delete_collection"
        automatic = "/collect_data/toggle_automatic_data_collector"
        self._services = [
            rospy.Service(collect, SaveCollection, lambda _: SaveCollectionResponse(True, "", "")),
            rospy.Service(delete, DeleteCollection, lambda _: DeleteCollectionResponse(True, "")),
            rospy.Service(automatic, SetBool, lambda _: SetBoolResponse(True, "")),
            rospy.Service("/dataset_playback/save", Trigger, lambda _: TriggerResponse(True, "")),
            rospy.Service("/set_initial_estimate/save", Trigger, self._save_guess),
            rospy.Service("/calibrate/leave_out", LeaveOut, self._leave_out),
        ]

    def show(self, sensors, keys):
        """Tell of a cell with these sensors (name: modality) and collections."""
        for topic, message in (
            ("/collect_data/state", collector_state(sensors, keys)),
            ("/collect_data/collections", collections(sensors, keys)),
            ("/calibrate/state", calibration_state(sensors, keys)),
            ("/dataset_playback/state", playback_state(sensors, keys)),
            ("/dataset_playback/collections", collections(sensors, keys)),
            ("/set_initial_estimate/state", guess_state(sensors)),
        ):
            if topic not in self._publishers:
                publisher = rospy.Publisher(topic, type(message), queue_size=1, latch=True)
                self._publishers[topic] = publisher
            self._publishers[topic].publish(message)

    def _save_guess(self, _):
        self.calls.append(("save guess",))
        return TriggerResponse(True, "saved to " + WORDS)

    def _leave_out(self, request):
        self.calls.append((request.sensor, request.collection_name, request.leave_out))
        return LeaveOutResponse(True, WORDS)


def collector_state(sensors, keys):
    """Half of the sensors see the board."""
    state = CollectorState(dataset_folder="/home/somebody/datasets/train", collections=len(keys))
    for name, modality in sensors.items():
        sensor = SensorState(name=name, modality=modality, topic=f"/{name}", colour=0x42B8A3)
        pattern = PatternState(pattern_name="board", detected=True, points=1458, possible=0)
        pattern.view, pattern.board = "blur 0.8 px, 2.1 m, 34 deg", [board(0.4)]
        if modality == "rgb":
            pattern.points, pattern.possible = 65, 88
        if name == "lidar_2":
            pattern.detected, pattern.reason, pattern.board = False, "nothing near the seed", []
            sensor.manual_seed = [1.25, -2.5, 0.75]
        sensor.patterns = [pattern]
        state.sensors.append(sensor)
    state.message = 4 * WORDS
    return state


def board(left):
    """A board in a view."""
    return ViewedBoard(left, 0.4, left + 0.2, 0.6, 2.0 + left, 70.0 * left)


def collections(sensors, keys):
    """Every sensor saw the board everywhere."""
    message = CollectionStates()
    for key in keys:
        entry = CollectionState(key, rospy.Time(10), [])
        entry.detections = [SensorDetection(name, "board", 1458) for name in sensors]
        message.collections.append(entry)
    for name, modality in sensors.items():
        guidance = SensorGuidance(sensor=name, colour=0x42B8A3, missing=MISSING)
        guidance.aspect = 4.0 if modality == "lidar3d" else 1.33
        guidance.boards = [board(0.8 * number / len(keys)) for number in range(len(keys))]
        guidance.enough = name == "rgb_1"
        message.guidance.append(guidance)
    return message


def calibration_state(sensors, keys):
    """An answer; one bar of it is wrong."""
    state = CalibrationState(status="converged", grade="weak", message=WORDS, collections=keys)
    for name, modality in sensors.items():
        for kind in KINDS.get(modality, KINDS["depth"]):
            unit = "px" if modality == "rgb" else "m"
            row = ResidualSummary(sensor=name, colour=0x42B8A3, kind=kind, unit=unit, count=65922)
            row.rms, row.rms_initial, row.grade = 0.0124, 0.104, "good"
            state.residuals.append(row)
        state.sigmas.append(SensorSigma(name, name == "rgb_3", 0.00969, 0.0047, "weak", WORDS))
        for key in keys:
            bar = ResidualBar(sensor=name, collection=key, unit="m", count=100, rms=0.01)
            bar.grade = "wrong" if (name, key) == WRONG else "good"
            state.bars.append(bar)
    return state


def playback_state(sensors, keys):
    """One label is wrong."""
    state = PlaybackState(dataset="/home/somebody/datasets/train/dataset.json", collection="001")
    state.number, state.collections, state.message = 2, len(keys), 4 * WORDS
    for name, modality in sensors.items():
        label = LabelState(sensor=name, modality=modality, pattern_name="board", detected=True)
        label.points, label.border_points, label.rms, label.worst = 1458, 116, 0.0124, 0.148
        label.unit, label.worst_item = "px" if modality == "rgb" else "m", 41
        label.grade, label.corrected = ("wrong", True) if name == "lidar_1" else ("good", False)
        state.labels.append(label)
    return state


def guess_state(sensors):
    """One sensor is held, one was dragged."""
    state = GuessState(output="/home/somebody/catkin_ws/src/cell/urdf/initial_estimate.urdf.xacro")
    for name in sensors:
        guess = SensorGuess(sensor=name, colour=0x42B8A3, held=name == "rgb_3", seen_by="rgb_1")
        guess.off_board_m, guess.points, guess.moved_m, guess.moved_rad = 0.034, 1458, 0.124, 0.1
        state.sensors.append(guess)
    state.unsaved, state.message = True, WORDS
    return state
