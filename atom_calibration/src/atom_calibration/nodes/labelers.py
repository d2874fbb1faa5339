"""Starts one labeler for each sensor of a configuration, each a node and a process of its own."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Optional, Sequence

import roslaunch
import rospy

from atom_calibration.nodes import running
from atom_calibration.nodes.modality import modality_of_sensor
from atom_core.io.config_yaml import read_config
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB

_LABELED = (RGB, DEPTH, LIDAR3D)


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run until the node is asked to end; return the exit code."""
    args = _parser().parse_args(rospy.myargv(sys.argv)[1:] if argv is None else argv)
    return running.guarded("labelers", lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    config = read_config(args.config)
    launcher = roslaunch.scriptapi.ROSLaunch()  # has signal handlers of its own: before ours
    running.start("labelers")
    launcher.start()
    try:
        for name, entry in config.sensors.items():
            if running.stopped():
                break
            modality = modality_of_sensor(name, entry, running.stopped, rospy.logwarn)
            if modality in _LABELED:
                launcher.launch(_node(name, modality, args))
            elif modality is not None:
                rospy.logwarn(f"sensor '{name}' ({modality}) is left out: it is not labelled")
        while not running.stopped():
            time.sleep(0.1)
    finally:
        launcher.stop()
    return 0


def _node(name: str, modality: str, args: argparse.Namespace) -> roslaunch.core.Node:
    words = f"--config '{args.config}' --sensor '{name}' --automatic_seeds {args.automatic_seeds}"
    words += f" --rate {args.rate}" + (f" --seeds '{args.seeds}'" if args.seeds else "")
    return roslaunch.core.Node(
        "atom_calibration", f"{modality}_labeler", name=f"{name}_labeler", args=words,
        output="screen",
    )  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="labelers",
        description=__doc__,
        epilog="example: rosrun atom_calibration labelers -cfg config.yml",
    )
    running.add_config_option(parser)
    running.add_labelling_options(parser)
    return parser
