"""Sections with pictures: the worst collections, clouds over images before and after, labels."""

from __future__ import annotations

from functools import partial
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import LIMIT_POINT
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor
from atom_core.problem.residuals import BORDER, ORTHOGONAL
from atom_core.report.page import charts, pictures
from atom_core.report.page.blocks import (
    Block,
    Chart,
    Folded,
    Picture,
    Section,
    Text,
    galleries,
)
from atom_core.report.page.given import Document, Given
from atom_core.report.page.scene import shown_collections
from atom_core.report.page.views import Sighting, cloud, label_pixels, limit_pixels
from atom_core.report.residual_samples import ResidualSample, of_kind, of_sensor

_WORST, _MOST_POINTS, _THUMB_PX = 5, 20000, 150
_LEAST_COUNT = 4  # items of a sensor in a collection, for them to speak

Seen = Mapping[str, Sequence[Sighting]]


def _read(dataset: Dataset, collection: str, sensor: str) -> Any:
    """Return the data of a sensor, None where they are absent or damaged."""
    if not dataset.data.has_data(collection, sensor):
        return None
    try:
        return dataset.data.read(collection, sensor)
    except DatasetError:
        return None


def absent_data(dataset: Dataset) -> List[str]:
    """Return a sentence for each sensor whose data files are gone."""
    found = []
    for name in dataset.sensors:
        keys = [
            key for key, c in dataset.collections.items() if any(n == name for n, _ in c.labels)
        ]
        gone = [key for key in keys if not dataset.data.has_data(key, name)]
        if gone:
            found.append(
                f"data files of {name} are gone ({len(gone)} of {len(keys)} collections): its "
                f"pictures and points are left out"
            )
    return found


# ---- the worst collections


def worst_collections(
    document: Document, samples: Sequence[ResidualSample] = ()
) -> List[Tuple[str, str, float]]:
    """Return the collections that fit worst, with the sensor and how many times worse than usual.

    Usual is the RMS of the same sensor and kind over all collections, in standard deviations where
    the residuals are at hand: far points are allowed more than near ones.
    """
    found = []
    sizes = {(s.sensor, s.kind): _by_collection(s) for s in samples if s.kind != BORDER}
    for key, collection in document["collections"].items():
        ratios = []
        for name, residuals in collection["residuals"].items():
            for kind, statistics in residuals.items():
                usual = document["sensors"][name]["residuals"][kind]["rms"]
                if kind == BORDER or statistics["count"] < _LEAST_COUNT or usual <= 0.0:
                    continue
                own = sizes.get((name, kind), {}).get(key)
                ratios.append((statistics["rms"] / usual if own is None else own, name))
        if ratios:
            ratio, name = max(ratios)
            found.append((key, name, float(ratio)))
    return sorted(found, key=lambda entry: -entry[2])[:_WORST]


def _by_collection(sample: ResidualSample) -> Dict[str, float]:
    """Return the RMS in standard deviations by collection, by that of all."""
    squares = np.sum((sample.residual / sample.sigma[:, None]).astype(float) ** 2, axis=1)
    usual = max(float(np.sqrt(np.mean(squares))), 1e-12)
    return {
        str(key): float(np.sqrt(np.mean(squares[sample.collection == key]))) / usual
        for key in np.unique(sample.collection)
        if np.sum(sample.collection == key) >= _LEAST_COUNT
    }


def worst_section(given: Given, seen: Seen) -> List[Section]:
    """Return the worst collections with what cameras saw and what the calibration expects."""
    if given.calibration is None:
        return []
    blocks: List[Block] = [
        Text(
            "Where a sensor is farthest from its own usual residual, in standard deviations. "
            "Orange rings: corners that were found; red crosses: where the calibration has them; "
            "blue: the board's border. Of range sensors: their points on the board's plane."
        )
    ]
    for key, name, ratio in worst_collections(given.calibration, given.residuals):
        title = f"Collection {key}: {name} is {ratio:.1f} times as far off as usual"
        items: List[Union[Chart, Picture]] = []
        if given.dataset is not None:
            items = [*_on_board(given, seen, key, name), *_overlays(given.dataset, seen, key)]
        if not items:
            blocks.append(Text(title))
        blocks += galleries(title, items)
    return [Section("worst", "The worst collections", blocks)] if len(blocks) > 1 else []


def _on_board(given: Given, seen: Seen, key: str, name: str) -> Iterator[Chart]:
    """Yield the residuals of a range sensor's points where they lie on the board."""
    sample = of_kind(given.residuals, name, ORTHOGONAL)
    for sighting in seen.get(name, ()):
        if sample is None or given.dataset is None or sighting.key.collection != key:
            continue
        mine = sample.collection == key
        points = sample.seen[mine].astype(float)
        flat = se3.apply(se3.inverse(sighting.sensor_T_pattern), points)[:, :2]
        border = given.dataset.patterns[sighting.key.pattern].border.corners
        draw = partial(
            charts.draw_on_board,
            places=flat,
            residual_mm=1e3 * sample.residual[mine, 0].astype(float),
            outline=border,
        )
        alt = f"{name}, collection {key}: residuals of {len(flat)} points on the board's plane"
        yield Chart(f"{name}, collection {key}: points on the board", alt, draw, dense=True)


def _overlays(dataset: Dataset, seen: Seen, key: str) -> Iterator[Picture]:
    for name, sensor in dataset.sensors.items():
        for sighting in seen.get(name, ()):
            if sighting.key.collection != key or sensor.kind.measures_range:
                continue
            data, found = _read(dataset, key, name), label_pixels(sensor, sighting.label)
            if data is None or found is None or sensor.camera is None:
                continue
            pattern = dataset.patterns[sighting.key.pattern]
            ids = getattr(sighting.label, "ids", np.zeros(0, dtype=int))
            corners = se3.apply(sighting.sensor_T_pattern, pattern.corners_of(ids))
            drawn = pictures.with_board(
                pictures.as_picture(data),
                found,
                sensor.camera.project(corners),
                _outline(sensor, sighting.sensor_T_pattern, pattern),
            )
            alt = f"{name}, collection {key}: corners found and expected"
            yield Picture(f"{name}, collection {key}", alt, drawn)


def _outline(
    sensor: Sensor, sensor_T_pattern: np.ndarray, pattern: Pattern
) -> Optional[np.ndarray]:
    """Return the board's border in the image (4, 2) [px]; None where a corner is behind."""
    flat = pattern.border.corners_in_pattern
    corners = se3.apply(sensor_T_pattern, flat)
    if sensor.camera is None or np.any(corners[:, 2] <= 0.0):
        return None
    return sensor.camera.project(corners)


# ---- clouds over images and depth maps


def clouds_section(given: Given, seen: Seen) -> List[Section]:
    """Return clouds over the images and depth maps of other sensors, before and after."""
    dataset = given.dataset
    if dataset is None:
        return []
    blocks: List[Block] = []
    for name, sensor in dataset.sensors.items():
        if sensor.camera is None:
            continue
        sources = _sources(dataset, name)
        key = _telling_collection(dataset, seen, name, sources)
        if key is None:
            continue
        items: List[Union[Chart, Picture]] = [*_clouds_over(given, key, sensor, sources)]
        what = "depth map" if sensor.kind.measures_range else "image"
        blocks += galleries(f"Clouds over the {what} of {name}, collection {key}", items, wide=True)
    if not blocks:
        return []
    words = "Points of range sensors, yellow near and violet far, where the calibration has them."
    return [Section("clouds", "Clouds over images, before and after", [Text(words), *blocks])]


def _sources(dataset: Dataset, target: str) -> List[Sensor]:
    """Return the range sensors whose points are shown in a target: those without an image first."""
    others = [s for s in dataset.sensors.values() if s.kind.measured and s.name != target]
    turning = [sensor for sensor in others if sensor.camera is None]
    return turning or others


def _telling_collection(
    dataset: Dataset, seen: Seen, target: str, sources: Sequence[Sensor]
) -> Optional[str]:
    """Return the collection in which most of the sensors see the board, the nearest board of these.

    None where no collection has data of the target and of a source.
    """
    distances = {s.key.collection: s.distance_m for s in seen.get(target, ())}
    found = []
    for key in dataset.collections:
        own = [s for s in sources if dataset.data.has_data(key, s.name)]
        if own and dataset.data.has_data(key, target):
            see = sum(any(s.key.collection == key for s in seen.get(o.name, ())) for o in own)
            found.append((key in distances, see, -distances.get(key, 0.0), key))
    return max(found)[-1] if found else None


def _clouds_over(
    given: Given, key: str, target: Sensor, sources: Sequence[Sensor]
) -> Iterator[Picture]:
    assert given.dataset is not None, "the caller has it"
    data = _read(given.dataset, key, target.name)
    if data is None:
        return
    clouds = {}
    for source in sources:
        read = _read(given.dataset, key, source.name)
        if read is not None:
            clouds[source.name] = cloud(source, read, _MOST_POINTS)
    states = [("before", given.before), ("after", given.dataset)]
    seen = [(word, *_in_image(s, key, target, clouds)) for word, s in states if s is not None]
    span = pictures.depth_span(np.concatenate([distances for _, _, distances in seen]))
    image = pictures.as_picture(data)
    for word, pixels, distances in seen:
        drawn = pictures.with_cloud(image, pixels, distances, span)
        names = ", ".join(clouds)
        title = f"{word}: {names} over {target.name}, {span[0]:.1f} to {span[1]:.1f} m"
        yield Picture(title, f"{title}, {len(pixels)} points in view", drawn)


def _in_image(
    dataset: Dataset, key: str, target: Sensor, clouds: Mapping[str, np.ndarray]
) -> Tuple[np.ndarray, np.ndarray]:
    """Return where points of clouds lie in an image (n, 2) [px], and how far they are (n,) [m]."""
    pixels, distances = [np.zeros((0, 2))], [np.zeros(0)]
    for name, points in clouds.items():
        frame = dataset.sensors[name].frame
        try:
            target_T_source = pose(dataset.collections[key], dataset.graph, target.frame, frame)
        except DatasetError:
            continue
        assert target.camera is not None, "only what has an image is a target"
        moved = se3.apply(target_T_source, points)
        moved = moved[target.camera.in_image(moved)]
        pixels.append(target.camera.project(moved))
        distances.append(np.linalg.norm(moved, axis=1))
    return np.concatenate(pixels), np.concatenate(distances)


# ---- labels


def labels_section(given: Given, seen: Seen) -> List[Section]:
    """Return contact sheets of the labels of each sensor."""
    dataset = given.dataset
    if dataset is None:
        return []
    shown, blocks = set(shown_collections(dataset)), []
    for name, sensor in dataset.sensors.items():
        thumbs: Dict[str, np.ndarray] = {}
        for sighting in seen.get(name, ()):
            if sighting.key.collection in shown:
                thumb = _thumb(dataset, sensor, sighting, given.residuals)
                if thumb is not None:
                    thumbs[f"{sighting.key.collection} {_size(sighting)}"] = thumb
        if thumbs:
            sheet = pictures.contact_sheet(list(thumbs.values()), list(thumbs))
            alt = f"{name}: {len(thumbs)} labels, one picture for each collection"
            blocks.append(Folded(f"Labels of {name}", [Picture(f"Labels of {name}", alt, sheet)]))
    if not blocks:
        return []
    words = (
        "One picture for each collection, with the number of corners or points. Cameras: corners "
        "found (orange) and the border expected (blue). Depth cameras: pixels of the board "
        "(orange) and of its border (blue). LiDARs: points on the board's plane (blue), border "
        "points (orange)."
    )
    return [Section("labels", "Labels", [Text(words), *blocks])]


def _size(sighting: Sighting) -> str:
    counts = sighting.label.counts
    return "+".join(str(n) for kind, n in counts.items() if kind != LIMIT_POINT or n)


def _thumb(
    dataset: Dataset, sensor: Sensor, sighting: Sighting, samples: Tuple[ResidualSample, ...]
) -> Optional[np.ndarray]:
    pattern = dataset.patterns[sighting.key.pattern]
    found = label_pixels(sensor, sighting.label)
    if found is None:
        return _thumb_of_points(sensor, sighting, pattern, samples)
    data = _read(dataset, sighting.key.collection, sensor.name)
    if data is None:
        return None
    image = pictures.as_picture(data)
    border = limit_pixels(sensor, sighting.label)
    if border is not None:
        return pictures.with_marks(image, found, border, _THUMB_PX)
    outline = _outline(sensor, sighting.sensor_T_pattern, pattern)
    return pictures.with_board(image, found, None, outline, _THUMB_PX, ring_px=1.0)


def _thumb_of_points(
    sensor: Sensor, sighting: Sighting, pattern: Pattern, samples: Tuple[ResidualSample, ...]
) -> Optional[np.ndarray]:
    inside, border = np.zeros((0, 2)), np.zeros((0, 2))
    pattern_T_sensor = se3.inverse(sighting.sensor_T_pattern)
    for sample in of_sensor(samples, sensor.name):
        points = sample.seen[sample.collection == sighting.key.collection].astype(float)
        flat = se3.apply(pattern_T_sensor, points)[:, :2]
        inside, border = (inside, flat) if sample.kind == BORDER else (flat, border)
    if not len(inside) and not len(border):
        return None
    return pictures.board_plot(inside, border, pattern.border.corners)
