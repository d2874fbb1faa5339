"""ATOM's dataset format v3: JSON to model and back, losing nothing.

The specification is docs/dataset_format.md. The reader keeps the whole document; the writer lays
the changed transforms, and the labels it is told of, over it, so that unknown keys, label order and
every digit survive. What older or damaged writers left is tolerated as listed there.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import AtomError, DatasetError
from atom_core.geometry.camera import Camera
from atom_core.io.atomic import write_pieces_atomically
from atom_core.io.board_links import with_boards_free
from atom_core.io.camera_entries import (
    camera_of_entry,
    check_images,
    lens_caveats,
    looks_rectified,
    with_camera,
)
from atom_core.io.caveats import caveats_of
from atom_core.io.data_files import FileDataSource, data_path
from atom_core.io.dataset_entries import (
    edge_of_joint,
    joint_of_entry,
    joints_document,
    lay_over,
    modality_of_entry,
    other_than_configured,
    pose_of_entry,
)
from atom_core.io.dataset_structure import check_dataset_structure
from atom_core.io.dataset_trees import check_trees
from atom_core.io.dataset_version import check_version, newer_version
from atom_core.io.earliest_layout import completed, is_before_version_2
from atom_core.io.edge_types import edge_types
from atom_core.io.json_text import load_json
from atom_core.io.json_writer import write_json
from atom_core.io.label_json import is_old_layout, says_detected, with_label
from atom_core.io.paths import looked_for
from atom_core.io.pattern_entries import pattern_of_entry, with_borders
from atom_core.io.together import finish_interrupted
from atom_core.model.caveats import Caveat
from atom_core.model.config import CalibrationConfig
from atom_core.model.config_section import check_name
from atom_core.model.dataset import Collection, Dataset, board_edge
from atom_core.model.joints import JointState
from atom_core.model.labels import DetectionKey, Label
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import Sensor
from atom_core.model.transforms import Edge

Choose = Callable[[Sequence[str]], Sequence[str]]
_SAME = 1e-6  # entries of a matrix


def read_dataset(path: Path, choose: Optional[Choose] = None) -> Dataset:
    """Read a dataset's JSON; its data files are read later, when a label needs them.

    Args:
        path: the JSON.
        choose: given the names of all collections, returns those to read; the others may then
            be damaged. All if None.

    Raises:
        DatasetError: the file is absent, truncated, too old, or inconsistent.
    """
    path = Path(path)
    document, filled = read_document(path), None
    if is_before_version_2(document):
        document, filled = completed(document, str(path))
    check_version(document, path)
    dataset = dataset_from_document(document, path, choose)
    remarks = [text for text in (filled, newer_version(document, path)) if text]
    dataset = replace(dataset, warnings=(*remarks, *dataset.warnings))
    formats = {name: sensor.kind.data for name, sensor in dataset.sensors.items()}
    return replace(dataset, data=FileDataSource(path.parent, document, formats))


def read_document(path: Path) -> Dict[str, Any]:
    """Return the JSON document of a dataset, unchecked but for being one."""
    finish_interrupted(path.parent)
    if path.is_dir():
        raise DatasetError(f"{path}: a folder; give the dataset's JSON in it, {path}/dataset.json")
    if not path.is_file():
        raise DatasetError(
            f"{path}: no such file{looked_for(path)}; give the path of the dataset's JSON"
        )
    if path.suffix in (".yml", ".yaml", ".bag", ".xacro", ".urdf"):
        raise DatasetError(f"{path}: no dataset; give the dataset.json that a collector wrote")
    try:
        document = load_json(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise DatasetError(
            f"{path}: not UTF-8 text ({error.reason} at byte {error.start})"
        ) from None
    except json.JSONDecodeError as error:
        raise DatasetError(
            f"{path}:{error.lineno}: not valid JSON ({error.msg}); the file is damaged or "
            f"truncated, restore it or collect again"
        ) from None
    except ValueError:  # hundreds of brackets in brackets, thousands of digits
        raise DatasetError(
            f"{path}: no ATOM dataset, its brackets are too deep or a number is too long; restore "
            f"the file or collect again"
        ) from None
    if not isinstance(document, dict) or "sensors" not in document or "collections" not in document:
        raise DatasetError(f"{path}: no ATOM dataset, it lacks 'sensors' or 'collections'")
    check_dataset_structure(document, str(path))
    if not document["sensors"]:
        raise DatasetError(f"{path}: there is no sensor in it; restore the file or collect again")
    return document


def dataset_from_document(
    document: Mapping[str, Any],
    source: Path,
    choose: Optional[Choose] = None,
) -> Dataset:
    """Return the typed dataset of a JSON document, without access to its data.

    Args:
        document: as it was read.
        source: its file, for messages.
        choose: see `read_dataset`.

    Raises:
        DatasetError: naming the file and the sensor, collection or pattern that is wrong.
    """
    reader = _Reader(document, str(source))
    config = reader.config()
    sensors = reader.sensors(config)
    patterns = reader.patterns(config)
    keys = sorted_keys(document)
    chosen = keys if choose is None else choose(keys)
    collections = {key: reader.collection(key, sensors, patterns) for key in chosen}
    estimated = {sensor.edge for sensor in sensors.values()}
    estimated |= {edge for _, edge in config.estimated_edges}
    frames = [config.world_link, *(sensor.frame for sensor in sensors.values())]
    collections, freed = with_boards_free(collections, patterns, frames, estimated, str(source))
    reader.warnings += freed
    check_trees(collections.values(), estimated, str(source))
    boards = {board_edge(pattern) for pattern in patterns.values()}
    types, told = edge_types(document, config, {s.edge for s in sensors.values()} | boards)
    return Dataset(
        source=Path(source),
        config=config,
        sensors=sensors,
        patterns=patterns,
        collections=collections,
        edge_types=types,
        document=document,
        warnings=(*reader.warnings, *told, *(c.sentence for c in reader.caveats), *config.warnings),
        caveats=tuple(reader.caveats),
    )


def sorted_keys(document: Mapping[str, Any]) -> List[str]:
    """Return the collection keys, numbers first in their order."""

    def order(key: str) -> Tuple[int, int, str]:
        return (0, int(key), key) if key.isdigit() else (1, 0, key)

    return sorted(document["collections"], key=order)


class _Reader:
    """Reads the parts of one document; knows its place for the messages."""

    def __init__(self, document: Mapping[str, Any], where: str):
        self.document, self.where = document, where
        self.warnings: List[str] = []
        self.caveats = self._kept_caveats()

    def _kept_caveats(self) -> List[Caveat]:
        try:
            return list(caveats_of(self.document))
        except KeyError as error:
            raise self.fail(f"_metadata.caveats: one lacks {error}; restore the file") from None

    def fail(self, what: str) -> DatasetError:
        return DatasetError(f"{self.where}: {what}")

    def config(self) -> CalibrationConfig:
        if "calibration_config" not in self.document:
            raise self.fail("'calibration_config' is absent")
        try:
            return CalibrationConfig.from_document(
                self.document["calibration_config"], f"{self.where}: calibration_config"
            )
        except AtomError as error:
            raise DatasetError(str(error)) from None

    def sensors(self, config: CalibrationConfig) -> Dict[str, Sensor]:
        names = list(self.document["sensors"])
        for name in names:
            try:
                check_name(name, ("sensors", name))
            except AtomError as error:
                raise self.fail(str(error)) from None
        in_order = [n for n in config.sensors if n in names]
        return {
            n: self.sensor(n, config) for n in in_order + [n for n in names if n not in in_order]
        }

    def note_lens(self, name: str, camera: Camera, entry: Mapping[str, Any]) -> None:
        """Remark what the intrinsics of a camera leave in doubt."""
        topic = str(entry.get("topic", ""))
        if not len(camera.D) and not looks_rectified(topic):
            self.warnings.append(
                f"sensor '{name}' has no distortion coefficients (D): its images are taken as free "
                f"of distortion"
            )
        found = lens_caveats(name, topic, camera, entry["camera_info"].get("P") or [])
        self.caveats += [caveat for caveat in found if caveat not in self.caveats]

    @staticmethod
    def _beam_width_rad(config: CalibrationConfig, name: str) -> float:
        entry = config.sensors.get(name)
        return float(entry.beam_width or 0.0) if entry else 0.0

    def sensor(self, name: str, config: CalibrationConfig) -> Sensor:
        entry = self.document["sensors"][name]
        try:
            kind = modality_of_entry(entry)
            self.warnings += other_than_configured(name, entry, config.sensors.get(name))
            camera = camera_of_entry(entry["camera_info"]) if kind.has_camera_info else None
            if camera is not None:
                self.note_lens(name, camera, entry)
            return Sensor(
                name=name,
                modality=kind.name,
                frame=entry["parent"],
                edge=Edge(entry["calibration_parent"], entry["calibration_child"]),
                camera=camera,
                topic=entry.get("topic", ""),
                beam_width_rad=self._beam_width_rad(config, name),
            )
        except KeyError as error:
            modality = entry.get("modality") or "unknown"
            raise self.fail(
                f"sensor '{name}' (modality {modality}) lacks {error}; add it, or correct the "
                f"modality"
            ) from None
        except (ValueError, TypeError) as error:
            raise self.fail(f"sensor '{name}': {error}") from None

    def patterns(self, config: CalibrationConfig) -> Dict[str, Pattern]:
        stored = self.document.get("patterns") or {}
        if "corners" in stored and len(config.calibration_patterns) == 1:  # layout of version 2
            stored = {next(iter(config.calibration_patterns)): stored}
        patterns = {}
        for name, entry in config.calibration_patterns.items():
            described = pattern_from_config(name, entry)
            try:
                patterns[name], told = pattern_of_entry(described, stored.get(name) or {})
            except (KeyError, ValueError, TypeError) as error:
                why = f"corners or frame are malformed ({error})"
                raise self.fail(f"pattern '{name}': {why}") from None
            self.warnings += told
        return patterns

    def collection(
        self, key: str, sensors: Mapping[str, Sensor], patterns: Mapping[str, Pattern]
    ) -> Collection:
        entry = self.document["collections"][key]
        try:
            check_images(self.document["sensors"], entry.get("data") or {}, sensors)
        except ValueError as error:
            raise self.fail(f"collection {key}, {error}") from None
        transforms = self.transforms(key, entry)
        return Collection(
            key=key,
            labels=self.labels(key, entry, sensors, patterns),
            transforms=transforms,
            joints=self.joints(key, entry, transforms),
        )

    def joints(
        self, key: str, entry: Mapping[str, Any], transforms: Mapping[Edge, np.ndarray]
    ) -> Dict[str, JointState]:
        joints = {}
        for name, value in (entry.get("joints") or {}).items():
            try:
                joints[name] = joint_of_entry(value, transforms.get(edge_of_joint(value)))
            except KeyError as error:
                raise self.fail(f"collection {key}, joint '{name}' lacks {error}") from None
            except (ValueError, TypeError) as error:
                raise self.fail(f"collection {key}, joint '{name}': {error}") from None
        return joints

    def transforms(self, key: str, entry: Mapping[str, Any]) -> Dict[Edge, np.ndarray]:
        transforms: Dict[Edge, np.ndarray] = {}
        for name, value in (entry.get("transforms") or {}).items():
            try:
                edge, matrix = Edge(value["parent"], value["child"]), pose_of_entry(value)
            except KeyError as error:
                raise self.fail(f"collection {key}, transform '{name}' lacks {error}") from None
            except (ValueError, TypeError) as error:
                raise self.fail(f"collection {key}, transform '{name}': {error}") from None
            if edge in transforms and not np.allclose(transforms[edge], matrix, atol=_SAME):
                raise self.fail(
                    f"collection {key}: transform '{name}' says of frame '{edge.child}' in "
                    f"'{edge.parent}' what another one denies; remove one of the two"
                )
            transforms[edge] = matrix
        return transforms

    def labels(
        self,
        key: str,
        entry: Mapping[str, Any],
        sensors: Mapping[str, Sensor],
        patterns: Mapping[str, Pattern],
    ) -> Dict[Tuple[str, str], Label]:
        by_pattern = entry.get("labels") or {}
        if is_old_layout(by_pattern, sensors, patterns):
            by_pattern = {next(iter(patterns)): by_pattern}
        labels: Dict[Tuple[str, str], Label] = {}
        for pattern_name, by_sensor in by_pattern.items():
            if pattern_name not in patterns:
                self.warnings.append(
                    f"collection {key}: labels of unknown pattern '{pattern_name}'"
                )
                continue
            for sensor_name, value in by_sensor.items():
                if not isinstance(value, Mapping):
                    continue  # null where nothing was seen
                if sensor_name in sensors and says_detected(value):
                    where = f"collection {key}, sensor '{sensor_name}', pattern '{pattern_name}'"
                    label = self._label(value, sensors[sensor_name], patterns[pattern_name], where)
                    if label.detected:
                        labels[(sensor_name, pattern_name)] = label
        return labels

    def _label(
        self, value: Mapping[str, Any], sensor: Sensor, pattern: Pattern, where: str
    ) -> Label:
        try:
            return sensor.kind.labels.read(value, pattern)
        except KeyError as error:
            raise self.fail(f"{where}: the label lacks {error}") from None
        except TypeError:
            raise self.fail(
                f"{where}: this is no label of modality {sensor.modality}; correct the sensor's "
                f"modality, or leave the sensor out with -ssf"
            ) from None
        except (ValueError, OverflowError) as error:
            raise self.fail(f"{where}: {error}") from None


def document_of(dataset: Dataset, relabeled: Iterable[DetectionKey] = ()) -> Dict[str, Any]:
    """Return the JSON document of a dataset: what was read, with its transforms of now.

    Collections that were left out stay out, as ATOM has it: their edges would be others.

    Args:
        dataset: with its document.
        relabeled: labels that are to be written as they are now; all others stay as they were
            read, to the last digit.
    """
    document = dict(dataset.document)
    document["sensors"] = {
        name: with_camera(entry, dataset.sensors[name].camera) if name in dataset.sensors else entry
        for name, entry in document["sensors"].items()
    }
    kept = {k: dict(v) for k, v in document["collections"].items() if k in dataset.collections}
    for key, collection in dataset.collections.items():
        stored = dict(kept[key].get("transforms") or {})
        names = {Edge(value["parent"], value["child"]): name for name, value in stored.items()}
        for edge, matrix in collection.transforms.items():
            lay_over(stored, names.get(edge, str(edge)), edge, matrix)
        kept[key]["transforms"] = stored
        if collection.joints:
            before = document["collections"][key]
            kept[key]["joints"] = joints_document(before, collection.joints, names)
    for detection in relabeled:
        entry = kept[detection.collection]
        entry["labels"] = with_label(entry.get("labels") or {}, dataset, detection)
    document["collections"] = kept
    if document.get("patterns"):
        document["patterns"] = with_borders(document["patterns"], dataset)
    return document


def dumps(document: Mapping[str, Any]) -> str:
    """Return the text of a dataset as ATOM writes it: two spaces, keys sorted, all digits."""
    return json.dumps(document, indent=2, sort_keys=True)


def write_document(path: Path, document: Mapping[str, Any]) -> None:
    """Write the text of a dataset (`dumps`) while it is made.

    Raises:
        OutputError: the file cannot be written; an older one is left as it was.
    """
    write_pieces_atomically(path, lambda write: write_json(document, write))


def write_dataset(dataset: Dataset, path: Path, relabeled: Iterable[DetectionKey] = ()) -> None:
    """Write a dataset's JSON (not its data files, which stay where they are).

    In another folder than the one it was read from, it names its data files by their path from
    there, so that it can be read again.

    Args:
        dataset: what to write.
        path: the file.
        relabeled: see `document_of`.

    Raises:
        OutputError: the file cannot be written; an older one is left as it was.
    """
    document = document_of(dataset, relabeled)
    write_document(Path(path), relocated(document, dataset.source.parent, Path(path).parent))


def relocated(document: Mapping[str, Any], home: Path, here: Path) -> Dict[str, Any]:
    """Return the document with its data files named from another folder.

    Args:
        document: as it lies in a folder.
        home: that folder.
        here: where it is to lie.
    """
    home, here = Path(home).resolve(), Path(here).resolve()
    if home == here:
        return dict(document)
    collections = {}
    for key, collection in document["collections"].items():
        data = dict(collection.get("data") or {})
        for sensor, entry in data.items():
            if isinstance(entry, dict) and entry.get("data_file"):
                found = data_path(home, entry)
                if found is not None:
                    data[sensor] = {**entry, "data_file": os.path.relpath(found, here)}
        collections[key] = {**collection, **({"data": data} if data else {})}
    return {**document, "collections": collections}
