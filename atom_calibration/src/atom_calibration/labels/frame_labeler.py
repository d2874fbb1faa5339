"""Labels for frames as they come: which labeler, begun from which seed."""

from __future__ import annotations

from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.labels.manual_seeds import ManualSeeds, outside_data
from atom_calibration.labels.prediction import FRESH_S, BoardPredictor, Guess
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.errors import LabelingError
from atom_core.io.seeds import Seed
from atom_core.labeling.base import Labeled, Labeler, labeler_for, nothing
from atom_core.labeling.stillness import PlaneSighting
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

_SEARCH_EVERY_S = 0.35  # of each range sensor that lost the board

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
        self._manual = ManualSeeds(seeds)
        self._tracked: Dict[Key, Tuple[float, np.ndarray]] = {}
        self._searched_s: Dict[Key, float] = {}
        self._world = config.world_link
        self._boards = BoardPredictor(self._world)

    def label_unseeded(self, frame: Frame) -> Frame:
        """Label data that need no seed, and so nothing else: any thread may do it."""
        for name in self._patterns:
            frame.set_label(name, self._label(frame, name, None))
        return frame

    def label(self, frame: Frame, tree: Optional[TransformTree]) -> Frame:
        """Label a frame, or take note of one that is labeled already.

        Args:
            frame: of any sensor.
            tree: transforms at its time, to predict seeds with; None: not known.

        Raises:
            LabelingError: the data are not what the labeler needs.
            CollectionError: a seed given by hand lies outside the data.
        """
        if frame.ros.seeds is None:
            if not frame.labels:
                self.label_unseeded(frame)
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
            self._searched_s.pop((sensor, pattern), None)

    def manual_seed(self, sensor: str) -> Optional[np.ndarray]:
        """Return the seed that the user has given for all times."""
        return self._manual.for_all(sensor)

    def begin_anew(self) -> None:
        """Forget what was seen; time may go back. Seeds given by hand stay."""
        self._tracked, self._searched_s = {}, {}
        self._boards = BoardPredictor(self._world)

    def _label_range(self, frame: Frame, pattern: str, tree: Optional[TransformTree]) -> None:
        key = (frame.sensor.name, pattern)
        by_hand = self._manual.of(frame)
        prediction = self._prediction(frame, pattern, tree)
        labeled = nothing(frame.sensor.modality, _why_no_seed(by_hand, frame))
        for seed in self._seeds(frame, pattern, prediction):
            labeled, begun = self._begun(frame, pattern, seed)
            frame.set_label(pattern, labeled)
            sighting = frame.sightings.get(pattern)
            if labeled.detected and tree is not None and isinstance(sighting, PlaneSighting):
                self._boards.learn(
                    frame.sensor, self._patterns[pattern], frame.stamp_s, sighting, tree
                )
            if labeled.detected and by_hand is None:
                labeled = self._judged(frame, pattern, labeled, prediction)
            if labeled.detected:
                break
        frame.set_label(pattern, labeled)
        if not labeled.detected:
            begun = by_hand if by_hand is not None and not outside_data(by_hand, frame) else None
            self._tracked.pop(key, None)
        elif labeled.next_seed is not None:
            self._tracked[key] = (frame.stamp_s, labeled.next_seed)
        frame.set_seed(pattern, begun)

    def _begun(
        self, frame: Frame, pattern: str, seed: Optional[np.ndarray]
    ) -> Tuple[Labeled, Optional[np.ndarray]]:
        """Return the label from a seed, or with None of a search, and a seed that repeats it."""
        labeled = self._label(frame, pattern, seed)
        if seed is not None or labeled.next_seed is None:
            return labeled, seed
        again = self._label(frame, pattern, labeled.next_seed)
        return again if again.detected else labeled, labeled.next_seed

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
        of_this = self._manual.at(frame)
        if of_this is not None:
            return [of_this]
        key = (frame.sensor.name, pattern)
        stamp, tracked = self._tracked.get(key, (-np.inf, np.zeros(0)))
        if frame.stamp_s - stamp <= FRESH_S:
            seeds.append(tracked)
        for_all = self._manual.for_all(frame.sensor.name)
        if for_all is not None:
            return seeds if _is_useless(for_all, frame) else [*seeds, for_all]
        if self._automatic:
            predicted = None if prediction is None else _in_data(frame, prediction.middle)
            seeds += [] if predicted is None else [predicted]
            if frame.stamp_s - self._searched_s.get(key, -np.inf) >= _SEARCH_EVERY_S:
                self._searched_s[key] = frame.stamp_s
                seeds.append(None)
        return seeds

    def _prediction(
        self, frame: Frame, pattern: str, tree: Optional[TransformTree]
    ) -> Optional[Guess]:
        if tree is None or not (self._automatic and frame.ros.is_predicted):
            return None
        return self._boards.predict(frame.sensor, self._patterns[pattern], frame.stamp_s, tree)

    def _note_boards(self, frame: Frame, tree: Optional[TransformTree]) -> None:
        if tree is None:
            return
        for name in frame.labels:
            pose = frame.board_pose(self._patterns[name])
            if pose is not None:
                self.see_board(frame.sensor.frame, name, frame.stamp_s, pose, tree)

    def _label(self, frame: Frame, pattern: str, seed: Optional[np.ndarray]) -> Labeled:
        try:
            return self._labelers[(frame.sensor.name, pattern)].label(frame.data, seed)
        except LabelingError as error:
            raise LabelingError(f"{frame.place}: {error}") from None


def _in_data(frame: Frame, point: np.ndarray) -> Optional[np.ndarray]:
    """Return the seed of a point (3,) in the sensor's frame; None if the data do not hold it."""
    assert frame.ros.seeds is not None
    return frame.ros.seeds.of_point(frame.sensor, point)


def _is_useless(by_hand: Optional[np.ndarray], frame: Frame) -> bool:
    """Tell whether there is nothing to begin from; in a cloud, however far away, there is."""
    assert frame.ros.seeds is not None
    if by_hand is None or not frame.ros.seeds.ends_outside:
        return False
    return bool(outside_data(by_hand, frame))


def _why_no_seed(by_hand: Optional[np.ndarray], frame: Frame) -> str:
    if _is_useless(by_hand, frame):
        return "the seed set by hand lies outside the image; put it onto the board"
    return "there is no seed"
