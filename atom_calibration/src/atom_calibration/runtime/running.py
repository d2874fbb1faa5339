"""How every node starts and ends: arguments, signals, exit codes."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Callable, List, Optional, Tuple

import rospy

from atom_calibration.runtime.master_watch import GONE, MasterWatch
from atom_core.commands.common import add_option
from atom_core.errors import AtomError, ConfigError
from atom_core.io.config_yaml import read_config
from atom_core.model.config import CalibrationConfig

UNACCEPTABLE, BAD_INPUT = 1, 2
_stop = threading.Event()
_watches: List[MasterWatch] = []


def stopped() -> bool:
    """Tell whether the node was asked to end, by a signal or by the master."""
    return _stop.is_set() or rospy.is_shutdown()


def pause(seconds: float) -> None:
    """Wait, but no longer than until the node is asked to end."""
    _stop.wait(seconds)


def wait() -> int:
    """Let callbacks do the work until the node is asked to end; return the exit code 0."""
    while not _stop.wait(0.1) and not rospy.is_shutdown():
        pass
    return 0


def start(name: str) -> None:
    """Become a node; SIGINT and SIGTERM then only ask it to end, so that it can finish its work.

    Raises:
        ConfigError: there is no master.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: _stop.set())
    pid = check_master()
    try:
        rospy.init_node(name, disable_signals=True)
    except rospy.ROSInitException:
        if _master_pid() is not None:
            raise
        raise ConfigError(GONE) from None
    _watches[:] = [MasterWatch(pid, _stop, _stop.set)]


def lost() -> str:
    """Return what happened to the master while the node ran, in a sentence; empty: nothing."""
    return next((watch.problem for watch in _watches), "")


def check_master() -> int:
    """Return the process id of the master.

    Raises:
        ConfigError: there is none.
    """
    pid = _master_pid()
    if pid is None:
        raise ConfigError("no ROS master answers; start one with roscore, or use roslaunch")
    return pid


def _master_pid() -> Optional[int]:
    try:
        return int(rospy.get_master().getPid()[2])
    except OSError:
        return None


def guarded(name: str, run: Callable[[], int]) -> int:
    """Run a node; return its exit code. A refusal is one line, and so is the loss of the master."""
    try:
        code, text = _outcome(run)
        if text:
            sys.stderr.write(f"{name}: {text}\n")
        return code
    finally:
        rospy.signal_shutdown("done")


def _outcome(run: Callable[[], int]) -> Tuple[int, str]:
    """Run a node; return its exit code and what has to be said."""
    try:
        code = run()
    except AtomError as error:
        return BAD_INPUT, lost() or str(error)
    except OSError:
        if not _watches or _master_pid() is not None:
            raise
        return UNACCEPTABLE, GONE
    return (max(code, UNACCEPTABLE), lost()) if lost() else (code, "")


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
        type=Path,
        metavar="FILE",
        help="the calibration's config.yml",
    )


def add_labeling_options(parser: argparse.ArgumentParser) -> None:
    """Add what one labeler, and the program that starts them all, can be told."""
    add_option(
        parser,
        "automatic_seeds",
        choices=("on", "off"),
        default="on",
        help="predict seeds from the cameras and search the board (default: on)",
    )
    add_option(parser, "seeds", type=_optional_path, metavar="FILE", help="seeds given by hand")
    add_option(
        parser,
        "rate",
        type=positive,
        default=5.0,
        metavar="HZ",
        help="most labels a second and sensor (default: 5)",
    )


def _optional_path(text: str) -> Optional[Path]:
    return Path(text) if text else None


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
