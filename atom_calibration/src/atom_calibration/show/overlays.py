"""What each camera saw of the boards, and where the calibration puts them, as pictures.

Squares are detected corners, crosses those that the calibration projects; depth images show their
labeled pixels. Outlines are the projected borders: thin and white (grey, where all collections
lie over each other) as it began, coloured as it is.
"""

from __future__ import annotations

from typing import Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_calibration.modalities.table import ros_modality
from atom_calibration.show.estimate import Estimate
from atom_core import opencv as cv2
from atom_core.editing.guess_fit import draw_points, pixels_of_points
from atom_core.errors import AtomError
from atom_core.geometry import se3
from atom_core.geometry.camera import Camera
from atom_core.model.colours import Colour
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey

_SHIFT, _UNIT = 4, 16  # OpenCV draws in sixteenths of a pixel
_BORDER_STEP_M = 0.02
_NEAREST_M = 0.05  # before a camera; what is nearer has no place in its image
_DIM, _FAINT = 0.35, 0.6  # brightness of the image below, for all collections and for one
_WHITE, _GREY = (255, 255, 255), (140, 140, 140)
_TILE_WIDTH_PX, _MOST_IN_A_COLUMN = 640, 4
_NAME_SCALE = 1.7  # of a name in a tile, which is shown smaller still
_MOST_POINTS = 6000  # of a cloud that are drawn
_FARTHEST_PX = 20000.0  # OpenCV's coordinates are short


class Overlays:
    """Pictures of a dataset's cameras and depth cameras; images are read once."""

    def __init__(self, first: Estimate, colours: Mapping[str, Colour]):
        """Remember where the calibration began.

        Args:
            first: the estimate at the start.
            colours: by collection.
        """
        self._first = first
        self._colours = {key: _bgr(colour) for key, colour in colours.items()}
        self._images: Dict[Tuple[str, str], np.ndarray] = {}

    def pictures(
        self,
        estimate: Estimate,
        shown: Optional[str] = None,
        clouds: Optional[Mapping[str, Colour]] = None,
    ) -> Dict[str, np.ndarray]:
        """Return a picture (height, width, 3) of each sensor with a camera.

        Args:
            estimate: what is shown.
            shown: key of a collection; None: all of them over each other.
            clouds: colours by sensor of the range sensors whose points are drawn into the images of
                all others: the clouds of one collection, of all of them the points on the boards.
        """
        dataset, used = estimate.dataset, estimate.used_collections()
        keys = used if shown is None else [shown]
        made = {}
        for sensor in dataset.sensors.values():
            if sensor.camera is not None:
                below = _with_data(dataset, sensor.name, keys)
                brightness = _DIM if shown is None else _FAINT
                made[sensor.name] = self._image(dataset, below, sensor.name, brightness)
        if clouds:
            self._draw_clouds(made, estimate, keys, clouds)
        self._draw_points(made, estimate, keys)
        for sensor_name in made:
            self._draw_borders(made[sensor_name], estimate, sensor_name, keys)
        self._draw_corners(made, estimate, keys)
        return made

    def _image(
        self, dataset: Dataset, key: Optional[str], name: str, brightness: float
    ) -> np.ndarray:
        """Return the image below, dimmed; black where there is none."""
        camera = dataset.sensors[name].camera
        assert camera is not None
        blank = np.zeros((camera.height, camera.width, 3), np.uint8)
        if key is None:
            return blank
        if (key, name) not in self._images:
            self._images[(key, name)] = _read(dataset, key, name, blank)
        return (brightness * self._images[(key, name)]).astype(np.uint8)

    def _draw_points(
        self, made: Mapping[str, np.ndarray], estimate: Estimate, keys: Sequence[str]
    ) -> None:
        for points in estimate.points():
            picture = made.get(points.key.sensor)
            if picture is None or points.key.collection not in keys:
                continue
            row, column = np.divmod(points.ids, picture.shape[1])
            colour = np.array(self._colours[points.key.collection])
            picture[row, column] = _WHITE if points.border else (0.6 * colour).astype(np.uint8)

    def _draw_clouds(
        self,
        made: Mapping[str, np.ndarray],
        estimate: Estimate,
        keys: Sequence[str],
        colours: Mapping[str, Colour],
    ) -> None:
        """Draw what range sensors measured to where the poses put it in the images."""
        for sensor, key, points in _measured(estimate, keys):
            world_T_sensor = estimate.sensor_poses.get((sensor, key))
            if world_T_sensor is None or sensor not in colours:
                continue
            for name, picture in made.items():
                world_T_camera = estimate.sensor_poses.get((name, key))
                if name == sensor or world_T_camera is None:
                    continue
                camera = estimate.dataset.sensors[name].camera
                assert camera is not None
                in_camera = se3.apply(se3.inverse(world_T_camera) @ world_T_sensor, points)
                draw_points(picture, pixels_of_points(camera, in_camera), _bgr(colours[sensor]))

    def _draw_borders(
        self, picture: np.ndarray, estimate: Estimate, sensor: str, keys: Sequence[str]
    ) -> None:
        for now, thickness in ((self._first, 1), (estimate, 2)):
            for key in now.problem.detections:
                if key.sensor == sensor and key.collection in keys:
                    began = _WHITE if len(keys) == 1 else _GREY
                    colour = began if thickness == 1 else self._colours[key.collection]
                    for line in _border(now, key):
                        cv2.polylines(
                            picture, [line], False, colour, thickness, cv2.LINE_AA, _SHIFT
                        )

    def _draw_corners(
        self, made: Mapping[str, np.ndarray], estimate: Estimate, keys: Sequence[str]
    ) -> None:
        for corners in estimate.corners():
            picture = made.get(corners.key.sensor)
            if picture is None or corners.key.collection not in keys:
                continue
            colour = self._colours[corners.key.collection]
            for detected, projected in zip(_fixed(corners.detected), _fixed(corners.projected)):
                size = np.array([4 * _UNIT, 4 * _UNIT])
                cv2.rectangle(
                    picture,
                    tuple(map(int, detected - size)),
                    tuple(map(int, detected + size)),
                    _WHITE,
                    1,
                    cv2.LINE_AA,
                    _SHIFT,
                )
                _cross(picture, projected, colour)


def _measured(estimate: Estimate, keys: Sequence[str]) -> Iterator[Tuple[str, str, np.ndarray]]:
    """Yield sensor, collection and points (n, 3) [m] in the sensor's frame."""
    if len(keys) > 1:
        for points in estimate.points():
            if points.key.collection in keys:
                yield points.key.sensor, points.key.collection, points.points.astype(float)
        return
    dataset = estimate.dataset
    for sensor in dataset.sensors.values():
        cloud = ros_modality(sensor.modality).cloud
        for key in keys:
            if cloud is None or not dataset.data.has_data(key, sensor.name):
                continue
            try:
                whole = np.asarray(cloud(dataset.data.read(key, sensor.name)), dtype=float)
            except AtomError:
                continue  # it costs the picture, not the view
            finite = whole[np.all(np.isfinite(whole), axis=1)]
            yield sensor.name, key, finite[:: -(-len(finite) // _MOST_POINTS) or 1]


def mosaic(pictures: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return pictures with their names, each of the same width; something black without any.

    Up to four stand in one column, more in two.
    """
    if not pictures:
        return np.zeros((_TILE_WIDTH_PX // 2, _TILE_WIDTH_PX, 3), np.uint8)
    columns = 1 if len(pictures) <= _MOST_IN_A_COLUMN else 2
    tiles = [_scaled(picture) for picture in pictures.values()]
    for tile, name in zip(tiles, pictures):
        _write(tile, name, _NAME_SCALE)
    return np.concatenate(
        [_row(tiles[start : start + columns], columns) for start in range(0, len(tiles), columns)]
    )


def _row(tiles: Sequence[np.ndarray], columns: int) -> np.ndarray:
    height = max(len(tile) for tile in tiles)
    row = np.zeros((height, columns * _TILE_WIDTH_PX, 3), np.uint8)
    for number, tile in enumerate(tiles):
        left = number * _TILE_WIDTH_PX
        row[: len(tile), left : left + _TILE_WIDTH_PX] = tile
    return row


def _scaled(picture: np.ndarray) -> np.ndarray:
    height = int(round(picture.shape[0] * _TILE_WIDTH_PX / picture.shape[1]))
    return cv2.resize(picture, (_TILE_WIDTH_PX, height), interpolation=cv2.INTER_AREA)


def _border(estimate: Estimate, key: DetectionKey) -> List[np.ndarray]:
    """Return the lines of the projected border."""
    pattern = estimate.dataset.patterns[key.pattern]
    camera = estimate.dataset.sensors[key.sensor].camera
    assert camera is not None
    flat = pattern.border.sample(_BORDER_STEP_M)
    in_camera = se3.apply(
        estimate.poses_in_sensor[key], np.column_stack([flat, np.zeros(len(flat))])
    )
    return visible_lines(camera, in_camera)


def visible_lines(camera: Camera, points: np.ndarray) -> List[np.ndarray]:
    """Return the closed line through points (n, 3) [m] as OpenCV draws it, cut where it is behind.

    Each part is (m, 1, 2) int32, in sixteenths of a pixel.
    """
    visible = points[:, 2] > _NEAREST_M
    if np.all(visible):
        return [_fixed(camera.project(np.vstack([points, points[:1]])))[:, None]]
    if not np.any(visible):
        return []
    begin = int(np.argmin(visible))  # behind the camera, so that no line runs over the end
    points, visible = np.roll(points, -begin, axis=0), np.roll(visible, -begin)
    steps = np.flatnonzero(np.diff(visible.astype(int))) + 1
    parts = [part for part in np.split(np.arange(len(points)), steps) if visible[part[0]]]
    return [_fixed(camera.project(points[part]))[:, None] for part in parts if len(part) > 1]


def _with_data(dataset: Dataset, sensor: str, keys: Sequence[str]) -> Optional[str]:
    return next((key for key in keys if dataset.data.has_data(key, sensor)), None)


def _read(dataset: Dataset, key: str, name: str, blank: np.ndarray) -> np.ndarray:
    """Return an image to draw on; a file that cannot be read costs the picture, not the view."""
    try:
        draw = ros_modality(dataset.sensors[name].modality).background
        return blank if draw is None else draw(dataset.data.read(key, name))
    except AtomError:
        return blank


def _fixed(pixels: np.ndarray) -> np.ndarray:
    limited = np.clip(np.nan_to_num(pixels), -_FARTHEST_PX, _FARTHEST_PX)
    return np.round(_UNIT * limited).astype(np.int32)


def _cross(picture: np.ndarray, centre: np.ndarray, colour: Tuple[int, int, int]) -> None:
    x, y, arm = int(centre[0]), int(centre[1]), 5 * _UNIT
    cv2.line(picture, (x - arm, y), (x + arm, y), colour, 1, cv2.LINE_AA, _SHIFT)
    cv2.line(picture, (x, y - arm), (x, y + arm), colour, 1, cv2.LINE_AA, _SHIFT)


def _write(picture: np.ndarray, words: str, scale: float) -> None:
    for colour, thickness in (((0, 0, 0), 4), (_WHITE, 2)):
        cv2.putText(
            picture,
            words,
            (int(10 * scale), int(30 * scale)),
            cv2.FONT_HERSHEY_SIMPLEX,
            scale,
            colour,
            max(int(thickness * scale), 1),
            cv2.LINE_AA,
        )


def _bgr(colour: Colour) -> Tuple[int, int, int]:
    red, green, blue = (int(round(255 * value)) for value in colour)
    return blue, green, red
