"""What Kalibr takes: images of several cameras at common stamps, and a target's description.

Formats as in Kalibr's documentation ("Calibration targets", "Bag format").
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.errors import DatasetError, OutputError
from atom_core.io.atomic import write_text_atomically
from atom_core.io.images import write_image
from atom_core.model.dataset import Dataset
from atom_core.model.pattern import CHARUCO, Pattern
from atom_core.model.sensor import RGB

TARGET_FILE = "target.yaml"
FEWEST_CORNERS = 3  # along a side of Kalibr's checkerboard
_SECOND_NS = 1_000_000_000
_MODELS = {"equidistant": "pinhole-equi"}
_USUAL_MODEL = "pinhole-radtan"


class Frame(NamedTuple):
    """An image as Kalibr gets it.

    Attributes:
        number: of the camera: cam0, cam1, ...
        stamp_ns: the same for all cameras of a collection.
        grey: (height, width) uint8.
    """

    number: int
    stamp_ns: int
    grey: np.ndarray


@dataclass(frozen=True)
class KalibrExport:
    """Cameras and the board that are handed on.

    Attributes:
        dataset: with the images.
        cameras: names, in the order of cam0, cam1, ...
        pattern: the board.
    """

    dataset: Dataset
    cameras: Tuple[str, ...]
    pattern: Pattern

    @property
    def topics(self) -> List[str]:
        """Topics of raw images, by which the answer is known again."""
        sensors = [self.dataset.sensors[name] for name in self.cameras]
        return [s.topic.replace("/compressed", "") or f"/{s.name}/image_raw" for s in sensors]

    @property
    def models(self) -> List[str]:
        """The camera models to ask Kalibr for."""
        cameras = [self.dataset.sensors[name].camera for name in self.cameras]
        return [_MODELS.get(c.model, _USUAL_MODEL) if c else _USUAL_MODEL for c in cameras]

    @property
    def remarks(self) -> List[str]:
        """What the user should know, a sentence each."""
        if self.pattern.kind != CHARUCO:
            return []
        return [
            f"Kalibr has no ChArUco: {TARGET_FILE} describes the inner corners of "
            f"'{self.pattern.name}' as a checkerboard. Kalibr takes the images alone that show all "
            f"of it, and the markers may hide it from its detector"
        ]

    def frames(self) -> Iterator[Frame]:
        """Yield the images in the order of time.

        Raises:
            DatasetError: a data file is absent or damaged.
        """
        for key, number, stamp_ns in self._images():
            image = self.dataset.data.read(key, self.cameras[number])
            grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
            yield Frame(number, stamp_ns, grey)

    def files(self, folder: Path) -> List[Path]:
        """Return where the images stand in a folder for ``kalibr_bagcreater``."""
        return [image_file(folder, number, stamp_ns) for _, number, stamp_ns in self._images()]

    def _images(self) -> List[Tuple[str, int, int]]:
        """Return (collection, number of the camera, stamp [ns]) in the order of time."""
        stamps = _stamps_ns(self.dataset)
        return [
            (key, number, stamps[key])
            for key in sorted(stamps, key=lambda key: stamps[key])
            for number, name in enumerate(self.cameras)
            if self.dataset.data.has_data(key, name)
        ]


def kalibr_export(dataset: Dataset) -> KalibrExport:
    """Return what of a dataset is for Kalibr.

    Args:
        dataset: reduced to what is to be handed on.

    Raises:
        DatasetError: it has no images, not one board, or one that Kalibr cannot describe.
    """
    cameras = tuple(
        name
        for name, sensor in dataset.sensors.items()
        if sensor.modality == RGB
        and any(dataset.data.has_data(key, name) for key in dataset.collections)
    )
    if not cameras:
        raise DatasetError(f"{dataset.source}: no rgb camera has an image; Kalibr takes no others")
    if len(dataset.patterns) != 1:
        raise DatasetError(
            f"{dataset.source}: {len(dataset.patterns)} patterns "
            f"({', '.join(dataset.patterns)}); Kalibr takes one: name it with -psf"
        )
    (pattern,) = dataset.patterns.values()
    if min(pattern.columns, pattern.rows) < FEWEST_CORNERS:
        raise DatasetError(
            f"{dataset.source}: pattern '{pattern.name}' has {pattern.columns} x {pattern.rows} "
            f"inner corners; Kalibr's checkerboard takes {FEWEST_CORNERS} or more along each side"
        )
    return KalibrExport(dataset, cameras, pattern)


def target_text(pattern: Pattern) -> str:
    """Return the description of a board, as Kalibr's --target reads it."""
    return (
        "target_type: 'checkerboard'\n"
        f"targetCols: {pattern.columns}  # inner corners along x\n"
        f"targetRows: {pattern.rows}  # inner corners along y\n"
        f"rowSpacingMeters: {pattern.square_m!r}\n"
        f"colSpacingMeters: {pattern.square_m!r}\n"
    )


def write_kalibr_folder(export: KalibrExport, folder: Path) -> int:
    """Write the target, and images as ``camN/STAMP.png`` for ``kalibr_bagcreater``.

    Args:
        export: what is handed on.
        folder: without images of other collections, which Kalibr would take for some of these.

    Returns:
        The number of images.

    Raises:
        DatasetError: a data file is absent or damaged.
        OutputError: it holds other images, or something cannot be written.
    """
    here = set(export.files(folder))
    others = [path for path in sorted(folder.glob("cam*/*.png")) if path not in here]
    if others:
        raise OutputError(
            f"{folder}: {others[0].relative_to(folder)} is of another conversion ({len(others)} "
            f"files), and Kalibr would take it for one of this; remove the images, or choose "
            f"another folder"
        )
    write_text_atomically(folder / TARGET_FILE, target_text(export.pattern))
    count = 0
    for frame in export.frames():
        path = image_file(folder, frame.number, frame.stamp_ns)
        path.parent.mkdir(exist_ok=True)
        write_image(path, frame.grey)
        count += 1
    return count


def image_file(folder: Path, number: int, stamp_ns: int) -> Path:
    """Return where the image of a camera at an instant stands."""
    return folder / f"cam{number}" / f"{stamp_ns}.png"


def _stamps_ns(dataset: Dataset) -> Dict[str, int]:
    """Return one stamp [ns] for each collection: of its first data, or counted in seconds."""
    found = {key: _first_stamp_ns(dataset, key) for key in dataset.collections}
    if 0 in found.values() or len(set(found.values())) < len(found):
        return {key: (i + 1) * _SECOND_NS for i, key in enumerate(dataset.collections)}
    return found


def _first_stamp_ns(dataset: Dataset, key: str) -> int:
    data = dataset.document["collections"][key].get("data") or {}
    stamps = [((entry or {}).get("header") or {}).get("stamp") or {} for entry in data.values()]
    known = [int(s.get("secs", 0)) * _SECOND_NS + int(s.get("nsecs", 0)) for s in stamps]
    return min((stamp for stamp in known if stamp > 0), default=0)
