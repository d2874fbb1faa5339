"""Bring a dataset into another format; for Kalibr as a bag."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Optional, Sequence

import rospy
from sensor_msgs.msg import Image

from atom_calibration.runtime import running
from atom_calibration.sources.bag_writer import new_bag
from atom_core.cli import build_parser
from atom_core.commands import common, convert
from atom_core.io.atomic import prepare_output_folder, write_text_atomically
from atom_core.io.kalibr_export import TARGET_FILE, Frame, KalibrExport, target_text

_NS_PER_S = 1_000_000_000


def main(words: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    given = running.arguments() if words is None else list(words)
    args = build_parser("convert").parse_args(["convert", *given])
    return running.guarded("convert", lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    if args.target_format != convert.KALIBR:
        return convert.run(args)
    convert.refuse_what_does_not_fit(args)
    common.refuse_occupied(args.output, args.overwrite)
    export = convert.chosen_export(args)
    folder = prepare_output_folder(args.output, args.overwrite)
    write_text_atomically(folder / TARGET_FILE, target_text(export.pattern))
    count = write_images_bag(export, folder / convert.BAG_FILE)
    cameras = ", ".join(export.cameras)
    sys.stdout.write(f"{folder.resolve()}: {TARGET_FILE}, {convert.BAG_FILE}: ")
    sys.stdout.write(f"{count} images of {cameras}\n")
    sys.stdout.write(convert.kalibr_lines(export, folder, export.topics) + "\n")
    return 0


def write_images_bag(export: KalibrExport, path: Path) -> int:
    """Write grey images, those of a collection with one stamp; return their number.

    Raises:
        DatasetError: a data file is absent or damaged.
        OutputError: the bag cannot be written; nothing is left of it.
    """
    count = 0
    with new_bag(path) as bag:
        for frame in export.frames():
            message = _message(frame, export)
            bag.write(export.topics[frame.number], message, message.header.stamp)
            count += 1
    return count


def _message(frame: Frame, export: KalibrExport) -> Image:
    message = Image(encoding="mono8", height=frame.grey.shape[0], width=frame.grey.shape[1])
    message.step, message.data = frame.grey.shape[1], frame.grey.tobytes()
    message.header.stamp = rospy.Time(*divmod(frame.stamp_ns, _NS_PER_S))
    message.header.frame_id = export.dataset.sensors[export.cameras[frame.number]].frame
    return message
