"""Draw the border of a board in the images of a camera or depth camera, for evaluations."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Tuple

import numpy as np

from atom_core import opencv as cv2
from atom_core.commands import annotation_window, common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.editing.border_annotation import HELP, Outcome
from atom_core.editing.border_drawing import BorderDrawing, keys_with_image
from atom_core.errors import DatasetError
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names

EXAMPLE = (
    "python3 -m atom_core annotate_pattern_borders_in_rgb_or_depth -d data/dataset.json -cs rgb_1"
)
_FAR_M = 5.0  # shown white in a depth image
_NOT_HERE = (AtomOption("si", "show_images", remark="the images are shown as it is"),)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = common.add_option
    names = ("-d", "--dataset_file", "-json", "--json_file")
    add(parser, "dataset", *names, required=True, type=Path, metavar="FILE", help="the dataset")
    for name, short in (("rgb_sensor", "-cs"),):
        text = "the camera or depth camera"
        add(parser, name, short, required=True, metavar="SENSOR", help=text)
    text = "the board; needed where the dataset has several"
    add(parser, "pattern", "-p", metavar="PATTERN", help=text)
    for name, short, kind, default, what in (
        ("point_size", "-ps", int, 10, "size of the drawn points [px]"),
        ("window_width", "-ww", int, 1200, "width of the window [px]"),
        ("points_per_pixel", "-ppp", float, 1.0, "how densely lines are sampled for ATOM"),
    ):
        text = f"{what} (default: {default})"
        add(parser, name, short, type=kind, default=default, metavar="N", help=text)
    add(parser, "collection_selection_function", "-csf", nargs="+", metavar="S", help="only these")
    add_meaningless_options(parser, _NOT_HERE)


def run(args: argparse.Namespace) -> int:
    """Open the window; what is drawn is saved beside the dataset."""
    task = Task(args)
    annotation_window.need_screen()
    return annotation_window.run(_Drawing(task, args.window_width), HELP)


class Task:
    """What is drawn on and where it is saved; no window is needed.

    Attributes:
        annotation: the points, and what keys do to them.
        path: the file.
    """

    def __init__(self, args: argparse.Namespace):
        """Read the dataset and what was drawn before.

        Raises:
            DatasetError: the sensor or the pattern is not in it, or has no image.
        """
        self._dataset, self._sensor = read_dataset(args.dataset), args.rgb_sensor
        self._check(args)
        keys = select_names(
            list(self._dataset.collections), args.collection_selection_function, "collection"
        )
        there = keys_with_image(self._dataset, self._sensor)
        keys = [key for key in keys if key in there]
        if not keys:
            raise DatasetError(f"{args.dataset}: '{self._sensor}' has no image in any collection")
        pattern = args.pattern or next(iter(self._dataset.patterns))
        self._drawing = BorderDrawing(
            self._dataset, self._sensor, pattern, keys, args.point_size, args.points_per_pixel
        )
        self.annotation, self.path = self._drawing.annotation, self._drawing.path

    def _check(self, args: argparse.Namespace) -> None:
        """Refuse names that are not there."""
        dataset: Dataset = self._dataset
        there = [n for n, s in dataset.sensors.items() if s.camera is not None]
        if self._sensor not in there:
            raise DatasetError(
                f"{args.dataset}: there is no camera or depth camera '{self._sensor}'; there are: "
                f"{', '.join(there) or '-'}"
            )
        several = len(dataset.patterns) > 1
        if (several and not args.pattern) or args.pattern not in (None, *dataset.patterns):
            raise DatasetError(
                f"{args.dataset}: name the board with --pattern: {', '.join(dataset.patterns)}"
            )

    def image(self, key: str) -> np.ndarray:
        """Return the picture (height, width, 3) of a collection; depths up to 5 m in grey."""
        data = self._dataset.data.read(key, self._sensor)
        if data.ndim == 2:  # depths
            grey = np.nan_to_num(np.clip(data / _FAR_M, 0.0, 1.0) * 255.0).astype(np.uint8)
            return np.repeat(grey[:, :, None], 3, axis=2)
        return np.ascontiguousarray(data)

    def save(self) -> None:
        """Write the file."""
        self._drawing.save()


def picture(task: Task, width: int) -> Tuple[np.ndarray, float]:
    """Return what the window shows, (height, width, 3), and its scale to the image."""
    image = task.image(task.annotation.collection)
    scale = width / image.shape[1]
    size = (width, int(round(image.shape[0] * scale)))
    shown = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    task.annotation.draw(shown, scale)
    return shown, scale


class _Drawing:
    """The border that is drawn, for the window."""

    def __init__(self, task: Task, width: int):
        self._task, self._width, self._scale = task, width, 1.0

    @property
    def title(self) -> str:
        return self._task.annotation.title

    def picture(self) -> np.ndarray:
        shown, self._scale = picture(self._task, self._width)
        return shown

    def click(self, at: Tuple[int, int]) -> None:
        self._task.annotation.click(at[0] / self._scale, at[1] / self._scale)

    def right_click(self) -> None:
        """Do nothing."""

    def press(self, key: str) -> Outcome:
        return self._task.annotation.press(key)

    def save(self) -> str:
        self._task.save()
        return str(self._task.path)
