"""How large boards look to sensors whose labeler measures outlines, against the configuration."""

from __future__ import annotations

from typing import Any, Dict, Iterable, Iterator, List, Tuple

import numpy as np

from atom_core import native
from atom_core.errors import NativeModuleError
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.board_size import (
    SizeFinding,
    few_boards_remark,
    find_size,
    size_remark,
)
from atom_core.model.config import GREATEST_SQUARE_M
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, RangeLabel
from atom_core.problem.measured_size import MeasuredSide


class _Boards(Iterable[Tuple[Any, np.ndarray]]):
    """Clouds of a sensor, each with a seed on its board, read when their turn comes.

    Together they may be larger than the memory: 400 clouds of 128 layers are 2.5 GB.
    """

    def __init__(self, dataset: Dataset):
        self._dataset = dataset
        self.keys: List[DetectionKey] = []

    def __iter__(self) -> Iterator[Tuple[Any, np.ndarray]]:
        for key in self.keys:
            label = self._dataset.label(key)
            assert isinstance(label, RangeLabel)
            cloud = self._dataset.data.read(key.collection, key.sensor)
            yield cloud, np.mean(cloud[label.indices], axis=0)


def look_at_boards(dataset: Dataset) -> Tuple[List[MeasuredSide], List[str]]:
    """Return the sides of boards, and a sentence for each sensor to which one is of another size.

    The labeler looks again at each labeled cloud. Its outline is laid between the last return on
    the board and the first beside it, so that it tells more than limit points do. Where the
    compiled module is not built, one sentence says that nothing was looked at. It names no sensor,
    for it is no remark on one.
    """
    sides: List[MeasuredSide] = []
    remarks: List[str] = []
    labeled = _labeled(dataset)
    if labeled:
        try:
            native.require("Checking how large boards look in clouds")
        except NativeModuleError as error:
            return sides, [str(error)]
    for (name, pattern), boards in labeled.items():
        sensor, border = dataset.sensors[name], dataset.patterns[pattern].border
        see = sensor.kind.seen_boards
        if see is None or dataset.patterns[pattern].square_m > GREATEST_SQUARE_M:
            continue  # a board in another unit is searched for ever
        seen = see(boards, border, sensor.beam_width_rad)
        finding = find_size(seen, border)
        if finding is None:
            few = few_boards_remark(name, pattern, border, seen)
            remarks += [] if few is None else [few]
            continue
        sides += _sides(name, pattern, border, finding)
        remark = size_remark(name, pattern, border, finding)
        if remark is not None:
            remarks.append(remark + _or_wide_beams(dataset, name, pattern, boards, finding))
    return sides, remarks


def _labeled(dataset: Dataset) -> Dict[Tuple[str, str], _Boards]:
    """Return by sensor and pattern the labeled clouds with a point on the board."""
    found: Dict[Tuple[str, str], _Boards] = {}
    for key, label in dataset.detections():
        wanted = dataset.sensors[key.sensor].kind.seen_boards is not None
        if wanted and isinstance(label, RangeLabel) and len(label.indices):
            boards = found.setdefault((key.sensor, key.pattern), _Boards(dataset))
            boards.keys.append(key)
    return found


def _sides(
    sensor: str, pattern: str, border: Rectangle, finding: SizeFinding
) -> List[MeasuredSide]:
    return [
        MeasuredSide(
            *(sensor, pattern, across, 2.0 * float(border.half_size[across])),
            *(finding.sides_m[across], finding.sigma_m[across], finding.counts[across]),
        )
        for across in (0, 1)
        if np.isfinite(finding.sides_m[across])
    ]


def _or_wide_beams(
    dataset: Dataset, name: str, pattern: str, boards: _Boards, finding: SizeFinding
) -> str:
    """Return what else may enlarge a board to a sensor, if that is possible; empty if not."""
    border, estimate = dataset.patterns[pattern].border, dataset.sensors[name].kind.beam_width
    longer = np.array(finding.sides_m) - 2.0 * border.half_size
    no_beams = (finding.by_size and not finding.by_beams) or finding.range_offset_m is not None
    if estimate is None or np.nanmin(longer) < 0.0 or no_beams:
        return ""
    width = estimate(boards, border)
    if width is None:
        return ""
    return (
        f". If the board is right, the sensor's beams are {width.width_rad:.4f} rad wide "
        f"(+- {width.sigma_rad:.4f}, from {width.boards} boards): write beam_width: "
        f"{width.width_rad:.4f} to sensor '{name}' in the configuration, and collect anew"
    )
