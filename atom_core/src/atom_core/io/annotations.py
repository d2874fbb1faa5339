"""Hand annotations of a board's border in the images of a camera, as ATOM's tool writes them.

``annotation_<sensor>.json`` stands beside the dataset. Per collection it holds the sides of one
board, ``{side: {xs, ys, ...}}``: pixels of the clicked polyline. ATOM has no level for the
pattern; where a dataset has several, ``{pattern: {side: ...}}`` is read as well.
"""

from __future__ import annotations

import getpass
import json
import time
from pathlib import Path
from typing import Any, Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry.camera import Camera
from atom_core.geometry.polyline import evenly_spaced, segments_of
from atom_core.io.atomic import write_json_atomically
from atom_core.model.sensor import Sensor

SIDES = ("top", "right", "bottom", "left")
PLANE = "plane"  # of a collection in the file of a LiDAR, which has points in space, no pixels

_METADATA, _VERSION, _SIZE = "_metadata", "2.0", "image_size"
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

    Raises:
        DatasetError: a file is malformed, or was drawn in images of another size.
    """
    borders: Dict[BorderKey, np.ndarray] = {}
    for name, sensor in sensors.items():
        path = annotation_path(folder, name)
        if path.is_file():
            for (collection, pattern), segments in _read(path, patterns, sensor.camera).items():
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
    _read(path, patterns, camera)  # which refuses what is malformed
    document = json.loads(path.read_text(encoding="utf-8"))
    lines = {}
    for collection, entry in document.items():
        if collection != _METADATA:
            sides = _by_pattern(entry, patterns).get(pattern) or {}
            points = {side: sides.get(side) or {} for side in SIDES}
            lines[collection] = {
                side: list(zip(value.get("xs") or [], value.get("ys") or []))
                for side, value in points.items()
            }
    return lines


def write_annotations(
    path: Path,
    lines: Mapping[str, Mapping[str, Sequence[Tuple[float, float]]]],
    *,
    points_per_pixel: float = 1.0,
    pattern: str = "",
    camera: Optional[Camera] = None,
) -> None:
    """Write the border that was drawn in the images of a sensor.

    Args:
        path: the file; of other patterns it keeps what it has.
        lines: clicked points [px] by collection and side.
        points_per_pixel: how densely the lines are sampled for ATOM.
        pattern: whose sides they are, where the dataset has several; empty: as ATOM, without.
        camera: whose images have the size that is noted down (ATOM notes none).

    Raises:
        OutputError: the file cannot be written.
    """
    old = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    document: Dict[str, Any] = {_METADATA: metadata()}
    if camera is not None:
        document[_METADATA][_SIZE] = [camera.width, camera.height]
    for collection, sides in lines.items():
        entry = {side: _side(sides.get(side, ()), points_per_pixel) for side in SIDES}
        kept = old.get(collection) or {}
        document[collection] = {**kept, pattern: entry} if pattern else entry
    write_json_atomically(path, document)


def metadata() -> Dict[str, str]:
    """Return who wrote a file of annotations, when, and in which version of the format."""
    return {
        "timestamp": str(time.time()),
        "date": time.asctime(),
        "user": getpass.getuser(),
        "version": _VERSION,
    }


def _side(points: Sequence[Tuple[float, float]], points_per_pixel: float) -> Dict[str, Any]:
    clicked = np.array(points, dtype=float).reshape(-1, 2)
    sampled = np.round(evenly_spaced(clicked, points_per_pixel)).astype(int)
    (xs, ys), (ixs, iys) = clicked.T.tolist(), sampled.T.tolist()
    return {"xs": xs, "ys": ys, "ixs": ixs, "iys": iys}


def _read(
    path: Path, patterns: Collection[str], camera: Optional[Camera]
) -> Dict[Tuple[str, str], np.ndarray]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        entries = {key: value for key, value in document.items() if key != _METADATA}
        entries = {key: value for key, value in entries.items() if PLANE not in value}
        borders = {}
        for collection, entry in entries.items():
            for pattern, sides in _by_pattern(entry, patterns).items():
                segments = _segments(sides)
                if len(segments):
                    borders[(collection, pattern)] = segments
        noted = (document.get(_METADATA) or {}).get(_SIZE)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{path}: not a file of border annotations ({error}); annotate again, or move the "
            f"file away to use the board's pose instead"
        ) from None
    if camera is not None:
        _check_size(path, noted, borders, camera)
    return borders


def _check_size(
    path: Path, noted: Any, borders: Mapping[Tuple[str, str], np.ndarray], camera: Camera
) -> None:
    """Refuse borders that were drawn in images of another size, by its note or by their places."""
    size, remedy = [camera.width, camera.height], "draw them anew, or move the file away"
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


def _by_pattern(entry: Mapping[str, Any], patterns: Collection[str]) -> Mapping[str, Any]:
    if any(side in entry for side in SIDES):
        if len(patterns) > 1:
            raise ValueError("the dataset has several patterns, the sides must name theirs")
        return {next(iter(patterns)): entry}
    return entry


def _segments(sides: Mapping[str, Any]) -> np.ndarray:
    """Return the segments of all sides; the clicked points, else the interpolated ones."""
    found = [np.zeros((0, 2, 2))]
    for side in SIDES:
        entry = sides.get(side) or {}
        xs, ys = (entry.get(name) or entry.get("i" + name) or [] for name in ("xs", "ys"))
        if len(xs) != len(ys):
            raise ValueError(f"side {side} has {len(xs)} xs and {len(ys)} ys")
        points = np.column_stack([np.array(xs, dtype=float), np.array(ys, dtype=float)])
        if not np.all(np.isfinite(points)):
            raise ValueError(f"side {side} holds a number that is not finite")
        if len(points):
            found.append(segments_of(points))
    return np.concatenate(found)
