"""Hand annotations of a board's border in the images of a camera, as ATOM's tool writes them.

``annotation_<sensor>.json`` stands beside the dataset. Per collection it holds the sides of one
board, ``{side: {xs, ys, ...}}``: pixels of the clicked polyline. ATOM has no level for the
pattern; where a dataset has several, ``{pattern: {side: ...}}`` is read as well, and whose sides
ATOM's are, the labels tell (evaluation/annotation_check.py).
"""

from __future__ import annotations

import getpass
import time
from pathlib import Path
from typing import Any, Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.geometry.polyline import evenly_spaced, segments_of
from atom_core.io.atomic import write_json_atomically
from atom_core.io.json_text import load_json
from atom_core.io.structure import OTHER_KIND
from atom_core.model.sensor import Sensor

SIDES = ("top", "right", "bottom", "left")
UNNAMED = ""  # in place of a pattern: sides of one of several, the file does not say which
PLANE = "plane"  # of a collection in the file of a LiDAR, which has points in space, no pixels

_METADATA, _VERSION, _SIZE = "_metadata", "2.0", "image_size"
_VERSION_1 = "ground_truth_pts"  # under which a file of version 1.0 has its collections
_EDGE_PX = 1.0  # a click on the rim of an image is rounded, which may put it just outside
_MOST_OUTSIDE = 0.25  # of the points; lines may be drawn on beyond the image, and are cut there

BorderKey = Tuple[str, str, str]  # collection, sensor, pattern


def annotation_path(folder: Path, sensor: str) -> Path:
    """Return where the annotations of a sensor are kept beside a dataset in a folder."""
    return Path(folder) / f"annotation_{sensor}.json"


def read_annotations(
    folder: Path, sensors: Mapping[str, Sensor], patterns: Collection[str]
) -> Dict[BorderKey, np.ndarray]:
    """Return the annotated borders as segments (m, 2, 2) [px]; sensors without a file have none.

    With several patterns, those of sides without a pattern have ``UNNAMED`` in its place.

    Args:
        folder: that the dataset stands in.
        sensors: those that are asked for; only cameras have any.
        patterns: all that the dataset describes, also where some are selected.

    Raises:
        DatasetError: a file is malformed, or was drawn in images of another size.
    """
    borders: Dict[BorderKey, np.ndarray] = {}
    for name, sensor in sensors.items():
        path = annotation_path(folder, name)
        if sensor.camera is not None and path.is_file():  # a LiDAR's holds points in space
            found = _borders(path, _document(path), patterns, sensor.camera, UNNAMED)
            for (collection, pattern), segments in found.items():
                borders[(collection, name, pattern)] = segments
    return borders


def read_lines(
    path: Path, patterns: Collection[str], pattern: str, camera: Optional[Camera] = None
) -> Dict[str, Dict[str, List[Tuple[float, float]]]]:
    """Return the clicked points [px] of a pattern by collection and side, to draw on.

    Raises:
        DatasetError: the file is malformed, or was drawn in images of another size than camera's.
    """
    if not path.is_file():
        return {}
    document = _document(path)
    _borders(path, document, patterns, camera)  # which refuses what is malformed
    return {
        collection: {
            side: list(map(tuple, points.tolist()))
            for side, points in _sides(_by_pattern(entry, patterns).get(pattern) or {}).items()
        }
        for collection, entry in _entries(document).items()
    }


def write_annotations(
    path: Path,
    lines: Mapping[str, Mapping[str, Sequence[Tuple[float, float]]]],
    *,
    patterns: Collection[str],
    pattern: str,
    points_per_pixel: float = 1.0,
    camera: Optional[Camera] = None,
) -> None:
    """Write the border that was drawn in some images of a sensor.

    What the file has of other collections and patterns stays. With one pattern alone its name does
    not stand in the file, as in ATOM's, unless it stands there already.

    Args:
        path: the file.
        lines: clicked points [px] by collection and side.
        patterns: all that the dataset describes.
        pattern: whose sides they are.
        points_per_pixel: how densely the lines are sampled for ATOM.
        camera: whose images have the size that is noted down (ATOM notes none).

    Raises:
        DatasetError: the file that is there holds no annotations, or those of other images.
        OutputError: it cannot be written.
    """
    document: Dict[str, Any] = {}
    if path.is_file():
        document = _document(path)
        _borders(path, document, patterns, camera)
    document[_METADATA] = metadata()
    if camera is not None:
        document[_METADATA][_SIZE] = [camera.width, camera.height]
    for collection, sides in lines.items():
        new = {side: _side(sides.get(side, ()), points_per_pixel) for side in SIDES}
        old = document.get(collection) or {}
        named = len(patterns) > 1 or (bool(old) and not _has_sides(old))
        document[collection] = {**old, pattern: new} if named else new
    write_json_atomically(path, document)


def metadata() -> Dict[str, str]:
    """Return who wrote a file of annotations, when, and in which version of the format."""
    return {
        "timestamp": str(time.time()),
        "date": time.asctime(),
        "user": _user(),
        "version": _VERSION,
    }


def _side(points: Sequence[Tuple[float, float]], points_per_pixel: float) -> Dict[str, Any]:
    clicked = np.array(points, dtype=float).reshape(-1, 2)
    sampled = np.round(evenly_spaced(clicked, points_per_pixel)).astype(int)
    (xs, ys), (ixs, iys) = clicked.T.tolist(), sampled.T.tolist()
    return {"xs": xs, "ys": ys, "ixs": ixs, "iys": iys}


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # of a number without a name, as in containers
        return "unknown"


def _document(path: Path) -> Dict[str, Any]:
    """Return the content of a file.

    Raises:
        DatasetError: it cannot be read, or is no JSON mapping.
    """
    try:
        document = load_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DatasetError(_unusable(path, error)) from None
    if not isinstance(document, dict):
        raise DatasetError(_unusable(path, "not a JSON mapping"))
    if _VERSION_1 not in document:
        return document
    try:
        return _of_version_1(document)
    except OTHER_KIND as error:
        raise DatasetError(_unusable(path, f"{_VERSION_1}, of version 1.0: {error}")) from None


def _of_version_1(document: Mapping[str, Any]) -> Dict[str, Any]:
    """Return what a file of version 1.0 has as one of now: sides have numbers, points are pairs.

    The numbers follow the order in which ATOM's tool goes along the sides.
    """
    made: Dict[str, Any] = {k: v for k, v in document.items() if k == _METADATA}
    for collection, lines in document[_VERSION_1].items():
        unknown = set(lines) - set(map(str, range(len(SIDES))))
        if unknown:
            raise ValueError(f"collection {collection} has a side {min(unknown)!r}, not 0 to 3")
        made[collection] = {}
        for i, side in enumerate(SIDES):
            points = np.array(lines.get(str(i), []), dtype=float)
            if points.size and (points.ndim != 2 or points.shape[1] != 2):
                raise ValueError(f"collection {collection}, side {i} is no list of (x, y)")
            xs, ys = points.reshape(-1, 2).T.tolist()
            made[collection][side] = {"xs": xs, "ys": ys}
    return made


def _unusable(path: Path, why: Any) -> str:
    return (
        f"{path}: not a file of border annotations ({why}); move it away to use the board's pose "
        f"instead, or to draw anew"
    )


def _entries(document: Mapping[str, Any]) -> Dict[str, Any]:
    entries = {key: value for key, value in document.items() if key != _METADATA}
    return {key: value for key, value in entries.items() if PLANE not in value}


def _borders(
    path: Path,
    document: Mapping[str, Any],
    patterns: Collection[str],
    camera: Optional[Camera],
    unnamed: Optional[str] = None,
) -> Dict[Tuple[str, str], np.ndarray]:
    """Return the borders as segments (m, 2, 2) by collection and pattern.

    Sides that do not name theirs, of several, are ``unnamed``; None refuses them.

    Raises:
        DatasetError: the file is malformed, or was drawn in images of another size.
    """
    try:
        borders = {}
        for collection, entry in _entries(document).items():
            by_pattern = _by_pattern(entry, patterns, unnamed)
            if by_pattern and not set(by_pattern) & {*patterns, unnamed}:
                raise ValueError(
                    f"collection {collection} has neither a side ({', '.join(SIDES)}) nor a "
                    f"pattern of the dataset ({', '.join(patterns)}), but {', '.join(by_pattern)}"
                )
            for pattern, sides in by_pattern.items():
                segments = _segments(sides)
                if len(segments):
                    borders[(collection, pattern)] = segments
        noted = (document.get(_METADATA) or {}).get(_SIZE)
    except OTHER_KIND as error:
        raise DatasetError(_unusable(path, error)) from None
    if camera is not None:
        _check_size(path, noted, borders, camera)
    return borders


def _check_size(
    path: Path, noted: Any, borders: Mapping[Tuple[str, str], np.ndarray], camera: Camera
) -> None:
    """Refuse borders that were drawn in images of another size, by its note or by their places."""
    size, remedy = [camera.width, camera.height], "move the file away, and draw anew"
    if noted is not None and noted != size:
        raise DatasetError(
            f"{path}: drawn in images of {_by(noted)} px, those of this dataset have "
            f"{_by(size)}; {remedy}"
        )
    points = np.concatenate([s.reshape(-1, 2) for s in borders.values()] or [np.zeros((0, 2))])
    outside = np.any((points < -_EDGE_PX) | (points > np.array(size) - 1.0 + _EDGE_PX), axis=1)
    if np.sum(outside) > _MOST_OUTSIDE * len(points):
        x, y = points[outside][0]
        raise DatasetError(
            f"{path}: {np.sum(outside)} of {len(points)} points lie outside the images of "
            f"{_by(size)} px, the first at ({x:.0f}, {y:.0f}): drawn in images of another size? "
            f"{remedy}"
        )


def _by(size: Any) -> str:
    return " x ".join(map(str, size)) if isinstance(size, list) else repr(size)


def _by_pattern(
    entry: Mapping[str, Any], patterns: Collection[str], unnamed: Optional[str] = None
) -> Mapping[str, Any]:
    if _has_sides(entry):
        if len(patterns) > 1 and unnamed is not None:
            return {unnamed: entry}
        if len(patterns) > 1:
            raise ValueError("the dataset has several patterns, the sides must name theirs")
        return {next(iter(patterns)): entry}
    return entry


def _has_sides(entry: Mapping[str, Any]) -> bool:
    """Tell whether an entry holds sides; else it holds patterns, which may be called like those."""
    return any(side in entry and not _holds_sides(entry[side]) for side in SIDES)


def _holds_sides(value: Any) -> bool:
    return isinstance(value, Mapping) and any(side in value for side in SIDES)


def _sides(entry: Mapping[str, Any]) -> Dict[str, np.ndarray]:
    """Return the points (n, 2) of each side: the clicked ones, else the interpolated ones."""
    found = {}
    for side in SIDES:
        values = entry.get(side) or {}
        xs, ys = (values.get(name) or values.get("i" + name) or [] for name in ("xs", "ys"))
        if len(xs) != len(ys):
            raise ValueError(f"side {side} has {len(xs)} xs and {len(ys)} ys")
        points = np.array([xs, ys], dtype=float)
        if points.shape != (2, len(xs)) or not np.all(np.isfinite(points)):
            raise ValueError(f"side {side} holds a number that is not finite, or none")
        found[side] = points.T
    return found


def _segments(entry: Mapping[str, Any]) -> np.ndarray:
    """Return the segments (m, 2, 2) of all sides."""
    sides = (points for points in _sides(entry).values() if len(points))
    return np.concatenate([np.zeros((0, 2, 2)), *(segments_of(points) for points in sides)])
