"""Datasets from before ATOM's version 2: what they leave unsaid is derived from what they say.

They carry no version, one board without frames (every collection has its own pose of it), labels by
sensor, and corners without ids. Nothing is assumed that the dataset does not show: what cannot be
derived is named, all of it at once.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Dict, List, Mapping, Optional, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import DatasetError
from atom_core.io.dataset_version import CURRENT_VERSION
from atom_core.io.label_json import says_detected
from atom_core.model.modality import modality_of_message

PATTERN_NAME = "pattern_1"
_OF_SENSORS = {  # keys of the configuration, and where the sensor's own entry says the same
    "link": "parent",
    "parent_link": "calibration_parent",
    "child_link": "calibration_child",
    "topic_name": "topic",
}
_MOVED_PX = 5.0  # a still camera's corners of a board that stands still scatter far less
_OFF_GRID_SQUARES = 0.25  # numbers in another order are off by whole squares
_SHOWN = 12  # places of one sort that a message lists


def is_before_version_2(document: Mapping[str, Any]) -> bool:
    """Tell whether a document carries no version: ATOM writes one since version 2."""
    return "version" not in (document.get("_metadata") or {})


def in_layout_of_version_3(document: Mapping[str, Any]) -> Dict[str, Any]:
    """Return a copy with the one board as ``pattern_1``; nothing is dropped or filled in.

    Before version 3 there was one board: ``calibration_pattern`` in the configuration, ``patterns``
    with its corners directly, and ``labels[sensor]``.
    """
    new = deepcopy(dict(document))
    config = new.setdefault("calibration_config", {})
    if "calibration_pattern" in config:
        config.setdefault("calibration_patterns", {PATTERN_NAME: config.pop("calibration_pattern")})
    config["version"] = float(CURRENT_VERSION)
    name = next(iter(config.get("calibration_patterns") or {PATTERN_NAME: None}))
    if "corners" in (new.get("patterns") or {}):
        new["patterns"] = {name: new["patterns"]}
    for collection in new["collections"].values():
        labels = collection.get("labels") or {}
        if labels and all(key in new["sensors"] for key in labels):
            collection["labels"] = {name: labels}
    new.setdefault("_metadata", {})["version"] = CURRENT_VERSION
    return new


def completed(document: Mapping[str, Any], where: str) -> Tuple[Dict[str, Any], Optional[str]]:
    """Return a document of any age as one of version 3, with what it left unsaid.

    Args:
        document: as it was read.
        where: the file, for messages.

    Returns:
        The document, a copy, and one sentence on what was filled in and from what; None if nothing.

    Raises:
        DatasetError: something is absent that the dataset does not tell; all of it is named.
    """
    new = in_layout_of_version_3(document)
    gaps = _Gaps(new, where)
    gaps.world()
    gaps.sensors()
    gaps.patterns()
    if gaps.missing:
        raise DatasetError(
            f"{where}: from before ATOM's version 2, and it lacks what cannot be derived from it: "
            f"{'; '.join(gaps.missing)}. Add these keys to the file"
        )
    if not gaps.filled:
        return new, None
    return new, (
        f"{where}: from before ATOM's version 2; filled in: {'; '.join(gaps.filled)}. Where that "
        f"is not what you have, write these keys into the file"
    )


class _Gaps:
    """Fills the gaps of one document, in place, and lists what was filled and what is missing."""

    def __init__(self, document: Dict[str, Any], where: str):
        self.document, self.where = document, where
        self.filled: List[str] = []
        self.missing: List[str] = []
        self.config: Dict[str, Any] = document["calibration_config"]

    def world(self) -> None:
        """Give the configuration its root: the one frame that no transform leads to."""
        if self.config.get("world_link"):
            return
        edges = list(self._edges())
        roots = {parent for parent, _ in edges} - {child for _, child in edges}
        if len(roots) == 1:
            self.config["world_link"] = roots.pop()
            self.filled.append(f"world_link '{self.config['world_link']}' (root of the transforms)")
        else:
            among = f" (one of {', '.join(sorted(roots))})" if roots else ""
            self.missing.append(f"calibration_config.world_link{among}")

    def sensors(self) -> None:
        """Give every sensor its modality, and the configuration its frames and topics."""
        configured = self.config.get("sensors") or {}
        self.config["sensors"] = configured
        for name, entry in self.document["sensors"].items():
            self._modality(name, entry)
            of_config = configured.setdefault(name, {})
            for key, same in _OF_SENSORS.items():
                self._either(name, of_config, key, entry, same)

    def _modality(self, name: str, entry: Dict[str, Any]) -> None:
        message = str(entry.get("msg_type") or "")
        kind = modality_of_message(message)
        if not entry.get("modality"):
            if kind is None or (kind.has_camera_info and self._has_indices(name)):
                self.missing.append(f"sensors.{name}.modality")
                return
            entry["modality"] = kind.name
            self.filled.append(f"modality {kind.name} of '{name}' (its messages are {message})")
        if kind is not None and kind.has_camera_info and not entry.get("camera_info"):
            self.missing.append(f"sensors.{name}.camera_info")

    def _has_indices(self, sensor: str) -> bool:
        """Tell whether the labels of a sensor are indices, of a depth image, not corners."""
        for collection in self.document["collections"].values():
            for labels in (collection.get("labels") or {}).values():
                label = labels.get(sensor) or {}
                if any(not isinstance(value, Mapping) for value in label.get("idxs") or []):
                    return True
        return False

    def _either(self, name: str, config: Any, key: str, entry: Dict[str, Any], same: str) -> None:
        """Let the configuration and the sensor's own entry say what one of them says."""
        if not config.get(key) and not entry.get(same):
            self.missing.append(f"sensors.{name}.{same}")
        elif not config.get(key):
            config[key] = entry[same]
            self.filled.append(f"{key} '{entry[same]}' of '{name}' (its {same})")
        elif not entry.get(same):
            entry[same] = config[key]
            self.filled.append(f"{same} '{config[key]}' of '{name}' (its {key})")

    def patterns(self) -> None:
        """Give every board its frames, and the corners in the labels their ids."""
        patterns = self.config.get("calibration_patterns") or {}
        if not patterns:
            self.missing.append("calibration_config.calibration_pattern")
        for name, pattern in patterns.items():
            for key in ("pattern_type", "dimension", "size"):
                if not pattern.get(key):
                    self.missing.append(f"calibration_config.calibration_pattern.{key}")
            if not pattern.get("link"):
                frames = {frame for edge in self._edges() for frame in edge}
                pattern["link"] = name if name not in frames else f"{name}_link"
                self.filled.append(f"the board's link '{pattern['link']}' (a frame of its own)")
            if not pattern.get("parent_link") and self.config.get("world_link"):
                pattern["parent_link"] = self.config["world_link"]
                self.filled.append(
                    f"the board's parent_link '{pattern['parent_link']}' (the world_link)"
                )
            if pattern.get("fixed") is None:
                self._fixed(name, pattern)
            self._ids(name, pattern)

    def _fixed(self, name: str, pattern: Dict[str, Any]) -> None:
        """A board whose corners wander through the pictures of a camera that stands still moves."""
        for sensor, entry in self.document["sensors"].items():
            labels = [label for _, label in self._corner_labels(name, sensor)]
            if len(labels) < 2 or not self._stands_still(entry):
                continue
            first = np.array([labels[0]["idxs"][0][axis] for axis in "xy"])
            last = [np.array([label["idxs"][0][axis] for axis in "xy"]) for label in labels]
            if max(np.linalg.norm(pixel - first) for pixel in last) > _MOVED_PX:
                pattern["fixed"] = False
                self.filled.append(f"fixed: false (the board moves before '{sensor}')")
                return
        self.missing.append(
            "calibration_config.calibration_pattern.fixed (false if the board was moved between "
            "the collections, true if it stayed)"
        )

    def _stands_still(self, sensor: Mapping[str, Any]) -> bool:
        """Tell whether all transforms above a sensor's data are the same in all collections."""
        frame, world = sensor.get("parent"), self.config.get("world_link")
        collections = [c.get("transforms") or {} for c in self.document["collections"].values()]
        above = {value["child"]: value for value in collections[0].values() if "child" in value}
        for _ in above:
            if frame == world:
                return True
            here = above.get(frame)
            if here is None:
                return False
            name = next(n for n, value in collections[0].items() if value is here)
            for transforms in collections:
                other = transforms.get(name) or {}
                if (other.get("trans"), other.get("quat")) != (here.get("trans"), here.get("quat")):
                    return False
            frame = here.get("parent")
        return bool(frame == world)

    def _ids(self, name: str, pattern: Mapping[str, Any]) -> None:
        """Number the corners of whole boards, row by row, where their places bear that out."""
        try:
            columns, rows = (int(pattern["dimension"][axis]) for axis in "xy")
        except (KeyError, TypeError, ValueError):
            return  # named as missing, or refused by the configuration
        numbered, bad = 0, []
        for sensor in self.document["sensors"]:
            for key, label in self._corner_labels(name, sensor):
                if all("id" in corner for corner in label["idxs"]):
                    continue
                if _runs_along_rows(label["idxs"], columns, rows):
                    label["idxs"] = [{**c, "id": i} for i, c in enumerate(label["idxs"])]
                    numbered += 1
                else:
                    bad.append(f"{key} '{sensor}'")
        if numbered:
            self.filled.append(
                f"ids of the corners in {numbered} labels (whole boards, in the order of the list, "
                f"which runs along the rows)"
            )
        if bad:
            more = f" and {len(bad) - _SHOWN} more" if len(bad) > _SHOWN else ""
            self.missing.append(
                f"labels.idxs[].id of collections {', '.join(bad[:_SHOWN])}{more} (they do not "
                f"show {columns} x {rows} corners row by row)"
            )

    def _corner_labels(self, name: str, sensor: str) -> List[Tuple[str, Dict[str, Any]]]:
        """Return (collection, label) of a camera's labels that hold corners."""
        found = []
        for key, collection in self.document["collections"].items():
            label = ((collection.get("labels") or {}).get(name) or {}).get(sensor) or {}
            corners = label.get("idxs") or []
            if says_detected(label) and corners and all(map(_has_place, corners)):
                found.append((key, label))
        return found

    def _edges(self) -> List[Tuple[str, str]]:
        return [
            (value["parent"], value["child"])
            for collection in self.document["collections"].values()
            for value in (collection.get("transforms") or {}).values()
            if isinstance(value, Mapping) and {"parent", "child"} <= set(value)
        ]


def _has_place(corner: Any) -> bool:
    """Tell whether an entry of a label is a corner with numbers for its pixel."""
    return isinstance(corner, Mapping) and all(
        type(corner.get(axis)) in (int, float) for axis in "xy"
    )


def _runs_along_rows(corners: List[Dict[str, Any]], columns: int, rows: int) -> bool:
    """Tell whether corners are a whole board seen from the front, listed row by row."""
    if len(corners) != columns * rows or min(columns, rows) < 2:
        return False
    pixels = np.array([[corner["x"], corner["y"]] for corner in corners], dtype=float)
    if not np.all(np.isfinite(pixels)):
        return False
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    homography, _ = cv2.findHomography(grid.astype(float), pixels, 0)
    if homography is None:
        return False
    projected = cv2.perspectiveTransform(grid.astype(float)[:, None], homography)[:, 0]
    side_px = np.median(np.linalg.norm(np.diff(pixels.reshape(rows, columns, 2), axis=1), axis=2))
    off_px = np.sqrt(np.mean(np.sum((projected - pixels) ** 2, axis=1)))
    return bool(off_px < _OFF_GRID_SQUARES * side_px and np.linalg.det(homography) > 0.0)
