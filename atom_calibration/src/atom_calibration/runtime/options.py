"""What several nodes can be told on the command line, and what follows from it."""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from typing import Optional

from atom_core.commands.common import add_option
from atom_core.errors import ConfigError, OutputError
from atom_core.io.config_yaml import read_config
from atom_core.io.paths import sibling
from atom_core.model.config import CalibrationConfig

_CORRECTED = "dataset_corrected.json"


def positive(text: str) -> float:
    """Return a number above 0 of the command line."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is no number above 0")
    return value


def add_config_option(parser: argparse.ArgumentParser) -> None:
    """Add the option that names the calibration's configuration."""
    add_option(
        parser,
        "config",
        "-cfg",
        "--config_file",
        required=True,
        type=config_path,
        metavar="FILE",
        help="the calibration's config.yml",
    )


def config_path(text: str) -> Path:
    """Return the path of a configuration; launch files give an empty one if they have none."""
    if not text:
        raise argparse.ArgumentTypeError("no configuration; say config:=FILE")
    return Path(text)


def add_labeling_options(parser: argparse.ArgumentParser) -> None:
    """Add what one labeler, and the program that starts them all, can be told."""
    add_option(
        parser,
        "automatic_seeds",
        choices=("on", "off"),
        default="on",
        help="predict seeds from the cameras and search the board (default: on)",
    )
    add_option(parser, "seeds", type=optional_path, metavar="FILE", help="seeds given by hand")
    add_option(
        parser,
        "rate",
        type=positive,
        default=5.0,
        metavar="HZ",
        help="most labels a second and sensor (default: 5)",
    )
    add_receive_time_option(parser)
    add_all_messages_option(parser)


def add_all_messages_option(parser: argparse.ArgumentParser) -> None:
    """Add that nothing is passed over; collectors and labelers must be told the same."""
    add_option(
        parser,
        "all_messages",
        action="store_true",
        help="pass over no data when labels take longer than the next data need to come: for a "
        "recording, which start_bag makes wait (default: the newest data count)",
    )


def add_receive_time_option(parser: argparse.ArgumentParser) -> None:
    """Add which sensors' stamps are not used; collectors and labelers must be told the same."""
    add_option(
        parser,
        "use_receive_time",
        nargs="+",
        default=(),
        metavar="SENSOR",
        help="of these sensors the time of receipt is taken instead of the stamps",
    )


def optional_path(text: str) -> Optional[Path]:
    """Return None for the empty text that a launch file passes for what is not given."""
    return Path(text) if text else None


def add_marker_scale_option(parser: argparse.ArgumentParser) -> None:
    """Add the size of markers that are dragged."""
    add_option(
        parser,
        "marker_scale",
        "-s",
        type=positive,
        default=0.6,
        metavar="M",
        help="size of the markers in metres (default: 0.6)",
    )


def add_marker_size_option(parser: argparse.ArgumentParser, size_m: float) -> None:
    """Add the size of the sphere with the menu."""
    add_option(
        parser,
        "marker_size",
        "-s",
        type=positive,
        default=size_m,
        metavar="M",
        help=f"size of the sphere with the menu [m] (default: {size_m:g})",
    )


def add_corrected_options(parser: argparse.ArgumentParser) -> None:
    """Add where a corrected dataset is saved; see `corrected_file`."""
    add_option(
        parser,
        "output",
        "-o",
        type=Path,
        metavar="FILE",
        help=f"what is saved (default: {_CORRECTED} beside the dataset)",
    )
    add_option(parser, "overwrite", "-ow", action="store_true", help="replace an existing file")


def corrected_file(args: argparse.Namespace) -> Path:
    """Return where a corrected dataset is saved, an absolute path.

    Raises:
        OutputError: the file is there, and may not be replaced.
    """
    output = Path(os.path.abspath(args.output or sibling(args.dataset, _CORRECTED)))
    if output.exists() and not args.overwrite:
        raise OutputError(
            f"{output}: exists already; add --overwrite to replace it, or go on with it by "
            f"--dataset {output} --overwrite"
        )
    return output


def config_of_sensor(path: Path, name: str) -> CalibrationConfig:
    """Read a configuration and leave only one of its sensors in it.

    Raises:
        ConfigError: it cannot be read, or has no such sensor.
    """
    config = read_config(path)
    if name not in config.sensors:
        raise ConfigError(
            f"{path}: there is no sensor '{name}'; use one of {', '.join(config.sensors)}"
        )
    return replace(config, sensors={name: config.sensors[name]}, anchored_sensor=None)
