"""3D sensors: a cloud, a point near the board and the pattern in, the board's returns out.

Planes and outlines are found in C++ (``board_segmentation.h``), by the layers of a spinning scanner
where the cloud has them, by the outline in the plane where it has none; here clouds are read, and
results become labels. Clouds that are depth images are labeled as such (`image_cloud`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np

from atom_core import native
from atom_core.errors import LabelingError
from atom_core.geometry.rectangle import Rectangle
from atom_core.labeling.base import Labeled, nothing
from atom_core.labeling.image_cloud import ImageCloud, as_image, label_in_image
from atom_core.labeling.scan_gaps import scan_gaps
from atom_core.model.config import PatternConfig
from atom_core.model.labels import Label, RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR3D, Sensor

_RING_FIELDS = ("ring", "channel", "line", "laser_id")  # as drivers call it
_FIGURES = (
    *("plane_sigma_m", "border_rms_m", "measured_width_m", "measured_height_m"),
    *("expected_points", "visible", "hidden", "through"),
)
_FIGURES_OF_LAYERS = ("layers", "in_view", "dark")
_FIGURES_OF_OUTLINES = ("point_spacing_m", "in_view")


@dataclass(frozen=True, eq=False)
class Cloud:
    """A cloud as a labeler takes it.

    Attributes:
        points: (n, 3) [m] in the sensor's frame, row by row; NaN and zeros are invalid.
        ring: (n,) layer of each point, or None where unknown.
        width, height: organisation; height 1 where there is none.
        scan: what `find_layers` returns of it, where that is done already.
    """

    points: np.ndarray
    ring: Optional[np.ndarray] = None
    width: int = 0
    height: int = 1
    scan: Any = None


_WHOLE = 0.95  # share of a board in view
_WHOLE_ELSEWHERE = (
    "the view cuts the board at the seed ({:.0%} of it are in view), so that its size is not "
    "known, and a whole board of the configured size stands elsewhere; put the seed there, or "
    "bring all of this one into view"
)
ALIKE = "planes_alike"  # in the quality: planes of the board's size, where there are several
_MILLIMETRE = 0.001
_BEYOND_ALL_M, _EVERY = 300.0, 16  # median range of no LiDAR; of the points that tell it
_NO_BOARD = "no plane of the board's size and outline is in the cloud"

CloudLike = Union[Cloud, np.ndarray]


@dataclass(frozen=True)
class Lidar3dOptions:
    """What a board looks like in a cloud.

    Attributes:
        least_layers: fewer layers on a plane are no board.
        beam_width_rad: full angle within which a beam returns from the board though its middle
            passes it; 0 for point-like beams. It enlarges the outline that is expected.
        dark_square_m: side of squares that may return nothing; 0: a hole is a hole. The labeler
            takes the pattern's.
        use_layers: False: do as if the cloud had no scan layers.
        use_image: False: do as if the cloud were no depth image.
    """

    least_layers: int = 4
    beam_width_rad: float = 0.0
    dark_square_m: float = 0.0
    use_layers: bool = True
    use_image: bool = True


class FoundBoard(NamedTuple):
    """A plane of the board's size: its label, and where it lies.

    Attributes:
        labeled: the label and its quality.
        sensor_T_centre: (4, 4) pose of the board's middle, x along its width, y along its height, z
            away from the sensor; half a turn about z remains open.
    """

    labeled: Labeled
    sensor_T_centre: np.ndarray


class ExpectedPoints(NamedTuple):
    """How many returns a board gives, and from how many layers."""

    points: int
    layers: int


class Lidar3dLabeler:
    """Finds one pattern in clouds of one LiDAR."""

    def __init__(
        self,
        sensor: Sensor,
        pattern: Pattern,
        config: Optional[PatternConfig] = None,
        options: Optional[Lidar3dOptions] = None,
    ):
        """Take what is known of sensor and pattern."""
        self._place = f"sensor '{sensor.name}', pattern '{pattern.name}'"
        self._sensor, self._pattern, self._border = sensor, pattern, pattern.border
        self._options = options or Lidar3dOptions(
            beam_width_rad=sensor.beam_width_rad, dark_square_m=pattern.square_m
        )

    def label(self, data: Any, seed: Optional[np.ndarray] = None) -> Labeled:
        """Label one cloud.

        Args:
            data: ``Cloud``; (n, 3) or (height, width, 3) [m]; or a structured array with fields
                x, y, z and perhaps ring.
            seed: (3,) [m] near the board, in the sensor's frame; None: search the cloud for it.

        Raises:
            LabelingError: the data are no cloud, or in another unit, or the seed is no point.
        """
        try:
            cloud = as_cloud(data)
            labeled = self._labeled(cloud, seed)
            if not labeled.detected:
                self._check_unit(cloud, seed)
            return labeled
        except LabelingError as error:
            raise LabelingError(f"{self._place}: {error}") from None

    def _labeled(self, cloud: Cloud, seed: Optional[np.ndarray]) -> Labeled:
        in_image = self._in_image(cloud, seed)
        if in_image is not None:
            return in_image
        cloud = replace(cloud, scan=_scan(cloud, self._options))  # once for all that follows
        if seed is not None:
            return self._at_seed(cloud, seed)
        found = _searched(cloud, self._border, self._options)
        labeled = found[0].labeled if found else nothing(LIDAR3D, _NO_BOARD)
        return labeled if labeled.detected else self._behind_gap(cloud) or labeled

    def _check_unit(self, cloud: Cloud, seed: Optional[np.ndarray]) -> None:
        """Raise an error where a board is found only if the coordinates are millimetres."""
        ranges = np.linalg.norm(np.asarray(cloud.points)[::_EVERY], axis=-1)
        ranges = ranges[np.isfinite(ranges) & (ranges > 0.0)]
        if not len(ranges) or np.median(ranges) <= _BEYOND_ALL_M:
            return
        metres = Cloud(_MILLIMETRE * cloud.points, cloud.ring, cloud.width, cloud.height)
        if self._labeled(metres, seed).detected:
            raise LabelingError(
                f"the board has its size only when coordinates are multiplied by {_MILLIMETRE:g}; "
                f"they look like millimetres, where PointCloud2 has metres (REP 103); correct the "
                f"driver"
            )

    def _at_seed(self, cloud: Cloud, seed: np.ndarray) -> Labeled:
        """Label at a seed; unsure where one side alone is measured, and a whole board is seen.

        By layers nothing is searched for: it would be too slow while a seed is dragged.
        """
        found = board_at(cloud, self._border, seed, self._options).labeled
        in_view = found.quality.get("in_view", 1.0)
        is_measured = {"measured_width_m", "measured_height_m"} <= set(found.quality)
        by_layers = "layers" in found.quality
        if by_layers and not found.detected:
            return self._behind_gap(cloud, seed) or found
        if by_layers or not found.detected or in_view >= _WHOLE or is_measured:
            return found
        for other in find_boards(cloud, self._border, self._options):
            is_whole = other.labeled.quality.get("in_view", 1.0) >= _WHOLE
            if is_whole and not _overlap(found.label, other.labeled.label):
                reason = _WHOLE_ELSEWHERE.format(in_view)
                return nothing(LIDAR3D, reason, found.quality, found)
        return found

    def _behind_gap(self, cloud: Cloud, seed: Optional[np.ndarray] = None) -> Optional[Labeled]:
        """Return the label of a board through which a gap of the scan runs, if there is one.

        Args:
            cloud: what was measured, with its layers.
            seed: (3,) [m] near the board; None: it may be anywhere.
        """
        if not cloud.scan.has_layers:
            return None
        width, height = 2.0 * self._border.half_size
        for gap in scan_gaps(cloud.points, min(width, height)):
            if seed is not None and np.linalg.norm(gap.seed - seed) > np.hypot(width, height):
                continue
            hole_m = max(self._options.dark_square_m, gap.width_m)
            options = replace(self._options, dark_square_m=hole_m)
            labeled = board_at(cloud, self._border, gap.seed, options).labeled
            if labeled.detected:
                return labeled
        return None

    def prepare(self, data: Any) -> Cloud:
        """Return a cloud with its layers found, unless it is a depth image.

        Raises:
            LabelingError: the data are no cloud.
        """
        try:
            cloud = as_cloud(data)
            if self._image(cloud) is not None or not self._options.use_layers:
                return cloud
            return replace(cloud, scan=find_layers(cloud))
        except LabelingError as error:
            raise LabelingError(f"{self._place}: {error}") from None

    def _in_image(self, cloud: Cloud, seed: Optional[np.ndarray]) -> Optional[Labeled]:
        """Label a cloud that is a depth image; None where it is none."""
        image = None if cloud.scan is not None else self._image(cloud)
        if image is None:
            return None
        return label_in_image(image, cloud.points, self._sensor, self._pattern, seed)

    def _image(self, cloud: Cloud) -> Optional[ImageCloud]:
        if cloud.ring is not None or not self._options.use_image:
            return None
        return as_image(np.asarray(cloud.points, dtype=float), cloud.width, cloud.height)


def _overlap(label: Label, other: Label) -> bool:
    assert isinstance(label, RangeLabel) and isinstance(other, RangeLabel)
    return bool(np.intersect1d(label.indices, other.indices).size)


def as_cloud(data: CloudLike) -> Cloud:
    """Return a cloud of any of the forms that ``Lidar3dLabeler.label`` takes.

    Raises:
        LabelingError: it is none of them.
    """
    if isinstance(data, Cloud):
        return data
    array = np.asarray(data)
    if array.dtype.names is not None:
        return _from_fields(array)
    if array.ndim not in (2, 3) or array.shape[-1] != 3:
        raise LabelingError(
            f"a cloud has the shape (n, 3) or (height, width, 3), not {array.shape}"
        )
    if array.ndim == 3:
        return Cloud(array.reshape(-1, 3), None, array.shape[1], array.shape[0])
    return Cloud(array, None, len(array), 1)


def _from_fields(array: np.ndarray) -> Cloud:
    names = array.dtype.names or ()
    absent = [axis for axis in "xyz" if axis not in names]
    if absent:
        raise LabelingError(
            f"the cloud has no field '{absent[0]}' (it has {', '.join(names)}); "
            f"a cloud needs x, y and z"
        )
    flat = array.reshape(-1)
    points = np.stack([flat[axis].astype(float) for axis in "xyz"], axis=-1)
    rings = [name for name in _RING_FIELDS if name in names]
    ring = flat[rings[0]] if rings else None
    height, width = array.shape if array.ndim == 2 else (1, len(flat))
    return Cloud(points, ring, width, height)


def find_layers(cloud: Cloud) -> Any:
    """Return the compiled module's ``Scan``: the cloud with its layers, in any orientation.

    Raises:
        LabelingError: the cloud's parts do not fit together.
        NativeModuleError: the compiled module is not built.
    """
    core = native.require("Labeling a cloud")
    points = np.ascontiguousarray(cloud.points, dtype=float)
    ring = np.zeros(0, dtype=np.int64) if cloud.ring is None else _whole(cloud.ring)
    try:
        return core.find_layers(points, ring, int(cloud.width), int(cloud.height))
    except ValueError as error:
        raise LabelingError(f"the cloud cannot be used: {error}") from error


def _scan(cloud: Cloud, options: Lidar3dOptions) -> Any:
    if cloud.scan is not None and (options.use_layers or not cloud.scan.has_layers):
        return cloud.scan
    scan = find_layers(cloud)
    scan.has_layers = scan.has_layers and options.use_layers
    return scan


def _whole(ring: np.ndarray) -> np.ndarray:
    """Return rings as whole numbers; some drivers write them as floats, NaN where invalid."""
    numbers = np.asarray(ring)
    if numbers.dtype.kind == "f":
        numbers = np.where(np.isfinite(numbers), numbers, -1)
    return np.ascontiguousarray(numbers, dtype=np.int64)


def board_at(
    cloud: Cloud,
    border: Rectangle,
    seed: np.ndarray,
    options: Lidar3dOptions = Lidar3dOptions(),
) -> FoundBoard:
    """Look for a board near a seed; the label is empty, with a reason, where there is none.

    Args:
        cloud: what was measured.
        border: the board's edges [m].
        seed: (3,) [m] in the sensor's frame.
        options: what counts as a board.

    Raises:
        LabelingError: the seed is not a point, or the cloud cannot be used.
    """
    seed = np.asarray(seed, dtype=float)
    if seed.shape != (3,) or not np.all(np.isfinite(seed)):
        raise LabelingError(f"a seed is a point (3,) in metres, not {seed.tolist()}")
    scan = _scan(cloud, options)
    core = native.require("Labeling a cloud")
    width, height = 2.0 * border.half_size
    segment = core.segment_board(
        *(scan, seed, width, height),
        *(options.least_layers, options.beam_width_rad, options.dark_square_m),
    )
    return _found(cloud, segment, scan.has_layers)


def find_boards(
    cloud: Cloud, border: Rectangle, options: Lidar3dOptions = Lidar3dOptions()
) -> List[FoundBoard]:
    """Search a whole cloud for planes of a board's size and outline, without a seed.

    Args:
        cloud: what was measured.
        border: the board's edges [m].
        options: what counts as a board.

    Returns:
        The boards, the one that fits best first. Where there are several, all carry a warning.
    """
    return [found for found in _searched(cloud, border, options) if found.labeled.detected]


def _searched(cloud: Cloud, border: Rectangle, options: Lidar3dOptions) -> List[FoundBoard]:
    """Return the boards; where there is none, what comes nearest to one, with what it lacks."""
    scan = _scan(cloud, options)
    core = native.require("Labeling a cloud")
    width, height = 2.0 * border.half_size
    segments = core.find_boards(
        *(scan, width, height),
        *(options.least_layers, options.beam_width_rad, options.dark_square_m),
    )
    alike = sum(bool(segment["detected"]) for segment in segments)
    for segment in segments:
        if not segment["detected"]:
            place = ", ".join(f"{x:.2f}" for x in segment["sensor_T_board"][:3, 3])
            segment["reason"] = f"{_NO_BOARD}; nearest to one is what is at ({place}) m: " + str(
                segment["reason"]
            )
    return [_found(cloud, segment, scan.has_layers, alike) for segment in segments]


def _found(cloud: Cloud, segment: Mapping[str, Any], by_layers: bool, alike: int = 1) -> FoundBoard:
    sensor_T_centre = segment["sensor_T_board"]
    quality = _quality(segment, _FIGURES_OF_LAYERS if by_layers else _FIGURES_OF_OUTLINES)
    several = f"{alike} planes have the board's size; the one that fits best is taken"
    if alike > 1:
        quality[ALIKE] = float(alike)
    if not segment["detected"] and not segment["unsure"]:
        return FoundBoard(nothing(LIDAR3D, segment["reason"], quality), sensor_T_centre)
    label = RangeLabel(segment["indices"], segment["limit_indices"])
    points = np.asarray(cloud.points, dtype=float)[label.indices]
    labeled = Labeled(
        label,
        quality=quality,
        next_seed=points.mean(axis=0),
        warnings=(several,) if alike > 1 else (),
    )
    if segment["unsure"]:
        labeled = nothing(LIDAR3D, segment["reason"], quality, labeled)
    return FoundBoard(labeled, sensor_T_centre)


def _quality(segment: Mapping[str, Any], own: Sequence[str]) -> Dict[str, float]:
    figures = {name: float(segment[name]) for name in (*_FIGURES, *own)}
    figures["incidence_deg"] = float(np.degrees(segment["incidence_rad"]))
    figures["points"] = float(len(segment["indices"]))
    return {name: value for name, value in figures.items() if np.isfinite(value)}


def expected_points(
    border: Rectangle,
    distance_m: float,
    azimuth_step_rad: float,
    elevation_step_rad: float,
    incidence_rad: float = 0.0,
) -> ExpectedPoints:
    """Predict how many returns a board gives, before anything is recorded.

    Args:
        border: the board's edges [m].
        distance_m: from the LiDAR to the board's middle.
        azimuth_step_rad: between neighbours in a layer.
        elevation_step_rad: between layers.
        incidence_rad: between the beam and the board's normal.

    Returns:
        Returns by solid angle, and layers by the mean height of the board over all its rolls in its
        plane (Cauchy: perimeter over pi).
    """
    width, height = 2.0 * border.half_size
    cosine = np.cos(incidence_rad)
    solid_angle = width * height * cosine / distance_m**2
    mean_height = 2.0 * (width + height) / np.pi * (1.0 + cosine) / 2.0
    points = solid_angle / (azimuth_step_rad * elevation_step_rad)
    return ExpectedPoints(int(points), int(mean_height / distance_m / elevation_step_rad))
