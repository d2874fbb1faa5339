"""Starts one labeler for each sensor of a configuration, each a node and a process of its own."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from typing import Dict, List, Sequence

import roslib.packages
import rospy

from atom_calibration.errors import CollectionError
from atom_calibration.modalities.table import is_labeled
from atom_calibration.runtime import options, running
from atom_calibration.runtime.graph_names import check_graph_names, labeler_of
from atom_calibration.sources.sensor_modality import modality_of_sensor
from atom_core.commands.option_parser import OptionParser
from atom_core.io.config_yaml import read_config

_END_WITHIN_S, _ASK_EVERY_S = 8.0, 1.0
_POLL_S = 0.1


def main() -> int:
    """Run until the node is asked to end; return the exit code."""
    return running.run("labelers", _parser(), _run)


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config)
    check_graph_names(config.sensors)
    running.start("labelers")
    labelers = _Labelers()
    try:
        for name, entry in config.sensors.items():
            modality = modality_of_sensor(name, entry, running.stopped, rospy.logwarn)
            if running.stopped():
                break
            if is_labeled(modality):
                labelers.start(name, f"{modality}_labeler", _words(name, args))
            else:
                rospy.logwarn(f"sensor '{name}' ({modality}) is left out: it is not labeled")
        while not running.stopped():
            labelers.tell_deaths()
            running.pause(_POLL_S)
    finally:
        labelers.end()
    return 0


class _Labelers:
    """The processes that were started."""

    def __init__(self) -> None:
        self._running: Dict[str, subprocess.Popen] = {}  # by the node's name

    def start(self, sensor: str, program: str, words: Sequence[str]) -> None:
        """Start the labeler of a sensor.

        Raises:
            CollectionError: the program is not there.
        """
        places = roslib.packages.find_node("atom_calibration", program)
        if not places:
            raise CollectionError(f"{program} is not found; is the workspace built and sourced?")
        node = labeler_of(sensor)
        # A session of its own: a Ctrl-C reaches it through `end` only, when it is told once.
        command = [places[0], *words, *running.remappings(), f"__name:={node}"]
        process = subprocess.Popen(command, start_new_session=True)
        self._running[node] = process
        number = len(self._running)
        sys.stdout.write(f"process[{node}-{number}]: started with pid [{process.pid}]\n")
        sys.stdout.flush()

    def tell_deaths(self) -> None:
        """Say which ended though nobody asked for it."""
        for node, process in list(self._running.items()):
            if process.poll() is not None:
                del self._running[node]
                rospy.logerr(f"{node} has ended with exit code {process.returncode}")

    def end(self) -> None:
        """Ask all to end, more than once: one that only begins to run may not hear it."""
        patience_end_s = time.monotonic() + _END_WITHIN_S
        while self._left() and time.monotonic() < patience_end_s:
            for process in self._left():
                process.terminate()
            asked_s = time.monotonic()
            while self._left() and time.monotonic() < asked_s + _ASK_EVERY_S:
                time.sleep(_POLL_S)
        for process in self._left():
            process.kill()
            process.wait()

    def _left(self) -> List[subprocess.Popen]:
        return [process for process in self._running.values() if process.poll() is None]


def _words(name: str, args: argparse.Namespace) -> List[str]:
    words = ["--config", str(args.config), "--sensor", name, "--rate", str(args.rate)]
    words += ["--automatic_seeds", args.automatic_seeds]
    words += ["--seeds", str(args.seeds)] if args.seeds else []
    words += ["--all_messages"] if args.all_messages else []
    received = list(args.use_receive_time)
    return words + (["--use_receive_time", *received] if received else [])


def _parser() -> argparse.ArgumentParser:
    parser = OptionParser(
        prog="labelers",
        description=__doc__,
        epilog="example: rosrun atom_calibration labelers -cfg config.yml",
    )
    options.add_config_option(parser)
    options.add_labeling_options(parser)
    return parser
