"""Labels for frames as they come: which labeler, begun from which seed."""

from __future__ import annotations

from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.conversions import cloud_xyz
from atom_calibration.errors import CollectionError
from atom_calibration.frames import Frame
from atom_calibration.prediction import FRESH_S, BoardPredictor, Guess
from atom_calibration.stillness import PlaneSighting
from atom_calibration.tf_snapshot import TransformTree
from atom_core.errors import LabelingError
from atom_core.io.seeds import Seed
from atom_core.labeling.base import Labeled, Labeler, labeler_for, nothing
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import DetectionKey, RgbLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor
from atom_core.problem.initial_boards import camera_candidates
from atom_core.problem.measurements import CornerMeasurement

_SEARCH_EVERY_S = 0.35  # of each range sensor that lost the board
_SAME_STAMP_S = 0.005
_OUTSIDE_M = 1.0  # a seed so far from every point is a mistake

Key = Tuple[str, str]  # sensor, pattern


class FrameLabeler:
    """Labels frames; keeps seeds and the cameras' last sight of the board from one to the next."""

    def __init__(
        self,
        config: CalibrationConfig,
        sensors: Mapping[str, Sensor],
        patterns: Mapping[str, Pattern],
        seeds: Sequence[Seed] = (),
        automatic_seeds: bool = True,
    ):
        """Make the labelers.

        Args:
            config: the calibration.
            sensors: to label.
            patterns: to look for.
            seeds: given by hand; they win over all others.
            automatic_seeds: predict the seeds of range sensors from the cameras, or search.

        Raises:
            ConfigError: there is no labeler for a modality.
        """
        self._labelers: Dict[Key, Labeler] = {
            (s.name, p.name): labeler_for(s, p, config.calibration_patterns[p.name])
            for s in sensors.values()
            for p in patterns.values()
        }
        self._patterns = patterns
        self._automatic = automatic_seeds
        self._manual = _ManualSeeds(seeds)
        self._tracked: Dict[Key, Tuple[float, np.ndarray]] = {}
        self._searched_s: Dict[Key, float] = {}
        self._world = config.world_link
        self._boards = BoardPredictor(self._world)

    def label_image(self, frame: Frame) -> Frame:
        """Label a colour image; needs nothing else, so that it may run in a thread of its own."""
        for name in self._patterns:
            frame.set_label(name, self._label(frame, name, None))
        return frame

    def label(self, frame: Frame, tree: Optional[TransformTree]) -> Frame:
        """Label a frame, or take note of one that is labelled already.

        Args:
            frame: of any sensor.
            tree: transforms at its time, to predict seeds with; None: not known.

        Raises:
            LabelingError: the data are not what the labeler needs.
            CollectionError: a seed given by hand lies outside the data.
        """
        if frame.sensor.modality == RGB:
            if not frame.labels:
                self.label_image(frame)
            self._note_boards(frame, tree)
            return frame
        for name in self._patterns:
            self._label_range(frame, name, tree)
        return frame

    def see_board(
        self,
        camera_frame: str,
        pattern: str,
        stamp_s: float,
        camera_T_pattern: np.ndarray,
        tree: TransformTree,
    ) -> None:
        """Take note of where a camera sees a pattern, to predict seeds from."""
        self._boards.see(camera_frame, self._patterns[pattern], stamp_s, camera_T_pattern, tree)

    def set_seed(self, sensor: str, position: Optional[np.ndarray]) -> None:
        """Let the user tell where a range sensor shall look, from now on and whenever it is lost.

        Args:
            sensor: its name.
            position: (3,) [m] or (2,) [px]; None: seeds are automatic again.
        """
        self._manual.set_for_all(sensor, position)
        for pattern in self._patterns:
            self._tracked.pop((sensor, pattern), None)

    def manual_seed(self, sensor: str) -> Optional[np.ndarray]:
        """Return the seed that the user has given for all times."""
        return self._manual.for_all(sensor)

    def begin_anew(self) -> None:
        """Forget what was seen; time may go back. Seeds given by hand stay."""
        self._tracked, self._searched_s = {}, {}
        self._boards = BoardPredictor(self._world)

    def _label_range(self, frame: Frame, pattern: str, tree: Optional[TransformTree]) -> None:
        key = (frame.sensor.name, pattern)
        labeled = nothing(frame.sensor.modality, "there is no seed")
        prediction = self._prediction(frame, pattern, tree)
        manual = self._manual.at(frame)
        seeds = [manual] if manual is not None else self._seeds(frame, pattern, prediction)
        for seed in seeds:
            labeled = self._label(frame, pattern, seed)
            frame.set_label(pattern, labeled)
            sighting = frame.sightings.get(pattern)
            if labeled.detected and tree is not None and isinstance(sighting, PlaneSighting):
                self._boards.learn(
                    frame.sensor, self._patterns[pattern], frame.stamp_s, sighting, tree
                )
            by_hand = manual is not None or self.manual_seed(frame.sensor.name) is not None
            if labeled.detected and not by_hand:
                labeled = self._judged(frame, pattern, labeled, prediction)
            if labeled.detected:
                begun = seed if seed is not None else labeled.next_seed
                if begun is not None:
                    frame.seeds[pattern] = begun
                break
        frame.set_label(pattern, labeled)
        if not labeled.detected:
            self._tracked.pop(key, None)
        elif labeled.next_seed is not None:
            self._tracked[key] = (frame.stamp_s, labeled.next_seed)

    def _judged(
        self, frame: Frame, pattern: str, labeled: Labeled, prediction: Optional[Guess]
    ) -> Labeled:
        """Return the label, or an empty one if a camera sees the board somewhere else."""
        sighting = frame.sightings.get(pattern)
        if prediction is None or not isinstance(sighting, PlaneSighting):
            return labeled
        if prediction.agrees(sighting):
            return labeled
        away = float(np.linalg.norm(sighting.centre - prediction.middle))
        return nothing(
            frame.sensor.modality,
            f"what was found is not where a camera sees the board, but {away:.1f} m from its "
            f"middle, or slanted otherwise",
            labeled.quality,
        )

    def _seeds(
        self, frame: Frame, pattern: str, prediction: Optional[Guess]
    ) -> List[Optional[np.ndarray]]:
        """Return the seeds to try, the most trusted first; None stands for a search."""
        seeds: List[Optional[np.ndarray]] = []
        key = (frame.sensor.name, pattern)
        stamp, tracked = self._tracked.get(key, (-np.inf, np.zeros(0)))
        if frame.stamp_s - stamp <= FRESH_S:
            seeds.append(tracked)
        for_all = self._manual.for_all(frame.sensor.name)
        if for_all is not None:
            return [*seeds, for_all]
        if self._automatic:
            predicted = None if prediction is None else _in_data(frame.sensor, prediction.middle)
            seeds += [] if predicted is None else [predicted]
            if frame.stamp_s - self._searched_s.get(key, -np.inf) >= _SEARCH_EVERY_S:
                self._searched_s[key] = frame.stamp_s
                seeds.append(None)
        return seeds

    def _prediction(
        self, frame: Frame, pattern: str, tree: Optional[TransformTree]
    ) -> Optional[Guess]:
        if tree is None or not self._automatic:
            return None
        return self._boards.predict(frame.sensor, self._patterns[pattern], frame.stamp_s, tree)

    def _note_boards(self, frame: Frame, tree: Optional[TransformTree]) -> None:
        if tree is None:
            return
        for name, labeled in frame.labels.items():
            pose = camera_T_pattern(frame.sensor, self._patterns[name], labeled)
            if pose is not None:
                self.see_board(frame.sensor.frame, name, frame.stamp_s, pose, tree)

    def _label(self, frame: Frame, pattern: str, seed: Optional[np.ndarray]) -> Labeled:
        try:
            return self._labelers[(frame.sensor.name, pattern)].label(frame.data, seed)
        except LabelingError as error:
            raise LabelingError(f"{frame.place}: {error}") from None


def camera_T_pattern(sensor: Sensor, pattern: Pattern, labeled: Labeled) -> Optional[np.ndarray]:
    """Return the board's pose (4, 4) by one camera's corners alone; None if they do not tell."""
    label = labeled.label
    if not isinstance(label, RgbLabel) or not label.detected or sensor.camera is None:
        return None
    key = DetectionKey("", sensor.name, pattern.name)
    corners = pattern.corners_of(label.ids)
    poses = camera_candidates(
        CornerMeasurement(key, sensor.camera, label.ids, corners, label.pixels)
    )
    return poses[0] if poses else None


def _in_data(sensor: Sensor, point: np.ndarray) -> Optional[np.ndarray]:
    """Return the seed of a point (3,) in the sensor's frame; None if an image does not hold it."""
    if sensor.modality != DEPTH:
        return point
    assert sensor.camera is not None
    inside = sensor.camera.in_image(point[None])[0]
    return sensor.camera.project(point[None])[0] if inside else None


class _ManualSeeds:
    """Seeds given by hand: for one time, or for all."""

    def __init__(self, seeds: Sequence[Seed]):
        self._seeds = list(seeds)

    def at(self, frame: Frame) -> Optional[np.ndarray]:
        """Return the seed for the frame's time."""
        for seed in self._seeds:
            if seed.sensor != frame.sensor.name or seed.stamp_s is None:
                continue
            if abs(seed.stamp_s - frame.stamp_s) <= _SAME_STAMP_S:
                check_inside(seed, frame, "correct it in the file of --seeds")
                return seed.position
        return None

    def for_all(self, sensor: str) -> Optional[np.ndarray]:
        """Return the seed for all times."""
        found = [s for s in self._seeds if s.sensor == sensor and s.stamp_s is None]
        return found[0].position if found else None

    def set_for_all(self, sensor: str, position: Optional[np.ndarray]) -> None:
        """Replace, or with None remove, the seed for all times."""
        self._seeds = [s for s in self._seeds if s.sensor != sensor or s.stamp_s is not None]
        if position is not None:
            self._seeds.append(Seed(sensor, position))


def check_inside(seed: Seed, frame: Frame, remedy: str) -> None:
    """Refuse a seed that lies outside the data of its sensor.

    Raises:
        CollectionError: with the remedy given.
    """
    if frame.sensor.modality == LIDAR3D:
        away = np.linalg.norm(cloud_xyz(frame.data) - seed.position, axis=1)
        nearest = float(np.nanmin(away)) if np.any(np.isfinite(away)) else np.inf
        problem = f"the nearest point is {nearest:.2f} m away" if nearest > _OUTSIDE_M else ""
        unit = "m"
    else:
        height, width = frame.data.shape
        u, v = seed.position
        inside = -0.5 <= u <= width - 0.5 and -0.5 <= v <= height - 0.5
        problem = "" if inside else f"the image has {width} x {height} pixels"
        unit = "px"
    if problem:
        raise CollectionError(
            f"{frame.place}: the seed {np.round(seed.position, 3).tolist()} {unit} lies outside "
            f"the data ({problem}); {remedy}"
        )
