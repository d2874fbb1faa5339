"""Labels for frames as they come: which labeler, begun from which seed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.labels.guess import Guess
from atom_calibration.labels.manual_seeds import ManualSeeds, outside_data
from atom_calibration.labels.motion_watch import MotionWatch
from atom_calibration.labels.prediction import FRESH_S, BoardPredictor
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.errors import LabelingError
from atom_core.io.seeds import Seed
from atom_core.labeling.base import Labeled, Labeler, labeler_for, nothing, prepared
from atom_core.labeling.lidar3d import ALIKE
from atom_core.labeling.stillness import SurfaceSighting
from atom_core.model.config import CalibrationConfig
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

NO_SEED = "there is no seed"  # and the frame is not searched: others were just before
_SEARCH_EVERY_S = 0.35  # of each range sensor that lost the board
_REACH_M = (0.25, 0.7)  # from a predicted seed to what is found; least, most
_REACH_SIGMAS = 2.0

Key = Tuple[str, str]  # sensor, pattern


class _Attempt(NamedTuple):
    """Where to look for the board.

    Attributes:
        seed: None stands for a search.
        reach_m: how far from a seed that was predicted the board may be; None: it was not.
    """

    seed: Optional[np.ndarray]
    reach_m: Optional[float] = None


class _Tracked(NamedTuple):
    """Where the board was last.

    Attributes:
        stamp_s, seed: when, and what finds it again.
        alike: planes of the board's size from which it was chosen; 1 where it was alone.
    """

    stamp_s: float
    seed: np.ndarray
    alike: float


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
        self._tracked: Dict[Key, _Tracked] = {}
        self._searched_s: Dict[Key, float] = {}
        self._world = config.world_link
        self._boards = BoardPredictor(self._world)
        self._motion = MotionWatch()

    def prepare(self, frame: Frame) -> Frame:
        """Do what needs nothing but the data, as labeling images does: any thread may."""
        for name in self._patterns:
            if frame.ros.seeds is None:
                frame.set_label(name, self._label(frame, name, None))
            else:
                self._prepared(frame, name)
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
                self.prepare(frame)
            self._note_boards(frame, tree)
        else:
            for name in self._patterns:
                self._label_range(frame, name, tree)
        frame.prepared.clear()
        self._motion.note(frame)
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

    @property
    def relocated(self) -> Mapping[str, str]:
        """What is to be said, by sensor, of those not at all where the transforms have them."""
        return self._boards.relocated

    def settle(self) -> None:
        """Learn from few labels, too, where sensors are: the recording ends here."""
        self._boards.settle()

    def begin_anew(self) -> None:
        """Forget what was seen; time may go back. Seeds, and where sensors are, stay known."""
        self._tracked, self._searched_s = {}, {}
        self._boards.forget_sights()
        self._motion.forget()

    def _label_range(self, frame: Frame, pattern: str, tree: Optional[TransformTree]) -> None:
        key = (frame.sensor.name, pattern)
        by_hand = self._manual.of(frame)
        prediction = self._prediction(frame, pattern, tree)
        labeled = nothing(frame.sensor.modality, _why_no_seed(by_hand, frame))
        for attempt in self._attempts(frame, pattern, prediction):
            labeled, begun = self._begun(frame, pattern, attempt)
            labeled = _vouched(frame, labeled, prediction)
            frame.set_label(pattern, labeled)
            sighting = frame.sightings.get(pattern)
            if labeled.detected and tree is not None and isinstance(sighting, SurfaceSighting):
                self._boards.learn(
                    frame.sensor, self._patterns[pattern], frame.stamp_s, sighting, tree
                )
            if labeled.detected and by_hand is None:
                labeled = self._with_choice(key, labeled, attempt, prediction)
                labeled = self._judged(frame, pattern, labeled, prediction)
            if labeled.detected:
                break
        frame.set_label(pattern, labeled)
        if not labeled.detected:
            begun = by_hand if by_hand is not None and not outside_data(by_hand, frame) else None
            self._tracked.pop(key, None)
        elif labeled.next_seed is not None:
            alike = labeled.quality.get(ALIKE, 1.0)
            self._tracked[key] = _Tracked(frame.stamp_s, labeled.next_seed, alike)
        frame.set_seed(pattern, begun)

    def _begun(
        self, frame: Frame, pattern: str, attempt: _Attempt
    ) -> Tuple[Labeled, Optional[np.ndarray]]:
        """Return the label of an attempt, and a seed that repeats it."""
        labeled = self._label(frame, pattern, *attempt)
        if attempt.seed is not None or labeled.next_seed is None:
            return labeled, attempt.seed
        again = self._label(frame, pattern, labeled.next_seed)
        if again.detected and ALIKE in labeled.quality:
            again = replace(again, quality={**again.quality, ALIKE: labeled.quality[ALIKE]})
        return again if again.detected else labeled, labeled.next_seed

    def _with_choice(
        self, key: Key, labeled: Labeled, attempt: _Attempt, prediction: Optional[Guess]
    ) -> Labeled:
        """Return the label with the number of planes that it was chosen from, now or when found.

        Where a camera tells which of them is the board nothing was chosen.
        """
        alike, tracked = labeled.quality.get(ALIKE, 1.0), self._tracked.get(key)
        if tracked is not None and attempt.seed is tracked.seed:
            alike = tracked.alike
        quality = {name: value for name, value in labeled.quality.items() if name != ALIKE}
        if alike > 1.0 and prediction is None:
            quality[ALIKE] = alike
        return replace(labeled, quality=quality)

    def _judged(
        self, frame: Frame, pattern: str, labeled: Labeled, prediction: Optional[Guess]
    ) -> Labeled:
        """Return the label, or an empty one if a camera sees the board somewhere else."""
        sighting = frame.sightings.get(pattern)
        if prediction is None or not isinstance(sighting, SurfaceSighting):
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

    def _attempts(self, frame: Frame, pattern: str, prediction: Optional[Guess]) -> List[_Attempt]:
        """Return where to look, the most trusted place first."""
        attempts: List[_Attempt] = []
        of_this = self._manual.at(frame)
        if of_this is not None:
            return [_Attempt(of_this)]
        key = (frame.sensor.name, pattern)
        tracked = self._tracked.get(key)
        if tracked is not None and frame.stamp_s - tracked.stamp_s <= FRESH_S:
            attempts.append(_Attempt(tracked.seed))
        for_all = self._manual.for_all(frame.sensor.name)
        if for_all is not None:
            return attempts if _is_useless(for_all, frame) else [*attempts, _Attempt(for_all)]
        if self._automatic:
            attempts += [] if prediction is None else _where_predicted(frame, prediction)
            if frame.stamp_s - self._searched_s.get(key, -np.inf) >= _SEARCH_EVERY_S:
                self._searched_s[key] = frame.stamp_s
                attempts.append(_Attempt(None))
        return attempts

    def _prediction(
        self, frame: Frame, pattern: str, tree: Optional[TransformTree]
    ) -> Optional[Guess]:
        if tree is None:
            return None
        return self._boards.predict(frame.sensor, self._patterns[pattern], frame.stamp_s, tree)

    def _note_boards(self, frame: Frame, tree: Optional[TransformTree]) -> None:
        if tree is None:
            return
        for name in frame.labels:
            pose = frame.board_pose(self._patterns[name])
            if pose is not None:
                self.see_board(frame.sensor.frame, name, frame.stamp_s, pose, tree)

    def _label(
        self,
        frame: Frame,
        pattern: str,
        seed: Optional[np.ndarray],
        reach_m: Optional[float] = None,
    ) -> Labeled:
        labeler, label_near = self._labelers[(frame.sensor.name, pattern)], frame.ros.label_near
        data = self._prepared(frame, pattern)
        try:
            if label_near is None or seed is None or reach_m is None:
                return labeler.label(data, seed)
            return label_near(labeler, data, seed, reach_m)
        except LabelingError as error:
            raise LabelingError(f"{frame.place}: {error}") from None

    def _prepared(self, frame: Frame, pattern: str) -> Any:
        if pattern not in frame.prepared:
            labeler = self._labelers[(frame.sensor.name, pattern)]
            try:
                frame.prepared[pattern] = prepared(labeler, frame.data)
            except LabelingError as error:
                raise LabelingError(f"{frame.place}: {error}") from None
        return frame.prepared[pattern]


def _vouched(frame: Frame, labeled: Labeled, prediction: Optional[Guess]) -> Labeled:
    """Return the label of what the view cuts, if a camera sees the board there."""
    if labeled.detected or labeled.unsure is None or prediction is None:
        return labeled
    sighting = frame.ros.sighting(frame, labeled.unsure.label)
    is_board = isinstance(sighting, SurfaceSighting) and prediction.vouches(sighting)
    return labeled.unsure if is_board else labeled


def _where_predicted(frame: Frame, guess: Guess) -> List[_Attempt]:
    """Return the attempt where the board should be; none if the data do not hold that place."""
    assert frame.ros.seeds is not None
    known_m = _REACH_SIGMAS * guess.sigma_m
    reach_m = guess.half_diagonal_m + known_m
    seed = frame.ros.seeds.of_board(frame.sensor, guess.middle, guess.normal, reach_m)
    return [] if seed is None else [_Attempt(seed, float(np.clip(known_m, *_REACH_M)))]


def _is_useless(by_hand: Optional[np.ndarray], frame: Frame) -> bool:
    """Tell whether there is nothing to begin from; in a cloud, however far away, there is."""
    assert frame.ros.seeds is not None
    if by_hand is None or not frame.ros.seeds.ends_outside:
        return False
    return bool(outside_data(by_hand, frame))


def _why_no_seed(by_hand: Optional[np.ndarray], frame: Frame) -> str:
    if _is_useless(by_hand, frame):
        return "the seed set by hand lies outside the image; put it onto the board"
    return NO_SEED
