"""How good collections are while they are taken: figures by sensor, advice where labels fail."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Set, Tuple

import numpy as np

from atom_calibration.errors import TransformError
from atom_calibration.labels.board_figures import board_figures
from atom_calibration.modalities.frames import Frame
from atom_calibration.sources.transform_tree import TransformTree
from atom_core.errors import DatasetError
from atom_core.io.atomic import write_json_atomically
from atom_core.labeling.advice import LEAST_FAILURES, Failure, advice, same_reason
from atom_core.labeling.base import Labeled
from atom_core.labeling.board_size import (
    SeenBoard,
    find_size,
    is_surely_smaller,
    size_remark,
)
from atom_core.labeling.guidance import BoardView, Guidance, board_view, guidance
from atom_core.labeling.lidar3d import ALIKE
from atom_core.labeling.rgb import STARTS_BLACK
from atom_core.labeling.unseen_rows import REMEDY, SeenRows, seen_rows, unseen_rows_remark
from atom_core.labeling.view_quality import (
    ForeseenView,
    described,
    exposure_word,
    foreseen_view,
    motion_words,
    speed_figure,
)
from atom_core.model.config import CalibrationConfig
from atom_core.model.labels import RgbLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

QUALITY_FILE = "quality.json"
_VERSION = "1.0"
_SHOWN = {  # figures of the summary: key, heading, decimals
    "blur_px": ("blur [px]", 2),
    "smear_px": ("smear [px]", 1),
    "speed_px_s": ("motion [px/s]", 1),
    "speed_mm_s": ("motion [mm/s]", 1),
    "distance_m": ("distance [m]", 2),
    "tilt_deg": ("tilt [deg]", 0),
}

Key = Tuple[str, str]  # sensor, pattern
Figures = Dict[str, float]


class QualityLog:
    """Figures of all labels in collections, and the labels that failed beside them."""

    def __init__(
        self,
        config: CalibrationConfig,
        sensors: Mapping[str, Sensor],
        patterns: Mapping[str, Pattern],
        warn: Callable[[str], None],
    ):
        """Start with nothing; ``warn`` is told each line of advice when it is first given."""
        self._config, self._sensors, self._patterns, self._warn = config, sensors, patterns, warn
        self._figures: Dict[str, Dict[Key, Figures]] = {}  # by collection
        self._failures: Dict[str, Dict[Key, Failure]] = {}  # by collection
        self._sizes: Dict[str, Dict[Key, SeenBoard]] = {}  # by collection
        self._rows: Dict[str, Dict[Key, SeenRows]] = {}  # by collection

    def add(
        self,
        key: str,
        frames: Mapping[str, Frame],
        speeds: Mapping[Key, float],
        tree: Optional[TransformTree],
    ) -> None:
        """Take note of a collection.

        Args:
            key: of the collection.
            frames: its frames by sensor.
            speeds: how fast the board moved [sigmas / s], where that shows.
            tree: the transforms of its time; None: not known.
        """
        figures: Dict[Key, Figures] = {}
        failures: Dict[Key, Failure] = {}
        sizes: Dict[Key, SeenBoard] = {}
        rows: Dict[Key, SeenRows] = {}
        before = {*self.advice(), *self.mirrored()}
        for name, pattern in self._patterns.items():
            config = self._config.calibration_patterns[name]
            for sensor, frame in frames.items():
                labeled = frame.labels.get(name)
                if labeled is None:
                    continue
                if not labeled.detected:
                    view = self._foreseen(sensor, pattern, frames, tree)
                    failures[(sensor, name)] = Failure(labeled.reason, view)
                    continue
                speed = speeds.get((sensor, name))
                seen = board_figures(frame, pattern, config)
                kept = (STARTS_BLACK, ALIKE)
                seen.update({k: labeled.quality[k] for k in kept if k in labeled.quality})
                if speed is not None and np.isfinite(speed):
                    seen.update(speed_figure(frame.sightings.get(name), speed))
                figures[(sensor, name)] = seen
                if self._sensors[sensor].kind.seen_boards and labeled.next_seed is not None:
                    away_m = float(np.linalg.norm(labeled.next_seed))
                    sizes[(sensor, name)] = _seen_size(labeled, away_m)
                camera = self._sensors[sensor].camera
                if isinstance(labeled.label, RgbLabel) and camera is not None:
                    rows[(sensor, name)] = seen_rows(labeled.label, pattern, camera)
        self._figures[key], self._failures[key] = figures, failures
        self._sizes[key], self._rows[key] = sizes, rows
        for line in (*self.advice(), *self.mirrored()):
            if _subject(line) not in {_subject(other) for other in before}:
                self._warn(line)

    def delete(self, key: str) -> None:
        """Forget a collection."""
        self._figures.pop(key, None)
        self._failures.pop(key, None)
        self._sizes.pop(key, None)
        self._rows.pop(key, None)

    def advice(self) -> List[str]:
        """Return a line for each kind of label that failed twice or more."""
        by_kind: Dict[Tuple[Key, str], List[Failure]] = defaultdict(list)
        for of_one in self._failures.values():
            for key, failure in of_one.items():
                by_kind[(key, same_reason(failure.reason))].append(failure)
        lines = []
        for ((sensor, name), _), failures in by_kind.items():
            if len(failures) < LEAST_FAILURES:
                continue
            found = [f[(sensor, name)] for f in self._figures.values() if (sensor, name) in f]
            config = self._config.calibration_patterns[name]
            text = advice(failures, found, self._patterns[name], config)
            lines.append(f"{self._named(sensor, name)}: {text} ({len(failures)} collections)")
        return [*lines, *self.moved(), *self.alike(), *self.unseen_rows()]

    def unseen_rows(self) -> List[str]:
        """Return a line for each board that is configured with rows that no picture shows."""
        remarks = []
        for name, pattern in self._patterns.items():
            seen = [
                rows
                for of_one in self._rows.values()
                for key, rows in of_one.items()
                if key[1] == name
            ]
            remarks.append(unseen_rows_remark(pattern, seen))
        return [f"{remark}; {REMEDY}" for remark in remarks if remark is not None]

    def alike(self) -> List[str]:
        """Return a line for each sensor that had to choose among planes of the board's size."""
        counts: Dict[Key, List[int]] = defaultdict(list)
        for of_one in self._figures.values():
            for key, figures in of_one.items():
                if ALIKE in figures:
                    counts[key].append(int(figures[ALIKE]))
        return [
            f"{self._named(*key)}: {max(found)} planes of the board's size are in view, and the "
            f"one that fits best was labeled: see that it is the board (dataset_playback), take "
            f"the others away, or set the seed ({len(found)} collections)"
            for key, found in counts.items()
        ]

    def moved(self) -> List[str]:
        """Return a line for each sensor that took data of a board in motion."""
        moving: Dict[Key, List[str]] = defaultdict(list)
        for of_one in self._figures.values():
            for key, figures in of_one.items():
                if motion_words(figures):
                    moving[key].append(motion_words(figures))
        return [
            f"{self._named(*key)}: {words[-1]}: hold it still, or delete what was taken so "
            f"({len(words)} collections)"
            for key, words in moving.items()
        ]

    def mirrored(self) -> List[str]:
        """Return a line for each pattern that some cameras see mirrored to others."""
        lines = []
        for name in self._patterns:
            by_colour: Dict[bool, Set[str]] = {True: set(), False: set()}
            for of_one in self._figures.values():
                for (sensor, pattern), figures in of_one.items():
                    if pattern == name and STARTS_BLACK in figures:
                        by_colour[figures[STARTS_BLACK] > 0.5].add(sensor)
            black, white = (", ".join(sorted(by_colour[colour])) for colour in (True, False))
            if black and white:
                lines.append(
                    f"the pattern is mirrored: of '{name}' the square before the first corner is "
                    f"black to {black} and white to {white}, which no board is: one of these "
                    f"images is mirrored, or there are two boards; switch the mirroring off in "
                    f"the driver and collect again"
                )
        return lines

    def guidance(self) -> Dict[str, Guidance]:
        """Return where in its view each sensor has seen boards, and what is missing."""
        views: Dict[str, List[BoardView]] = {name: [] for name in self._sensors}
        for key in sorted(self._figures):
            for (sensor, _), figures in self._figures[key].items():
                view = board_view(figures)
                if view is not None and sensor in views:
                    views[sensor].append(view)
        return {n: guidance(v, self._sensors[n].camera is not None) for n, v in views.items()}

    def sizes(self) -> List[str]:
        """Return a line for each 3D LiDAR to which a board is not of the configured size."""
        remarks = []
        for (sensor, name), boards in self._seen_sizes().items():
            border = self._patterns[name].border
            remarks.append(size_remark(sensor, name, border, find_size(boards, border)))
        return [remark for remark in remarks if remark is not None]

    def smaller(self) -> List[str]:
        """Return the 3D LiDARs to which a board is surely smaller than configured."""
        found = []
        for (sensor, name), boards in self._seen_sizes().items():
            border = self._patterns[name].border
            if is_surely_smaller(border, find_size(boards, border)):
                found.append(sensor)
        return found

    def _seen_sizes(self) -> Dict[Key, List[SeenBoard]]:
        seen: Dict[Key, List[SeenBoard]] = defaultdict(list)
        for of_one in self._sizes.values():
            for key, board in of_one.items():
                seen[key].append(board)
        return seen

    def of_one(self, key: str) -> str:
        """Return what one collection is like, in a line; empty if nothing is known."""
        parts = []
        for (sensor, name), figures in self._figures.get(key, {}).items():
            if described(figures):
                parts.append(f"{self._named(sensor, name)} {described(figures)}")
        return "; ".join(parts)

    def summary(self) -> Iterator[str]:
        """Yield lines of a table: median and range of each figure, by sensor."""
        by_label: Dict[Key, List[Figures]] = defaultdict(list)
        for of_one in self._figures.values():
            for key, figures in of_one.items():
                by_label[key].append(figures)
        shown = [k for k in _SHOWN if any(k in f for fs in by_label.values() for f in fs)]
        if not shown:
            return
        yield (
            f"{'median (range)':16}" + "".join(f"{_SHOWN[k][0]:>20}" for k in shown) + "  exposure"
        )
        for (sensor, name), seen in by_label.items():
            cells = [_cell([f[k] for f in seen if k in f], _SHOWN[k][1]) for k in shown]
            line = f"{self._named(sensor, name):16}" + "".join(f"{cell:>20}" for cell in cells)
            yield f"{line}  {_exposures(seen)}".rstrip()

    def write(self, folder: Path) -> None:
        """Write all figures and the advice beside the dataset.

        Raises:
            OutputError: it cannot be written.
        """
        collections: Dict[str, Any] = {}
        for key in self._figures:
            entries: Dict[str, Dict[str, Any]] = defaultdict(dict)
            for (sensor, name), figures in self._figures[key].items():
                entries[sensor][name] = {"detected": True, **figures}
            for (sensor, name), failure in self._failures[key].items():
                entries[sensor][name] = {"detected": False, "reason": failure.reason}
            collections[key] = entries
        document = {"version": _VERSION, "collections": collections, "advice": self.advice()}
        write_json_atomically(folder / QUALITY_FILE, document)

    def _foreseen(
        self,
        sensor: str,
        pattern: Pattern,
        frames: Mapping[str, Frame],
        tree: Optional[TransformTree],
    ) -> Optional[ForeseenView]:
        """Return what a sensor should see of a board that a camera sees."""
        if tree is None or sensor not in self._sensors:
            return None
        target, stamp_s = self._sensors[sensor], frames[sensor].stamp_s
        for frame in frames.values():
            pose = frame.board_pose(pattern) if pattern.name in frame.labels else None
            if pose is None:
                continue
            try:
                sensor_T_camera = tree.lookup(target.frame, frame.sensor.frame, stamp_s)
            except (TransformError, DatasetError):
                continue
            camera = None if target.kind.measures_range else target.camera
            return foreseen_view(camera, pattern, sensor_T_camera @ pose)
        return None

    def _named(self, sensor: str, pattern: str) -> str:
        return sensor if len(self._patterns) == 1 else f"{sensor} ({pattern})"


def _subject(line: str) -> str:
    """Return a line of advice without what changes with every collection."""
    return same_reason(line)


def _seen_size(labeled: Labeled, away_m: float) -> SeenBoard:
    """Return what the outline of a label says of the board's size."""
    width, height = (labeled.quality.get(f"measured_{s}_m", np.nan) for s in ("width", "height"))
    return SeenBoard(away_m, (width, height))


def _cell(values: List[float], decimals: int) -> str:
    if not values:
        return "---"
    low, high = min(values), max(values)
    return f"{np.median(values):.{decimals}f} ({low:.{decimals}f}..{high:.{decimals}f})"


def _exposures(figures: List[Figures]) -> str:
    """Return how many labels are exposed well; empty where no image is."""
    words = [word for word in map(exposure_word, figures) if word]
    wrong = [f"{words.count(w)} {w}" for w in ("over", "under") if words.count(w)]
    return "" if not words else ", ".join(wrong) or "good"
