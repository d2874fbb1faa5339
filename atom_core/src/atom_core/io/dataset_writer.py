"""A new ATOM v3 dataset from the model: the whole document, and its data files.

``dataset_json`` lays changes over a document that was read; here there is none yet. The format
is described in docs/dataset_format.md.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Dict, Mapping, Optional, Tuple

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.io.atomic import copy_atomically, prepare_output_folder
from atom_core.io.dataset_entries import joint_document, transform_document
from atom_core.io.dataset_json import write_document
from atom_core.io.dataset_version import CURRENT_VERSION
from atom_core.io.together import written_together
from atom_core.model.dataset import Collection, Dataset, board_edge
from atom_core.model.pattern import Pattern, geometry_document
from atom_core.model.sensor import Sensor

DATASET_FILE = "dataset.json"

InitialBoards = Mapping[Tuple[str, str], Tuple[str, np.ndarray]]
Stamps = Mapping[Tuple[str, str], float]


def new_document(
    dataset: Dataset,
    *,
    name: str,
    time_s: float = 0.0,
    user: str = "",
    robot_name: str = "",
    stamps: Optional[Stamps] = None,
    initial_boards: Optional[InitialBoards] = None,
) -> Dict[str, Any]:
    """Return the document of a dataset that has none yet.

    Args:
        dataset: sensors, patterns, labels and transforms; its data source gives the clouds' sizes.
        name: the dataset's name.
        time_s: when it was made, seconds since 1970 (UTC); given so that files are reproducible.
        user: who made it.
        robot_name: what stands in the description.
        stamps: time of the data [s] by (collection, sensor); default the collection's number.
        initial_boards: the sensor that placed a board and ``parent_T_pattern`` (4, 4), by
            (pattern, collection), where known.
    """
    return {
        "_metadata": {
            "timestamp": str(time_s),
            "date": time.strftime("%a %b %d %H:%M:%S %Y", time.gmtime(time_s)),
            "user": user,
            "version": CURRENT_VERSION,
            "robot_name": robot_name,
            "dataset_name": name,
            "package_name": dataset.config.package_name or "",
        },
        "calibration_config": dataset.config.to_document(),
        "additional_sensor_data": {},
        "sensors": {s.name: _sensor(dataset, s) for s in dataset.sensors.values()},
        "collections": {
            key: _collection(dataset, collection, number, stamps or {})
            for number, (key, collection) in enumerate(dataset.collections.items())
        },
        "transforms": _edges(dataset),
        "patterns": _patterns(dataset, initial_boards or {}),
    }


def write_dataset_folder(
    dataset: Dataset, folder: Path, *, name: str, overwrite: bool = False, **options: Any
) -> Path:
    """Write a dataset, so that it is whole or absent; one that was there is replaced as a whole.

    Args:
        dataset: what to write, with its data.
        folder: where; made when absent.
        name: the dataset's name.
        overwrite: accept a folder that holds something, and replace files of the same name.
        options: further arguments of ``new_document``.

    Returns:
        The path of ``dataset.json``.

    Raises:
        OutputError: the folder is not empty or cannot be written to.
    """
    folder = prepare_output_folder(folder, overwrite)
    document = new_document(dataset, name=name, **options)
    present = [
        (key, sensor)
        for key in dataset.collections
        for sensor in dataset.sensors.values()
        if dataset.data.has_data(key, sensor.name)
    ]
    path = folder / DATASET_FILE
    names = [data_file_name(sensor, key) for key, sensor in present]
    with written_together(folder, [*names, DATASET_FILE]):
        for key, sensor in present:
            write_data_file(folder, sensor, key, dataset.data.read(key, sensor.name))
        write_document(path, document)
    return path


def write_with_copies(folder: Path, document: Mapping[str, Any], files: Mapping[str, Path]) -> Path:
    """Write a dataset whose data files are copied as they are; return the path of its JSON.

    One that was there is replaced as a whole.

    Args:
        folder: it exists.
        document: the JSON.
        files: what to copy, by its name in the folder.

    Raises:
        OutputError: a file cannot be read or written; everything is as it was.
    """
    path = folder / DATASET_FILE
    with written_together(folder, [*files, DATASET_FILE]):
        for name, source in files.items():
            copy_atomically(source, folder / name)
        write_document(path, document)
    return path


def data_file_name(sensor: Sensor, collection: str) -> str:
    """Return the name of the data file of a sensor in a collection."""
    return f"{sensor.name}_{collection}{sensor.kind.data.ending}"


def camera_info_document(camera: Camera, frame: str) -> Dict[str, Any]:
    """Return intrinsics as a CameraInfo message; every number of D, K, R, P is a float.

    A camera without distortion is written as plumb_bob with zeros, which every reader knows.
    """
    plain = camera.model in ("none", "plumb_bob")
    coefficients = [float(v) for v in camera.D]
    if plain:
        coefficients += [0.0] * (5 - len(coefficients))
    return {
        "header": _header(frame, 0.0, 0),
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "plumb_bob" if plain else camera.model,
        "D": coefficients,
        "K": [float(v) for v in camera.K.ravel()],
        "R": [float(v) for v in np.eye(3).ravel()],
        "P": [float(v) for v in np.column_stack([camera.K, np.zeros(3)]).ravel()],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def _sensor(dataset: Dataset, sensor: Sensor) -> Dict[str, Any]:
    chain = dataset.graph.chain(dataset.world, sensor.frame)
    document: Dict[str, Any] = {
        "_name": sensor.name,
        "modality": sensor.modality,
        "parent": sensor.frame,
        "calibration_parent": sensor.edge.parent,
        "calibration_child": sensor.edge.child,
        "topic": sensor.topic,
        "msg_type": sensor.kind.data.message,
        "chain": [
            {"key": str(edge), "parent": edge.parent, "child": edge.child} for edge, _ in chain
        ],
    }
    if sensor.camera is not None:
        folder = sensor.topic.rpartition("/")[0]
        document["camera_info_topic"] = f"{folder}/camera_info"
        document["camera_info"] = camera_info_document(sensor.camera, sensor.frame)
    return document


def _collection(
    dataset: Dataset, collection: Collection, number: int, stamps: Stamps
) -> Dict[str, Any]:
    data = {}
    for sensor in dataset.sensors.values():
        if dataset.data.has_data(collection.key, sensor.name):
            stamp = stamps.get((collection.key, sensor.name), float(number))
            data[sensor.name] = _data(dataset, collection.key, sensor, stamp, number)
    return collection_document(collection, dataset.sensors, dataset.patterns, data)


def collection_document(
    collection: Collection,
    sensors: Mapping[str, Sensor],
    patterns: Mapping[str, Pattern],
    data: Mapping[str, Mapping[str, Any]],
) -> Dict[str, Any]:
    """Return a collection as it stands in a dataset's JSON.

    Args:
        collection: labels, transforms and joints.
        sensors: of the dataset, by name; what they did not detect gets an empty label.
        patterns: likewise.
        data: the entries of `data_entry`, by sensor.
    """
    return {
        "data": dict(data),
        "labels": {
            pattern: {
                name: sensor.kind.labels.document(
                    collection.labels.get((name, pattern), sensor.kind.labels.empty)
                )
                for name, sensor in sensors.items()
            }
            for pattern in patterns
        },
        "transforms": {
            str(edge): transform_document(edge, matrix)
            for edge, matrix in collection.transforms.items()
        },
        "joints": {name: joint_document(joint) for name, joint in collection.joints.items()},
        "additional_data": {},
    }


def _data(dataset: Dataset, key: str, sensor: Sensor, stamp: float, seq: int) -> Dict[str, Any]:
    header = _header(sensor.frame, stamp, seq)
    return data_entry(sensor, key, dataset.data.read(key, sensor.name), header)


def data_entry(
    sensor: Sensor, collection: str, data: Any, header: Mapping[str, Any]
) -> Dict[str, Any]:
    """Return the message of a sensor; of data in a file its name, and the message without them.

    Args:
        sensor: whose.
        collection: its key.
        data: as the sensor's modality has them.
        header: of the message.
    """
    document: Dict[str, Any] = {"header": dict(header)}
    if sensor.kind.data.ending:
        document["data_file"] = data_file_name(sensor, collection)
    return {**document, **sensor.kind.data.entry(sensor, data)}


def write_data_file(folder: Path, sensor: Sensor, collection: str, data: Any) -> Any:
    """Write the data of a sensor where its modality has files for them.

    Returns:
        What the modality's function returns: for depth images, what the file does not hold.

    Raises:
        OutputError: the file cannot be written.
    """
    write = sensor.kind.data.write
    return None if write is None else write(folder / data_file_name(sensor, collection), data)


def _header(frame: str, stamp_s: float, seq: int) -> Dict[str, Any]:
    nanoseconds = int(round(stamp_s * 1e9))
    secs, nsecs = divmod(nanoseconds, 10**9)
    return {"seq": seq, "stamp": {"secs": secs, "nsecs": nsecs}, "frame_id": frame}


def _edges(dataset: Dataset) -> Dict[str, Any]:
    """Return every edge of any collection with its type."""
    calibrated = set(dataset.sensor_edges)
    edges = dict.fromkeys(e for c in dataset.collections.values() for e in c.transforms)
    return {
        str(edge): {
            "parent": edge.parent,
            "child": edge.child,
            "type": dataset.edge_types.get(edge, "fixed"),
            "is_transformation_calibrated": edge in calibrated,
        }
        for edge in edges
    }


def _patterns(dataset: Dataset, initial_boards: InitialBoards) -> Dict[str, Any]:
    return {
        name: {
            **geometry_document(pattern),
            "transforms_initial": {
                key: initial_board_document(pattern, initial_boards.get((name, key)))
                for key in dataset.collections
            },
        }
        for name, pattern in dataset.patterns.items()
    }


def initial_board_document(
    pattern: Pattern, placed: Optional[Tuple[str, np.ndarray]]
) -> Dict[str, Any]:
    """Return the first pose of a board in a collection, as ATOM has it.

    Args:
        pattern: the board.
        placed: the sensor that placed it and ``parent_T_pattern`` (4, 4); None: nobody did.
    """
    if placed is None:
        return {"detected": False}
    sensor, parent_T_pattern = placed
    pose = transform_document(board_edge(pattern), parent_T_pattern)
    return {"detected": True, "sensor": sensor, **pose}
