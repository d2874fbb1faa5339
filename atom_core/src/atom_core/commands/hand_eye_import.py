"""Images and a robot's poses become a dataset: its corners, and intrinsics where none are known."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from atom_core.commands import common
from atom_core.commands.hand_eye_check import remarks_on_poses
from atom_core.commands.hand_eye_frames import (
    Frames,
    config_of_cameras,
    frames_of,
    without_hold,
)
from atom_core.errors import DatasetError, OutputError
from atom_core.geometry.camera import Camera
from atom_core.geometry.intrinsics_from_boards import camera_of_boards
from atom_core.geometry.units import MM_PER_M
from atom_core.io.atomic import prepare_output_folder
from atom_core.io.camera_info_yaml import read_camera_info
from atom_core.io.config_yaml import read_config
from atom_core.io.dataset_writer import DATASET_FILE, new_document, write_with_copies
from atom_core.io.hand_eye_folders import RobotImages, ToldBoard
from atom_core.io.images import read_image
from atom_core.labeling.rgb import RgbLabeler
from atom_core.model.config import CalibrationConfig
from atom_core.model.dataset import MULTIPLE, Collection, Dataset, DataSource
from atom_core.model.labels import Label, RgbLabel
from atom_core.model.pattern import Pattern, pattern_from_config
from atom_core.model.sensor import RGB, Sensor

_SAME_SIDE = 1e-3  # of a square: sides that differ by a smaller part are one, rounded

Labels = Dict[Tuple[str, int, str], RgbLabel]  # by camera, number, pattern


def add_import_options(parser: argparse.ArgumentParser) -> None:
    """Add what all conversions into a dataset take."""
    add = common.add_option
    add(
        parser,
        "config",
        *("-json", "--json_file", "-c"),
        required=True,
        type=Path,
        metavar="FILE",
        help="the calibration's config.yml (or JSON), with cameras and boards",
    )
    add(
        parser,
        "output",
        *("-out", "--output_folder", "-o"),
        required=True,
        type=Path,
        metavar="DIR",
        help="folder for the dataset; must be empty or absent, or add --overwrite",
    )
    text = "the frame whose poses the robot reports (default: parent of the camera or the board)"
    add(parser, "hand_link", "-hl", metavar="FRAME", help=text)
    text = "the frame in which it reports them (default: the configuration's world_link)"
    add(parser, "base_link", "-bl", metavar="FRAME", help=text)
    add(
        parser,
        "camera_info",
        nargs=2,
        action="append",
        default=[],
        metavar=("CAMERA", "FILE"),
        help="its intrinsics, as camera_calibration writes them (default: from the images)",
    )
    add(parser, "overwrite", "-ow", action="store_true", help="replace files in the folder")


def import_folder(args: argparse.Namespace, content: RobotImages) -> int:
    """Make the dataset, write it, and say what was found."""
    common.refuse_occupied(args.output, args.overwrite)
    _refuse_folder_of_images(args.output, content)
    config, remarks = config_of_cameras(read_config(args.config), list(content.images))
    frames = frames_of(config, args)
    config, told = without_hold(config, frames.unplaced)
    patterns = {n: pattern_from_config(n, e) for n, e in config.calibration_patterns.items()}
    known = _known_cameras(args, content)
    sensors, labels = {}, {}
    for name in content.images:
        camera, found = _camera(name, config, patterns, content, known.get(name))
        sensors[name] = _sensor(name, config, camera)
        labels.update(found)
    dataset = _dataset(args.output, config, sensors, labels, content, frames)
    _write(dataset, content, args)
    remarks += [*told, *frames.remarks, *_remarks_on_board(content.board, patterns)]
    for remark in (*remarks, *remarks_on_poses(dataset, frames.arm)):
        print(remark)
    path = (args.output / DATASET_FILE).resolve()
    print(f"{path}: {len(sensors)} cameras, {len(dataset.collections)} poses")
    return 0


def _refuse_folder_of_images(folder: Path, content: RobotImages) -> None:
    """Refuse to put the dataset's copies among the images: they would count as further ones.

    Raises:
        OutputError: naming the folder.
    """
    files = (path for of_camera in content.images.values() for path in of_camera.values())
    if folder.resolve() in {path.parent.resolve() for path in files}:
        raise OutputError(
            f"{folder}: the images themselves are in it, and the dataset's copies would be taken "
            f"for further ones; choose another folder for --output"
        )


def _known_cameras(args: argparse.Namespace, content: RobotImages) -> Dict[str, Camera]:
    """Return the cameras whose intrinsics are given, by name.

    Raises:
        DatasetError: a file cannot be used, or there are no images of its camera.
    """
    for name, path in args.camera_info:
        if name not in content.images:
            raise DatasetError(
                f"--camera_info {name} {path}: there are no images of a camera '{name}'; there "
                f"are of: {', '.join(content.images)}"
            )
    return {name: read_camera_info(Path(path)) for name, path in args.camera_info}


def _remarks_on_board(told: Optional[ToldBoard], patterns: Mapping[str, Pattern]) -> List[str]:
    """Return a sentence where no board of the configuration is the one that the folder tells of."""
    if told is None:
        return []
    sized = [p for p in patterns.values() if _is_near(told.sides_m, p.square_m)]
    counted = [p for p in sized if told.corners in ((), tuple(sorted((p.columns, p.rows))))]
    if counted:
        return []
    sides = " x ".join(f"{MM_PER_M * side:.6g}" for side in dict.fromkeys(told.sides_m))
    corners = f", {' x '.join(map(str, told.corners))} inner corners" if told.corners else ""
    configured = "; ".join(
        f"'{name}' has {MM_PER_M * p.square_m:.6g} mm, {p.columns} x {p.rows}"
        for name, p in patterns.items()
    )
    return [
        f"warning: {told.path}: squares of {sides} mm{corners}, and in the configuration "
        f"{configured}; correct what is wrong: all lengths are as right as the board's"
    ]


def _is_near(sides_m: Sequence[float], square_m: float) -> bool:
    return all(abs(side - square_m) <= _SAME_SIDE * square_m for side in sides_m)


def _sensor(name: str, config: CalibrationConfig, camera: Camera) -> Sensor:
    entry = config.sensors[name]
    return Sensor(name, RGB, entry.link, entry.edge, camera, entry.topic_name)


def _camera(
    name: str,
    config: CalibrationConfig,
    patterns: Mapping[str, Pattern],
    content: RobotImages,
    known: Optional[Camera],
) -> Tuple[Camera, Labels]:
    """Find the corners in a camera's images, and its intrinsics where they are not known."""
    files = content.images[name]
    size = read_image(next(iter(files.values()))).shape[:2]
    guess = Camera(size[1], size[0], np.array([size[1], 0, 0, 0, size[1], 0, 0, 0, 1.0]))
    sensor = _sensor(name, config, known or guess)
    labels: Labels = {}
    for pattern_name, pattern in patterns.items():
        labeler = RgbLabeler(sensor, pattern, config.calibration_patterns[pattern_name])
        for number, path in files.items():
            label = labeler.label(read_image(path, sensor_size(sensor))).label
            if label.detected:
                assert isinstance(label, RgbLabel)
                labels[name, number, pattern_name] = label
    print(f"{name}: boards found in {len({n for _, n, _ in labels})} of {len(files)} images")
    if not labels:
        raise DatasetError(
            f"{files[next(iter(files))].parent}: no board is found in any image of '{name}'; check "
            f"the boards of the configuration"
        )
    if known is not None:
        return known, labels
    points = [patterns[p].corners_of(label.ids) for (_, _, p), label in labels.items()]
    pixels = [label.pixels for label in labels.values()]
    try:
        camera, rms_px = camera_of_boards(points, pixels, size[1], size[0])
    except ValueError as error:
        raise DatasetError(f"intrinsics of '{name}': {error}; give them: --camera_info") from None
    print(f"{name}: intrinsics from these images, {rms_px:.3f} px; focal lengths {camera.focal_px}")
    return camera, labels


def sensor_size(sensor: Sensor) -> Tuple[int, int]:
    """Return rows and columns of a camera's images."""
    assert sensor.camera is not None
    return sensor.camera.height, sensor.camera.width


class _Images(DataSource):
    """The images where they lie."""

    def __init__(self, files: Mapping[Tuple[str, str], Path]):
        self.files = files

    def has_data(self, collection: str, sensor: str) -> bool:
        """Tell whether there is an image."""
        return (collection, sensor) in self.files

    def read(self, collection: str, sensor: str) -> Any:
        """Return an image (height, width, 3)."""
        return read_image(self.files[collection, sensor])


def _dataset(
    folder: Path,
    config: CalibrationConfig,
    sensors: Mapping[str, Sensor],
    labels: Labels,
    content: RobotImages,
    frames: Frames,
) -> Dataset:
    collections, files = {}, {}
    for number, base_T_hand in content.base_T_hand.items():
        key = f"{number:03d}"
        seen: Dict[Tuple[str, str], Label] = {
            (camera, p): label for (camera, n, p), label in labels.items() if n == number
        }
        collections[key] = Collection(key, seen, {frames.arm: base_T_hand, **frames.fixed})
        for camera, of_camera in content.images.items():
            if number in of_camera:
                files[key, camera] = of_camera[number]
    patterns = {n: pattern_from_config(n, e) for n, e in config.calibration_patterns.items()}
    return Dataset(
        source=folder / DATASET_FILE,
        config=config,
        sensors=sensors,
        patterns=patterns,
        collections=collections,
        edge_types={frames.arm: MULTIPLE},
        data=_Images(files),
    )


def _write(dataset: Dataset, content: RobotImages, args: argparse.Namespace) -> None:
    """Copy the images as they are, and write the JSON."""
    document = new_document(dataset, name=args.output.name)
    folder = prepare_output_folder(args.output, args.overwrite)
    sources = {}
    for number in content.base_T_hand:
        data = document["collections"][f"{number:03d}"]["data"]
        for camera, entry in data.items():
            source = content.images[camera][number]
            entry["data_file"] = f"{camera}_{number:03d}{source.suffix}"
            sources[entry["data_file"]] = source
    write_with_copies(folder, document, sources)
