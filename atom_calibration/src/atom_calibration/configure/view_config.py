"""Say what a configuration calibrates; nothing is written."""

from __future__ import annotations

import argparse
import sys
from typing import List, Optional, Sequence

from atom_calibration.configure.check import Findings
from atom_calibration.configure.configure_package import CheckedRig, checked_rig
from atom_calibration.configure.package import find_package
from atom_core.cli import BAD_INPUT, guarded
from atom_core.commands.atom_options import CONFIGURE_CALIBRATION_PKG, add_meaningless_options
from atom_core.commands.common import add_option, named_path
from atom_core.commands.option_parser import OptionParser
from atom_core.io.config_yaml import read_config_with_places
from atom_core.report.tables import text_table

EXAMPLE = "rosrun atom_calibration view_calibration_config -n my_robot_calibration"
_NAME = "view_calibration_config"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run the command; return its exit code."""
    args = parser().parse_args(argv)
    return guarded(_NAME, lambda: _run(args))


def _run(args: argparse.Namespace) -> int:
    package = find_package(args.name, args.config_file)
    config, locate = read_config_with_places(package.config_file)
    findings = Findings(locate, [], list(config.warnings))
    rig = checked_rig(config, package, args.bag, findings)
    for line in [f"warning: {warning}" for warning in findings.warnings] + findings.problems:
        sys.stderr.write(f"{_NAME}: {line}\n")
    if rig is None:
        return BAD_INPUT
    sys.stdout.write("\n\n".join([f"{package.config_file}", *tables(rig)]) + "\n")
    return 0


def tables(rig: CheckedRig) -> List[str]:
    """Return what is calibrated with what, as text."""
    config = rig.config
    held = config.anchored_sensor
    found = [
        text_table(
            ["sensor", "modality", "topic", "estimated", "chain"],
            [
                [
                    name,
                    sensor.modality,
                    sensor.topic_name,
                    f"{sensor.edge}{' (held)' if name == held else ''}",
                    _chain(rig, sensor.link),
                ]
                for name, sensor in config.sensors.items()
            ],
            "Sensors",
        )
    ]
    rows = [
        [name, p.pattern_type, f"{p.dimension[0]} x {p.dimension[1]}", p.parent_link, p.fixed]
        for name, p in config.calibration_patterns.items()
    ]
    headers = ["pattern", "type", "corners", "parent", "fixed"]
    found.append(text_table(headers, rows, "Patterns"))
    if config.additional_tfs:
        more = [[name, str(entry.edge)] for name, entry in config.additional_tfs.items()]
        found.append(text_table(["additional tf", "estimated"], more, "Additional transforms"))
    if config.joints:
        joints = [[name, ", ".join(j.params_to_calibrate)] for name, j in config.joints.items()]
        found.append(text_table(["joint", "estimated"], joints, "Joints"))
    return found


def _chain(rig: CheckedRig, frame: str) -> str:
    edges = rig.tree.chain(rig.config.world_link, frame) or []
    return " > ".join([rig.config.world_link, *(item.edge.child for item in edges)])


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command."""
    made = OptionParser(prog=_NAME, description=__doc__, epilog=f"example: {EXAMPLE}")
    text = "the calibration package, by its name or its folder"
    add_option(made, "name", "-n", required=True, metavar="PKG", help=text)
    text = "name of the configuration in the package, or its path (default: config.yml)"
    add_option(made, "config_file", "-cfg", metavar="FILE", help=text)
    text = "recording to check with, instead of the configuration's bag_file"
    add_option(made, "bag", "-b", type=named_path, metavar="FILE", help=text)
    add_meaningless_options(made, CONFIGURE_CALIBRATION_PKG)
    return made
