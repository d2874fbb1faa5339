"""Pick the border of a board in the clouds of a LiDAR, for baselines that need its corners."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Dict, Sequence, Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.commands import annotation_window, common
from atom_core.editing.border_annotation import Outcome
from atom_core.editing.picked_border import HELP, Face, PickedBorder
from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.geometry.plane import plane_as_seen
from atom_core.io.annotations import SIDES, annotation_path
from atom_core.io.dataset_json import read_dataset
from atom_core.io.lidar_annotations import line_through, read_picked_sides, write_picked_sides
from atom_core.model.dataset import Dataset, range_points
from atom_core.model.labels import DetectionKey
from atom_core.model.selection import select_names
from atom_core.model.sensor import LIDAR3D

EXAMPLE = (
    "python3 -m atom_core annotate_pattern_borders_in_lidar -d data/dataset.json -s lidar_1 "
    "-p pattern_1"
)
_AROUND_M, _OFF_PLANE_M = 0.15, 0.06  # of the label: what can be picked beyond it
_GREY, _LABEL = (150, 150, 150), (20, 200, 100)
_COLOURS = dict(zip(SIDES, ((0, 0, 255), (0, 200, 0), (255, 0, 0), (0, 220, 255))))
_MARGIN_PX = 20
_HEIGHT = 0.6  # of the window's width, at most: screens are wide


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    names = ("-d", "--dataset_file", "-json", "--json_file")
    add(parser, "dataset", *names, required=True, type=Path, metavar="FILE", help="the dataset")
    for name, short, what in (("sensor", "-s", "the LiDAR"), ("pattern", "-p", "the board")):
        add(parser, name, short, required=True, metavar="NAME", help=what)
    for name, short, default, what in (
        ("point_size", "-ps", 3, "size of the drawn points [px]"),
        ("window_width", "-ww", 1200, "width of the window [px]"),
    ):
        text = f"{what} (default: {default})"
        add(parser, name, short, type=int, default=default, metavar="N", help=text)
    add(parser, "collection_selection_function", "-csf", nargs="+", metavar="S", help="only these")


def run(args: argparse.Namespace) -> int:
    """Open the window; what is picked is saved beside the dataset."""
    picking = Picking(args)
    annotation_window.need_screen()
    return annotation_window.run(picking, HELP)


class Picking:
    """What is picked from and where it is saved, for the window; none is needed.

    Attributes:
        border: the points, and what keys do to them.
    """

    def __init__(self, args: argparse.Namespace):
        """Read the dataset and what was picked before.

        Raises:
            DatasetError: the sensor or the pattern is not in it, or no cloud has a label.
        """
        dataset = read_dataset(args.dataset)
        there = [n for n, s in dataset.sensors.items() if s.modality == LIDAR3D]
        for name, names, what in (
            (args.sensor, there, "3D LiDAR"),
            (args.pattern, list(dataset.patterns), "pattern"),
        ):
            if name not in names:
                raise DatasetError(
                    f"{args.dataset}: there is no {what} '{name}'; there are: "
                    f"{', '.join(names) or '-'}"
                )
        keys = select_names(
            list(dataset.collections), args.collection_selection_function, "collection"
        )
        faces = _faces(dataset, args.sensor, args.pattern, keys)
        if not faces:
            raise DatasetError(
                f"{args.dataset}: '{args.sensor}' has no label of '{args.pattern}', whose plane is "
                f"needed; label the board first"
            )
        self._path = annotation_path(args.dataset.parent, args.sensor)
        self._labeled = {key: labeled for key, (_, labeled) in faces.items()}
        planes = {key: face for key, (face, _) in faces.items()}
        before = read_picked_sides(self._path)
        self.border = PickedBorder(planes, before, args.point_size)
        self._width = args.window_width

    @property
    def title(self) -> str:
        """What the window is called."""
        return self.border.title

    def picture(self) -> np.ndarray:
        """Return the board from the front, as the LiDAR sees it, (height, width, 3)."""
        border = self.border
        low, scale, size = self._frame()
        shown = np.full((size[1], size[0], 3), 25, np.uint8)
        labeled = self._labeled[border.collection]
        for point, is_label in zip(self._pixels(border.face.points, low, scale), labeled):
            colour = _LABEL if is_label else _GREY
            cv2.circle(shown, tuple(point), border.point_size, colour, -1, cv2.LINE_AA)
        for side, points in border.picked.items():
            for point in self._pixels(np.array(points).reshape(-1, 2), low, scale):
                radius = border.point_size + 3
                cv2.circle(shown, tuple(point), radius, _COLOURS[side], 2, cv2.LINE_AA)
            line = line_through(points)
            if line is not None:
                ends = np.array([line.middle - line.direction, line.middle + line.direction])
                begin, end = self._pixels(ends, low, scale)
                cv2.line(shown, tuple(begin), tuple(end), _COLOURS[side], 1, cv2.LINE_AA)
        return shown

    def click(self, at: Tuple[int, int]) -> None:
        """Pick the point nearest to a pixel."""
        low, scale, _ = self._frame()
        x, y = (np.array(at) - _MARGIN_PX) / scale + low
        self.border.click(x, y)

    def right_click(self) -> None:
        """Give the last point back."""
        self.border.undo()

    def press(self, key: str) -> Outcome:
        """Do what a key does."""
        return self.border.press(key)

    def save(self) -> str:
        """Write the file; return its name."""
        write_picked_sides(self._path, self.border.result)
        return str(self._path)

    def _frame(self) -> Tuple[np.ndarray, float, Tuple[int, int]]:
        """Return the lowest point (2,) [m], the scale [px/m], and the picture's size [px]."""
        points = self.border.face.points
        low, extent = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 0.05)
        most = np.array([self._width, _HEIGHT * self._width]) - 2 * _MARGIN_PX
        scale = float(np.min(most / extent))
        width, height = (int(np.ceil(scale * e)) + 2 * _MARGIN_PX for e in extent)
        return low, scale, (width, height)

    @staticmethod
    def _pixels(points: np.ndarray, low: np.ndarray, scale: float) -> np.ndarray:
        pixels: np.ndarray = np.round((points - low) * scale).astype(int) + _MARGIN_PX
        return pixels


def _faces(
    dataset: Dataset, sensor: str, pattern: str, keys: Sequence[str]
) -> Dict[str, Tuple[Face, np.ndarray]]:
    """Return by collection what can be picked, and which of it is labeled (n,)."""
    found = {}
    for key in keys:
        label = dataset.collections[key].labels.get((sensor, pattern))
        if label is None or not label.detected or not dataset.data.has_data(key, sensor):
            continue
        points = range_points(dataset, DetectionKey(key, sensor, pattern))
        if len(points.inside) < 3:
            continue
        frame = plane_as_seen(points.inside)
        cloud = dataset.data.read(key, sensor).reshape(-1, 3)
        labeled = np.zeros(len(cloud), dtype=bool)
        labeled[points.inside_indices] = True
        is_there = np.all(np.isfinite(cloud), axis=1)
        cloud, labeled = cloud[is_there], labeled[is_there]
        inside = se3.apply(se3.inverse(frame), cloud)
        reach = _AROUND_M + np.max(np.linalg.norm(inside[labeled][:, :2], axis=1))
        near = np.hypot(inside[:, 0], inside[:, 1]) < reach
        near &= np.abs(inside[:, 2]) < _OFF_PLANE_M
        near |= labeled
        found[key] = Face(frame, inside[near, :2]), labeled[near]
    return found
