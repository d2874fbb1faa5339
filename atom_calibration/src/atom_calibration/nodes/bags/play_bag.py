"""Plays a recording as `rosbag play` does; what it cannot open is refused in one sentence.

All options but --bag are those of `rosbag play`. A relative path begins where the user stands,
also with roslaunch, which starts nodes in another folder. With a refusal the launch ends, too: its
other nodes would wait for ever.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import List, NoReturn, Sequence

import roslib.packages

from atom_calibration.runtime import running
from atom_calibration.sources.bag_parts import bag_files
from atom_core.commands.common import add_option
from atom_core.commands.option_parser import OptionParser
from atom_core.errors import ConfigError
from atom_core.io.paths import looked_for, unread

_NAME = "play_bag"


def main() -> int:
    """Become `rosbag play`; return the exit code of a refusal."""
    args, others = _parser().parse_known_args(running.arguments())
    code = running.guarded(_NAME, lambda: play(args.bag, others))
    running.give_up_launch()
    return code


def play(bag: str, others: Sequence[str]) -> NoReturn:
    """Become `rosbag play`.

    Args:
        bag: the recording, or a pattern of its files; empty where none is given.
        others: further options of `rosbag play`.

    Raises:
        ConfigError: there is no such file, or no `rosbag play`.
    """
    paths = readable_bags(bag)
    players = roslib.packages.find_node("rosbag", "play")
    if not players:
        raise ConfigError("`rosbag play` is not found; install the ROS package rosbag")
    remapped = [word for word in sys.argv[1:] if ":=" in word]
    words: List[str] = [str(players[0]), *others, *map(str, paths), *remapped]
    os.execv(words[0], words)


def readable_bags(bag: str) -> List[Path]:
    """Return the files of a recording, which can be opened.

    Raises:
        ConfigError: none is given, or one is not there.
    """
    if not bag:
        raise ConfigError(
            "no recording: bag_file of the configuration is empty; give bag_file:=FILE"
        )
    return [_readable(path) for path in bag_files([Path(bag)])]


def _readable(path: Path) -> Path:
    if not path.exists():
        raise ConfigError(f"{path}: no such recording{looked_for(path)}; correct the path")
    if path.is_dir():
        raise ConfigError(f"{path}: a folder; give the .bag file in it")
    try:
        with path.open("rb"):
            return path.absolute()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({unread(path, error)})") from error


def _parser() -> argparse.ArgumentParser:
    parser = OptionParser(
        prog=_NAME,
        description=__doc__,
        others_pass=True,
        allow_abbrev=False,
        epilog="example: rosrun atom_calibration play_bag --clock --bag train.bag",
    )
    add_option(parser, "bag", required=True, metavar="FILE", help="the recording")
    return parser
