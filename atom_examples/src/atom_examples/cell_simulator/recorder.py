"""The simulated cell, or another world, into a bag, without a master."""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, Optional, Protocol, Sequence, Tuple

import numpy as np
import rosbag
import rospy

from atom_core.commands.progress import watched
from atom_core.io.atomic import sync_file, sync_folder
from atom_core.model.transforms import Edge
from atom_core.synthetic.cell import SCENARIOS
from atom_examples.cell_simulator import messages
from atom_examples.cell_simulator.camera import ColourCamera
from atom_examples.cell_simulator.devices import (
    CameraDevice,
    ColourDevice,
    Device,
    Packing,
    devices_of,
)
from atom_examples.cell_simulator.errors import SimulatorError
from atom_examples.cell_simulator.planner import plan_stops
from atom_examples.cell_simulator.scene import Scene
from atom_examples.cell_simulator.shutter import Shutter
from atom_examples.cell_simulator.trajectory import TICK_S, State, Trajectory
from atom_examples.cell_simulator.truth import Labels, write_recording_truth
from atom_examples.cell_simulator.world import DISTURBED, World

START_S = 1000.0
_NOISE = 3  # stream of random numbers of one seed and scenario


@dataclass(frozen=True)
class Recording:
    """What to record.

    Attributes:
        scenario: "train" or "test".
        collections: number of stops.
        initial_estimate: "exact" or "disturbed", the mounts in /tf_static.
        compressed: images as CompressedImage, the bag's chunks by LZ4.
        depth_encoding: 16UC1 or 32FC1.
        noise: False for exact sensors.
        stop_s: how long the board stands still.
        image_hz, cloud_hz: rates while it stands, of colour images and of all else.
        moving_image_hz, moving_cloud_hz: rates while it moves.
        exposure_s, readout_s: of colour images while it moves, see `Shutter`; 0: at one instant.
    """

    scenario: str = "train"
    collections: int = 23
    initial_estimate: str = DISTURBED
    compressed: bool = False
    depth_encoding: str = "16UC1"
    noise: bool = True
    stop_s: float = 1.5
    image_hz: float = 2.0
    cloud_hz: float = 5.0
    moving_image_hz: float = 1.0
    moving_cloud_hz: float = 10.0
    exposure_s: float = 0.0
    readout_s: float = 0.0

    def document(self) -> Dict[str, Any]:
        """Return what was asked for, as the truth of a recording tells it."""
        shutter = ("exposure_s", "readout_s")
        return {k: v for k, v in asdict(self).items() if k not in shutter or v}


def recording_files(bag: Path) -> List[Path]:
    """Return the files of a recording: the truth of its labels, its truth, the bag itself."""
    return [bag.with_suffix(".labels.npz"), bag.with_suffix(".truth.json"), bag]


def record(world: World, recording: Recording, path: Path, progress: bool = True) -> None:
    """Write a bag, its truth (``.truth.json``) and the truth of its labels (``.labels.npz``).

    All of them or none: what cannot be finished is removed, and earlier files stay as they were.

    Raises:
        SimulatorError: no board poses fit, or the file cannot be written.
    """
    stops = plan_stops(world, recording.scenario, recording.collections)
    trajectory = Trajectory(stops, recording.stop_s, world.scene.board.pattern)
    labels = Labels(world)
    with all_or_none(path, recording_files(path)) as active:
        shown = _ShownCell(world, recording)
        record_ticks(shown, trajectory, recording, path, active[2], labels, progress)
        labels.write(active[0])
        more = {"lidar": world.lidar, "gloss": world.gloss}
        more = {name: value for name, value in more.items() if value}
        write_recording_truth(
            active[1],
            world,
            [s.world_T_pattern for s in stops],
            {f"{n:03d}": interval_s(trajectory, n) for n in range(len(stops))},
            {"seed": world.seed, **more, **recording.document()},
        )


class TickState(Protocol):
    """The moving part of a world at one instant."""

    @property
    def stop(self) -> Optional[int]:
        """Number of the stop where everything stands still, None while it moves."""

    @property
    def tick_of_stop(self) -> int:
        """Ticks since it came to the stop."""


class Motion(Protocol):
    """How a world moves."""

    @property
    def ticks(self) -> int:
        """How many there are."""

    def state(self, tick: float) -> Any:
        """Return the state (`TickState`) at a tick, or between two."""

    def interval(self, stop: int) -> tuple:
        """Return the first tick of a stop and the first one after it."""


class Shown(Protocol):
    """A world as it is recorded."""

    @property
    def seed(self) -> int:
        """What random numbers are drawn from, ..."""

    @property
    def stream(self) -> int:
        """... in a stream of their own."""

    @property
    def scene(self) -> Scene:
        """What there is to be seen."""

    @property
    def devices(self) -> Sequence[Device]:
        """The sensors."""

    @property
    def still(self) -> Mapping[Edge, np.ndarray]:
        """The edges (4, 4) of /tf_static."""

    def told(self, state: Any, tick: int) -> Mapping[Edge, np.ndarray]:
        """Return the moving edges (4, 4) as the robot tells them."""

    def positions(self, state: Any) -> Mapping[str, float]:
        """Return the positions of joints as the robot reports them [rad, m]."""

    def place(self, state: Any) -> None:
        """Put everything in the scene where it is."""

    def stamp_error_s(self, sensor: int, tick: int) -> float:
        """Return by how much a stamp is off."""


class _ShownCell:
    """The cell: its arm waits, the board is carried about beside a person."""

    def __init__(self, world: World, recording: Recording):
        self._world, self.scene, self.seed = world, world.scene, world.seed
        self.stream = SCENARIOS[recording.scenario].stream
        robot = world.description(recording.initial_estimate).robot
        self.still, self._joints = messages.split_edges(robot, world.home)
        self.devices = devices_of(world)

    def told(self, state: State, tick: int) -> Mapping[Edge, np.ndarray]:
        return self._world.as_told(self._joints, self.stream, tick)

    def positions(self, state: State) -> Mapping[str, float]:
        return self._world.home

    def place(self, state: State) -> None:
        self.scene.place_board(state.world_T_pattern)
        self.scene.place_person(state.person)

    def stamp_error_s(self, sensor: int, tick: int) -> float:
        return self._world.stamp_error_s(self.stream, sensor, tick)


@contextmanager
def all_or_none(path: Path, files: Sequence[Path]) -> Iterator[List[Path]]:
    """Yield names for files that get their own when all is done, and are removed if it fails.

    A bag of before is removed when all are on the disk: a program that is killed or a machine that
    loses its power in between leaves no bag beside the truth of another one.

    Args:
        path: what messages call them.
        files: the bag is the last one.

    Raises:
        SimulatorError: one cannot be written.
    """
    active = [file.with_name(file.name + ".active") for file in files]
    try:
        yield active
        for unnamed in active:
            sync_file(unnamed)
        with suppress(FileNotFoundError):
            files[-1].unlink()
        sync_folder(path.parent)
        for unnamed, file in zip(active, files):
            os.replace(unnamed, file)
            sync_folder(path.parent)
    except BaseException as error:
        for unnamed in active:
            with suppress(OSError):
                unnamed.unlink()
        if isinstance(error, OSError):
            raise SimulatorError(
                f"{path}: the bag cannot be written ({error.strerror or error}); what was there of "
                f"it is removed. Make room, or record fewer collections or with --compressed"
            ) from None
        raise


def record_ticks(
    shown: Shown,
    motion: Motion,
    recording: Recording,
    path: Path,
    active: Path,
    labels: Optional[Labels] = None,
    progress: bool = True,
) -> None:
    """Write a bag.

    Args:
        shown: the world.
        motion: how it moves.
        recording: rates and packing.
        path: what the progress bar calls it.
        active: the file.
        labels: is told what truly belongs to the board, if anybody wants to know.
        progress: tell how far it is.
    """
    with _open(active, recording) as bag:
        writer = _Writer(shown, motion, recording, bag, labels)
        ticks = range(motion.ticks)
        for tick in watched(ticks, len(ticks), path.name, "ticks") if progress else ticks:
            writer.write_tick(tick, motion.state(tick))


def _open(path: Path, recording: Recording) -> _Bag:
    compression = rosbag.Compression.LZ4 if recording.compressed else rosbag.Compression.NONE
    return _Bag(str(path), "w", compression=compression)


class _Bag(rosbag.Bag):
    """A bag that does not try to finish its file when writing has failed."""

    def __exit__(self, kind, value, trace):
        if kind is None:
            self.close()
        else:
            with suppress(Exception):  # the file may be full; it is removed anyway
                self._file.close()


def stamp_of(tick: int) -> rospy.Time:
    """Return the time of a tick, to the nanosecond."""
    return rospy.Time(0, int(START_S * 1e9) + tick * int(round(TICK_S * 1e9)))


def interval_s(motion: Motion, stop: int) -> Dict[str, float]:
    """Return when a stop begins and ends [s]."""
    first, after = motion.interval(stop)
    return {"start_s": stamp_of(first).to_sec(), "end_s": stamp_of(after).to_sec()}


class _Writer:
    """Writes what the sensors see, tick by tick."""

    def __init__(
        self,
        shown: Shown,
        motion: Motion,
        recording: Recording,
        bag: rosbag.Bag,
        labels: Optional[Labels],
    ):
        self.shown, self.motion, self.recording = shown, motion, recording
        self.bag, self.labels = bag, labels
        self._shutter = Shutter(recording.exposure_s, recording.readout_s)
        self._packing = Packing(recording.depth_encoding, recording.compressed)
        self._seq: Dict[str, int] = {}

    def write_tick(self, tick: int, state: TickState) -> None:
        """Write all messages of a tick."""
        shown, stamp = self.shown, stamp_of(tick)
        if tick == 0:
            self._write_latched("/tf_static", messages.transforms(shown.still, stamp), stamp)
        told, positions = shown.told(state, tick), shown.positions(state)
        if told:
            self.bag.write("/tf", messages.transforms(told, stamp), stamp)
        if positions:
            joints = messages.joint_state(positions, stamp, self._next_seq("/joint_states"))
            self.bag.write("/joint_states", joints, stamp)
        due = list(self._due(tick, state))
        if due:
            shown.place(state)
        for number, device in due:
            off = rospy.Duration(shown.stamp_error_s(number, tick))
            self._write_device(device, tick, state, stamp + off, self._rng(number, tick))
        if self.labels is not None and state.stop is not None and state.tick_of_stop == 0:
            self.labels.add_stop(state.stop)

    def _due(self, tick: int, state: TickState) -> Iterator[Tuple[int, Device]]:
        wanted, still = self.recording, state.stop is not None
        for number, device in enumerate(self.shown.devices):
            if device.draws_pictures:
                rate = wanted.image_hz if still else wanted.moving_image_hz
            else:
                rate = wanted.cloud_hz if still else wanted.moving_cloud_hz
            period = max(int(round(1.0 / (rate * TICK_S))), 1)
            if (state.tick_of_stop if still else tick) % period == 0:
                yield number, device

    def _rng(self, sensor: int, tick: int) -> Optional[np.random.Generator]:
        if not self.recording.noise:
            return None
        return np.random.default_rng([self.shown.seed, self.shown.stream, _NOISE, sensor, tick])

    def _write_device(
        self,
        device: Device,
        tick: int,
        state: TickState,
        told: rospy.Time,
        rng: Optional[np.random.Generator],
    ) -> None:
        """Write what a device sees at a time, and says that it saw at another one."""
        sensor, stamp = device.settings, stamp_of(tick)
        head = messages.header(sensor.frame, told, self._next_seq(sensor.topic))
        if isinstance(device, ColourDevice) and state.stop is None and any(self._shutter):
            seen = self._in_motion(device.sensor, tick, rng)
            self.shown.place(state)
        else:
            seen = device.capture(self.shown.scene, rng)
        message = device.pack(seen, head, self._packing)
        self.bag.write(device.topic(self._packing), message, stamp)
        if isinstance(device, CameraDevice):
            self.bag.write(device.info_topic, device.info(head), stamp)
        on_plate = device.on_plate(seen)
        if self.labels is not None and state.stop is not None and on_plate is not None:
            self.labels.add_scan(state.stop, sensor.name, told.to_sec(), on_plate)

    def _in_motion(
        self, camera: ColourCamera, tick: int, rng: Optional[np.random.Generator]
    ) -> np.ndarray:
        """Return the picture of a scene that moves while the shutter is open."""

        def drawn(after_s: float) -> np.ndarray:
            self.shown.place(self.motion.state(min(tick + after_s / TICK_S, self.motion.ticks - 1)))
            return camera.drawn(self.shown.scene)

        return camera.developed(self._shutter.picture(drawn, camera.camera.height), rng)

    def _write_latched(self, topic: str, message: Any, stamp: rospy.Time) -> None:
        connection = {
            "topic": topic,
            "type": message._type,
            "md5sum": message._md5sum,
            "message_definition": message._full_text,
            "callerid": "/cell_simulator",
            "latching": "1",
        }
        self.bag.write(topic, message, stamp, connection_header=connection)

    def _next_seq(self, topic: str) -> int:
        self._seq[topic] = self._seq.get(topic, -1) + 1
        return self._seq[topic]
