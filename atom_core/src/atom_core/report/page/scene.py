"""The rig in three dimensions: lines, boards, ellipsoids and points as numbers for a viewer."""

from __future__ import annotations

import base64
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.sensor import Sensor
from atom_core.report.page.given import Given
from atom_core.report.page.views import Sighting, cloud, world_T_frame

MOST_COLLECTIONS, MOST_POINTS = 30, 1500  # of the points shown; points of a sensor and collection
_MOST_BOARDS = 200
_MAGNIFICATIONS = (1, 3, 10, 30, 100, 300, 1000)
_UNIT_M = 0.002  # points are kept as whole multiples, of a longer one where all is farther apart
_LARGEST = int(np.iinfo(np.int16).max)
_ICON = 0.09  # size of a sensor by its usual distance to boards
_RING = 24  # sides of a circle

Lines = List[Optional[List[float]]]  # points of polylines, None between two of them


def rig_scene(given: Given, seen: Dict[str, List[Sighting]]) -> Dict[str, Any]:
    """Return the scene as plain values for JSON, with places [m] as seen from its origin.

    That is the world's, unless the rig is too far away for a viewer's single precision.

    Args:
        given: results with a dataset.
        seen: what each sensor saw.
    """
    dataset = given.dataset
    assert dataset is not None, "without a dataset nothing is known of where things are"
    first = next(iter(dataset.collections))
    size = _icon_size(seen)
    magnification, ellipsoids = _ellipsoids(given, first, size)
    sensors = []
    for name, sensor in dataset.sensors.items():
        shapes: Dict[str, Any] = {}
        for word, state in (("before", given.before), ("after", dataset)):
            frame = None if state is None else world_T_frame(state, first, sensor.frame)
            shapes[word] = None if frame is None else _icon(sensor, frame, size)
            if word == "after" and frame is not None:
                shapes["place"] = _rounded(frame[:3, 3])
        colour = given.colours.get(name, (0.5, 0.5, 0.5))
        sensors.append(
            {
                "name": name,
                "colour": "#" + "".join(f"{int(round(255 * c)):02x}" for c in colour),
                "ellipsoid": ellipsoids.get(name),
                **shapes,
            }
        )
    boards = _boards(dataset)
    origin, unit_m = _origin_and_unit(sensors, boards, size)
    points = _points(dataset, origin, unit_m)
    if np.any(origin):
        _move(sensors, boards, origin)
    return {
        "sensors": sensors,
        "boards": boards,
        "axes": [_axis(name, float(at)) for name, at in zip("xyz", origin)],
        "magnification": magnification,
        "unit_m": unit_m,
        "points": points,
        "collections": list(points),
        "size_m": size,
    }


def _icon_size(seen: Dict[str, List[Sighting]]) -> float:
    distances = [s.distance_m for of_one in seen.values() for s in of_one]
    return float(np.clip(_ICON * np.median(distances), 0.03, 0.6)) if distances else 0.15


def _icon(sensor: Sensor, world_T_sensor: np.ndarray, size: float) -> Lines:
    """Return a pyramid for what has an image, a ring with the x axis for what turns."""
    if sensor.camera is not None:
        ends = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [
            sensor.camera.width,
            sensor.camera.height,
        ]
        rays = np.column_stack([sensor.camera.normalise(ends - 0.5), np.ones(4)])
        rays *= size / np.max(np.linalg.norm(rays, axis=1))
        apex = np.zeros((1, 3))
        lines = [np.concatenate([rays, rays[:1]])]
        lines += [np.concatenate([apex, ray[None]]) for ray in rays]
    else:
        angles = np.linspace(0.0, 2.0 * np.pi, _RING + 1)
        ring = 0.5 * size * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
        lines = [ring, np.array([[0.0, 0.0, 0.0], [size, 0.0, 0.0]])]
        lines.append(np.array([[0.0, 0.0, -0.3 * size], [0.0, 0.0, 0.3 * size]]))
    return _polylines([se3.apply(world_T_sensor, line) for line in lines])


def _polylines(lines: Sequence[np.ndarray]) -> Lines:
    found: Lines = []
    for line in lines:
        found += [None] if found else []
        found += [_rounded(point) for point in line]
    return found


def _rounded(values: np.ndarray) -> List[float]:
    return [round(float(value), 4) for value in values]


def _boards(dataset: Dataset) -> List[Dict[str, Any]]:
    """Return the outlines of the boards, a fixed one once."""
    graph, boards, known = dataset.graph, [], set()
    for key, collection in dataset.collections.items():
        for pattern in dataset.patterns.values():
            of_label = any(name == pattern.name for _, name in collection.labels)
            where = pattern.board_key(key)
            if where in known or not of_label or board_edge(pattern) not in collection.transforms:
                continue
            known.add(where)
            try:
                chain = graph.chain(dataset.world, pattern.frame)
            except DatasetError:
                continue
            if any(step.edge not in collection.transforms for step in chain):
                continue
            frame = world_T_frame(dataset, key, pattern.frame)
            assert frame is not None, "its chain is whole"
            flat = pattern.border.corners_in_pattern
            corners = se3.apply(frame, flat)
            boards.append(
                {
                    "collection": key,
                    "pattern": pattern.name,
                    "corners": [_rounded(corner) for corner in corners],
                }
            )
    step = max(1, -(-len(boards) // _MOST_BOARDS))
    return boards[::step]


def _ellipsoids(
    given: Given, collection: str, size: float
) -> Tuple[int, Dict[str, Dict[str, Any]]]:
    """Return how many times they are magnified, and centre and axes (3, 3) by sensor.

    The standard deviations of an edge are along its parent's axes.
    """
    dataset, document = given.dataset, given.calibration
    if document is None or dataset is None:
        return 1, {}
    found: Dict[str, Tuple[np.ndarray, np.ndarray]] = {}
    for entry in document["edges"].values():
        sigma = np.array(
            entry.get("combined_sigma_translation_m", entry["sigma_translation_m"]), dtype=float
        )
        world_T_parent = world_T_frame(dataset, collection, entry["parent"])
        world_T_child = world_T_frame(dataset, collection, entry["child"])
        if world_T_parent is None or world_T_child is None or not np.any(sigma > 0.0):
            continue
        axes = world_T_parent[:3, :3] * np.maximum(sigma, 1e-6)
        found.update(dict.fromkeys(entry["sensors"], (world_T_child[:3, 3], axes)))
    if not found:
        return 1, {}
    largest = max(float(np.max(np.linalg.norm(axes, axis=0))) for _, axes in found.values())
    fitting = [m for m in _MAGNIFICATIONS if m * largest <= 2.0 * size]
    magnification = fitting[-1] if fitting else 1
    return magnification, {
        name: {
            "centre": _rounded(centre),
            "axes": [_rounded(axis) for axis in (magnification * axes).T],
        }
        for name, (centre, axes) in found.items()
    }


def shown_collections(dataset: Dataset) -> List[str]:
    """Return the collections whose data are shown: all, or every so-many-th."""
    keys = list(dataset.collections)
    return keys[:: max(1, -(-len(keys) // MOST_COLLECTIONS))]


def _origin_and_unit(
    sensors: Sequence[Dict[str, Any]], boards: Sequence[Dict[str, Any]], size: float
) -> Tuple[np.ndarray, float]:
    """Return the scene's origin (3,) in the world [m], and the unit of its points [m].

    Points in the whole box around sensors and boards, which is what the viewer shows, can be told.
    """
    lines = [one.get(word) or [] for one in sensors for word in ("before", "after")]
    places = [point for line in lines for point in line if point is not None]
    places += [corner for board in boards for corner in board["corners"]]
    if not places:
        return np.zeros(3), _UNIT_M
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    margin = 0.08 * (high - low) + size  # as of the viewer
    low, high = low - margin, high + margin
    origin, reach = np.zeros(3), float(np.max(np.abs([low, high])))
    if reach > _LARGEST * _UNIT_M:
        origin = np.rint(0.5 * (low + high))
        reach = float(np.max(np.abs([low - origin, high - origin])))
    return origin, max(_UNIT_M, reach / _LARGEST)


def _move(
    sensors: Sequence[Dict[str, Any]], boards: Sequence[Dict[str, Any]], origin: np.ndarray
) -> None:
    """Make all places those seen from an origin (3,) in the world [m]."""

    def moved(line: Lines) -> Lines:
        return [None if point is None else _rounded(np.subtract(point, origin)) for point in line]

    for one in sensors:
        one.update({w: moved(one[w]) for w in ("before", "after") if one[w] is not None})
        one.update({w: moved([one[w]])[0] for w in ("place",) if w in one})
        if one["ellipsoid"] is not None:
            one["ellipsoid"]["centre"] = moved([one["ellipsoid"]["centre"]])[0]
    for board in boards:
        board["corners"] = moved(board["corners"])


def _axis(name: str, origin_m: float) -> str:
    """Return the title of an axis, which tells where the world's origin is."""
    sign = "-" if origin_m > 0.0 else "+"
    return f"{name} [m]" if origin_m == 0.0 else f"{name} {sign} {abs(origin_m):.0f} [m]"


def _points(dataset: Dataset, origin: np.ndarray, unit_m: float) -> Dict[str, Dict[str, str]]:
    """Return points from the origin by collection and sensor, as base64 of int16 in the unit."""
    found: Dict[str, Dict[str, str]] = {}
    for key in shown_collections(dataset):
        for name, sensor in dataset.sensors.items():
            if sensor.kind.measured is None or not dataset.data.has_data(key, name):
                continue
            frame = world_T_frame(dataset, key, sensor.frame)
            if frame is None:
                continue
            try:
                points = cloud(sensor, dataset.data.read(key, name), MOST_POINTS)
            except DatasetError:  # a damaged file costs its points, not the report
                continue
            whole = np.rint((se3.apply(frame, points) - origin) / unit_m)
            whole = whole[np.all(np.abs(whole) <= _LARGEST, axis=1)]
            data = whole.astype("<i2").tobytes()
            found.setdefault(key, {})[name] = base64.b64encode(data).decode("ascii")
    return found


def decoded(text: str, unit_m: float) -> np.ndarray:
    """Return points (n, 3) [m] from the scene's origin, of what `rig_scene` keeps of a cloud."""
    return np.frombuffer(base64.b64decode(text), dtype="<i2").reshape(-1, 3) * unit_m
