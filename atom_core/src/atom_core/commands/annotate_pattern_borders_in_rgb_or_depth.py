"""Draw the border of a board in the images of a camera or depth camera, for evaluations."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any, Callable, Tuple

import cv2
import numpy as np

from atom_core.commands import common
from atom_core.commands.atom_options import AtomOption, add_meaningless_options
from atom_core.editing.border_annotation import HELP, BorderAnnotation
from atom_core.errors import DatasetError
from atom_core.io.annotations import SIDES, annotation_path, read_lines, write_annotations
from atom_core.io.dataset_json import read_dataset
from atom_core.model.dataset import Dataset
from atom_core.model.selection import select_names

EXAMPLE = (
    "python3 -m atom_core annotate_pattern_borders_in_rgb_or_depth -d data/dataset.json -cs rgb_1"
)
_WINDOW = "border of the board"
_COLOURS = dict(zip(SIDES, ((0, 0, 255), (0, 200, 0), (255, 0, 0), (0, 220, 255))))
_FAR_M = 5.0  # shown white in a depth image
_WAIT_MS = 50
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
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise DatasetError(
            "there is no screen to draw on (DISPLAY is not set); run this where windows can open"
        )
    return Window(task, args.window_width).run()


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
        several = self._check(args)
        keys = select_names(
            list(self._dataset.collections), args.collection_selection_function, "collection"
        )
        keys = [key for key in keys if self._dataset.data.has_data(key, self._sensor)]
        if not keys:
            raise DatasetError(f"{args.dataset}: '{self._sensor}' has no image in any collection")
        self.path = annotation_path(args.dataset.parent, self._sensor)
        self._pattern = args.pattern or next(iter(self._dataset.patterns))
        lines = read_lines(self.path, self._dataset.patterns, self._pattern)
        self.annotation = BorderAnnotation(keys, lines, args.point_size)
        self._options = {
            "points_per_pixel": args.points_per_pixel,
            "pattern": self._pattern if several else "",
        }

    def _check(self, args: argparse.Namespace) -> bool:
        """Refuse names that are not there; tell whether there are several patterns."""
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
        return several

    def image(self, key: str) -> np.ndarray:
        """Return the picture (height, width, 3) of a collection; depths up to 5 m in grey."""
        data = self._dataset.data.read(key, self._sensor)
        if data.ndim == 2:  # depths
            grey = np.nan_to_num(np.clip(data / _FAR_M, 0.0, 1.0) * 255.0).astype(np.uint8)
            return np.repeat(grey[:, :, None], 3, axis=2)
        return np.ascontiguousarray(data)

    def save(self) -> None:
        """Write the file."""
        write_annotations(self.path, self.annotation.lines, **self._options)


def picture(task: Task, width: int) -> Tuple[np.ndarray, float]:
    """Return what the window shows, (height, width, 3), and its scale to the image."""
    image = task.image(task.annotation.collection)
    scale = width / image.shape[1]
    size = (width, int(round(image.shape[0] * scale)))
    shown = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    drawn = task.annotation.lines[task.annotation.collection]
    for side, points in drawn.items():
        pixels = [(int(round(x * scale)), int(round(y * scale))) for x, y in points]
        for begin, end in zip(pixels, pixels[1:]):
            cv2.line(shown, begin, end, _COLOURS[side], 1, cv2.LINE_AA)
        marker = cv2.MARKER_CROSS if SIDES.index(side) % 2 else cv2.MARKER_SQUARE
        for at in pixels:
            cv2.drawMarker(shown, at, _COLOURS[side], marker, task.annotation.point_size, 2)
    return shown, scale


class Window:
    """An OpenCV window in which a border is drawn."""

    def __init__(self, task: Task, width: int):
        """Remember what is drawn on."""
        self._task, self._width, self._scale = task, width, 1.0

    def run(self) -> int:
        """Open it; return when the user ends it or closes it.

        Raises:
            DatasetError: this OpenCV has no windows.
        """
        try:
            cv2.namedWindow(_WINDOW, cv2.WINDOW_AUTOSIZE)
        except cv2.error:
            raise DatasetError(
                "this OpenCV was built without windows; use the system's (python3-opencv)"
            ) from None
        cv2.setMouseCallback(_WINDOW, self._mouse())
        print("\n".join(HELP))
        self._redraw()
        while cv2.getWindowProperty(_WINDOW, cv2.WND_PROP_VISIBLE) >= 1:
            code = cv2.waitKey(_WAIT_MS)
            if code < 0:
                continue
            outcome = self._task.annotation.press(chr(code & 0xFF))
            if outcome.save:
                self._task.save()
            if outcome.help:
                print("\n".join(HELP))
            if outcome.end:
                said = f"{self._task.path}" if outcome.save else "ended without saving"
                print(said, file=sys.stdout)
                break
            self._redraw()
        cv2.destroyAllWindows()
        return 0

    def _redraw(self) -> None:
        shown, self._scale = picture(self._task, self._width)
        cv2.imshow(_WINDOW, shown)
        cv2.setWindowTitle(_WINDOW, self._task.annotation.title)

    def _mouse(self) -> Callable[..., None]:
        def handle(event: int, x: int, y: int, *_: Any) -> None:
            if event == cv2.EVENT_LBUTTONDOWN:
                self._task.annotation.click(x / self._scale, y / self._scale)
                self._redraw()

        return handle
