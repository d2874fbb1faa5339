"""Contact sheets of labels, one picture for each modality, out of a collected dataset.

``python3 docs/make_label_sheets.py --dataset DIR`` with a folder that ``collect_from_bag
--pictures`` wrote; the sheets are ``labels_<modality>.jpg`` in ``docs/pictures``. Images are cut
out around the label; an image without one is shown whole and dark, a cloud without one not at all.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Dict, List, Optional

import cv2
import numpy as np

from atom_calibration.modalities.lidar3d import cloud_picture
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.labels import Label, RangeLabel, RgbLabel
from atom_core.model.sensor import LIDAR3D, Sensor

FOLDER = Path(__file__).resolve().parent / "pictures"
WIDTH, HEIGHT = 232, 174  # of a tile [px]
COLUMNS = 8
LARGEST_BYTES = 380_000
_MARGIN, _LEAST_PX = 0.25, 60  # around a label, of its size
_LINE = 16


def main() -> None:
    """Write the sheets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", type=Path, required=True, metavar="DIR")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="DIR")
    args = parser.parse_args()
    dataset = read_dataset(args.dataset / "dataset.json")
    tiles: Dict[str, List[np.ndarray]] = {}
    for sensor in dataset.sensors.values():
        for key in dataset.collections:
            picture = _picture(dataset, sensor, key, args.dataset / "pictures")
            if picture is not None:
                made = _tile(dataset, sensor, key, picture)
                tiles.setdefault(sensor.modality, []).append(made)
    for modality, some in tiles.items():
        _write(args.output / f"labels_{modality}.jpg", _sheet(some))


def _picture(dataset: Dataset, sensor: Sensor, key: str, folder: Path) -> Optional[np.ndarray]:
    """Return what is shown of a sensor; None: nothing. A cloud without a board shows nothing."""
    if sensor.modality != LIDAR3D:
        return cv2.imread(str(folder / f"{key}_{sensor.name}.jpg"))
    label = dataset.collections[key].labels.get((sensor.name, next(iter(dataset.patterns))))
    if not isinstance(label, RangeLabel) or not label.detected:
        return None
    return cloud_picture(dataset.data.read(key, sensor.name), [label], HEIGHT - _LINE)


def _tile(dataset: Dataset, sensor: Sensor, key: str, picture: np.ndarray) -> np.ndarray:
    pattern = next(iter(dataset.patterns))
    label = dataset.collections[key].labels.get((sensor.name, pattern))
    detected = label is not None and label.detected
    caption = f"{key} {sensor.name}: " + (_count(label) if detected else "not detected")
    box = _box(label, sensor) if detected else None
    if box is not None:
        picture = picture[box[1] : box[3], box[0] : box[2]]
    tile = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    scale = min((HEIGHT - _LINE) / picture.shape[0], WIDTH / picture.shape[1])
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=way)
    small = small if detected else small // 2
    top, left = _LINE, (WIDTH - small.shape[1]) // 2
    tile[top : top + small.shape[0], left : left + small.shape[1]] = small[: HEIGHT - _LINE]
    white = (255, 255, 255)
    cv2.putText(tile, caption, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, white, 1, cv2.LINE_AA)
    return tile


def _count(label: Optional[Label]) -> str:
    if isinstance(label, RgbLabel):
        return f"{len(label.ids)} corners"
    assert isinstance(label, RangeLabel)
    return f"{len(label.indices)}, {len(label.limit_indices)} at border"


def _box(label: Optional[Label], sensor: Sensor) -> Optional[List[int]]:
    """Return left, top, right, bottom [px] around a label; None: the whole picture."""
    if sensor.modality == LIDAR3D or sensor.camera is None:
        return None
    if isinstance(label, RgbLabel):
        pixels = label.pixels
    else:
        assert isinstance(label, RangeLabel)
        row, column = np.divmod(label.limit_indices, sensor.camera.width)
        pixels = np.column_stack([column, row]).astype(float)
    if len(pixels) == 0:
        return None
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = np.maximum(_MARGIN * (high - low), _LEAST_PX)
    size = [sensor.camera.width, sensor.camera.height]
    left, top = np.maximum(low - margin, 0).astype(int)
    right, bottom = np.minimum(high + margin, size).astype(int)
    return [left, top, right, bottom]


def _sheet(tiles: List[np.ndarray]) -> np.ndarray:
    columns = min(COLUMNS, len(tiles))
    empty = np.zeros_like(tiles[0])
    padded = tiles + [empty] * (-len(tiles) % columns)
    rows = [np.hstack(padded[i : i + columns]) for i in range(0, len(padded), columns)]
    return np.vstack(rows)


def _write(path: Path, sheet: np.ndarray) -> None:
    for quality in range(90, 20, -5):
        _, data = cv2.imencode(".jpg", sheet, [cv2.IMWRITE_JPEG_QUALITY, quality])
        if data.nbytes <= LARGEST_BYTES:
            break
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.tobytes())


if __name__ == "__main__":
    main()
