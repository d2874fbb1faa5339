"""The kinds of pairs, which pairs a rig has, and how one detection pair is measured."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Callable, Iterable, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import SelectionError
from atom_core.evaluation import metrics
from atom_core.evaluation.observed import NotMeasurableError, Observed
from atom_core.evaluation.statistics import Errors
from atom_core.geometry import se3
from atom_core.geometry.units import MM_PER_M
from atom_core.model.labels import DetectionKey
from atom_core.model.modality import modalities
from atom_core.model.sensor import Sensor

Measure = Callable[[Observed, DetectionKey, DetectionKey, np.ndarray], Errors]


@dataclass(frozen=True)
class PairKind:
    """One way to compare two sensors.

    Attributes:
        name: as in ``evaluation.json``.
        source, target: modalities.
        metric: what is measured, in words for files.
        unit: px or mm.
        directed: the metric is another one when source and target change places.
        measure: errors of one detection pair, given ``target_T_source`` (4, 4).
        floor: what keeps the figure large even at the truth, in a sentence; then it says little of
            the calibration, and judges none. Empty: nothing does.
        proves: a small figure tells that both sensors are right. Without, only a large one tells
            something, that one of them is wrong.
        by_planes: it shows errors across boards only, and nothing else tells those along them: how
            the boards are tilted tells how far the sensors are apart (`board_displacement`).
    """

    name: str
    source: str
    target: str
    metric: str
    unit: str
    directed: bool
    measure: Measure
    floor: str = ""
    proves: bool = True
    by_planes: bool = False


@dataclass(frozen=True)
class Pair:
    """Two sensors and how they are compared; ``reverse`` pairs are not averaged."""

    kind: PairKind
    source: str
    target: str
    reverse: bool = False


def rgb_rgb(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Carry the source's corners to the target image over the board's plane [px].

    As ATOM does: the plane comes from the source's own corners, the pose difference is that of
    the board at its first corner, by the corners of either camera.
    """
    there, here = observed.corners(source), observed.corners(target)
    _, of_source, of_target = np.intersect1d(there.ids, here.ids, return_indices=True)
    if len(of_source) == 0:
        raise NotMeasurableError("the cameras have no corner in common")
    source_T_pattern = observed.camera_T_pattern(source)
    carried = metrics.carried_corners(
        there.camera, here.camera, source_T_pattern, target_T_source, there.pixels[of_source]
    )
    offsets = carried - here.pixels[of_target]
    pattern_T_corner = observed.first_corner(source.pattern)
    move, turn = se3.pose_difference(
        target_T_source @ source_T_pattern @ pattern_T_corner,
        observed.camera_T_pattern(target) @ pattern_T_corner,
    )
    return Errors(
        np.linalg.norm(offsets, axis=1), offsets, MM_PER_M * move, float(np.degrees(turn))
    )


def border_in_image(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Project a range sensor's limit points; distance to the continuous border [px]."""
    points = se3.apply(target_T_source, observed.limit_points(source))
    offsets, unseen = metrics.border_offsets(
        observed.camera(target.sensor), points, observed.border(target)
    )
    return _in_image(offsets, unseen, source, target)


def border_in_depth_image(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Project a range sensor's limit points; distance to the depth image's labeled border [px].

    A hand annotation of the depth image takes the labeled border's place.
    """
    if observed.has_annotation(target):
        return border_in_image(observed, source, target, target_T_source)
    points = se3.apply(target_T_source, observed.limit_points(source))
    offsets, unseen = metrics.pixel_offsets(
        observed.camera(target.sensor), points, observed.limit_pixels(target)
    )
    return _in_image(offsets, unseen, source, target)


def nearest_points(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Nearest neighbours over all labeled board points, in both directions [mm].

    Parts along x and y are those along the axes of the target's frame.
    """
    there, here = board_points(observed, source), board_points(observed, target)
    carried = se3.apply(target_T_source, there)
    offsets = MM_PER_M * metrics.mutual_nearest_offsets(carried, here)
    return Errors(np.linalg.norm(offsets, axis=1), offsets[:, :2])


def nearest_limit_points(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """For each limit point of the target the nearest one of the source, as ATOM does [mm]."""
    carried = se3.apply(target_T_source, observed.limit_points(source))
    return Errors(MM_PER_M * metrics.nearest_distances(observed.limit_points(target), carried))


def points_to_plane(
    observed: Observed, source: DetectionKey, target: DetectionKey, target_T_source: np.ndarray
) -> Errors:
    """Distances of the target's board points to the plane through the source's [mm]."""
    there, here = board_points(observed, source), board_points(observed, target)
    try:
        signed = metrics.plane_distances(here, se3.apply(target_T_source, there))
    except ValueError as error:
        raise NotMeasurableError(
            f"the points of '{source.sensor}' have no plane: {error}"
        ) from None
    return Errors(MM_PER_M * np.abs(signed))


def board_points(observed: Observed, key: DetectionKey) -> np.ndarray:
    """Return the labeled points (n, 3) [m] on a board, in the sensor's frame.

    Raises:
        NotMeasurableError: there are none.
    """
    inside = observed.points(key).inside
    if len(inside) == 0:
        raise NotMeasurableError(f"'{key.sensor}' has no labeled point with a value")
    return inside


def _in_image(
    offsets: np.ndarray, unseen: int, source: DetectionKey, target: DetectionKey
) -> Errors:
    if len(offsets) == 0:
        raise NotMeasurableError(
            f"no limit point of '{source.sensor}' is in the image of '{target.sensor}'"
        )
    return Errors.in_image(offsets, unseen)


def pair_kinds() -> List[PairKind]:
    """Return all kinds of pairs, those with the same target together."""
    known = [modality.name for modality in modalities()]
    kinds = [kind for modality in modalities() for kind in modality.pairs]
    return sorted(kinds, key=lambda kind: known.index(kind.target))


def pairs_of(sensors: Mapping[str, Sensor], chosen: Optional[Sequence[str]] = None) -> List[Pair]:
    """Return the pairs of a rig, kind by kind, in the order of the configuration.

    Args:
        sensors: of the rig, in the order of the configuration.
        chosen: only these, as "A:B" in either order; A and B are names or globs. None: all.

    Raises:
        SelectionError: an entry of ``chosen`` is malformed or names no pair.
    """
    pairs = [pair for kind in pair_kinds() for pair in _of_kind(kind, list(sensors.values()))]
    if chosen is None:
        return pairs
    wanted = [_split(text) for text in chosen]
    for text, names in zip(chosen, wanted):
        if not any(_matches(pair, names) for pair in pairs):
            raise SelectionError(
                f"--pairs {text}: no such pair can be compared; the sensors are "
                f"{', '.join(f'{s.name} ({s.modality})' for s in sensors.values())}"
            )
    return [pair for pair in pairs if any(_matches(pair, names) for names in wanted)]


def _of_kind(kind: PairKind, sensors: Sequence[Sensor]) -> Iterable[Pair]:
    for i, one in enumerate(sensors):
        for j, other in enumerate(sensors):
            if i == j or one.modality != kind.source or other.modality != kind.target:
                continue
            reverse = kind.source == kind.target and i > j
            if kind.directed or not reverse:
                yield Pair(kind, one.name, other.name, reverse)


def _split(text: str) -> Tuple[str, str]:
    source, colon, target = text.partition(":")
    if not (source and colon and target):
        raise SelectionError(f"--pairs {text}: write two sensors as A:B")
    return source, target


def _matches(pair: Pair, names: Tuple[str, str]) -> bool:
    def match(one: str, other: str) -> bool:
        return fnmatchcase(pair.source, one) and fnmatchcase(pair.target, other)

    return match(*names) or match(*reversed(names))
