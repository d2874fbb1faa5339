"""RViz for collecting: labels, seed markers and the panel, for the sensors of a configuration.

Whatever else is given goes to RViz.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Optional, Sequence

import rospkg

from atom_calibration.configure.render import collecting_view
from atom_calibration.nodes import running
from atom_calibration.nodes.modality import modality_of_sensor
from atom_core.errors import OutputError
from atom_core.io.atomic import write_text_atomically
from atom_core.io.config_yaml import read_config

NAME = "collect_data_rviz"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Become RViz; return an exit code only if that fails."""
    args, rest = _parser().parse_known_args(sys.argv[1:] if argv is None else argv)
    return running.guarded(NAME, lambda: _run(args.config, rest))


def _run(config_file: Path, rest: Sequence[str]) -> int:
    config = read_config(config_file)
    sensors = {}
    for name, entry in config.sensors.items():
        if entry.modality is None:
            running.check_master()
        modality = modality_of_sensor(name, entry, running.stopped, _warn)
        sensors[name] = replace(entry, modality=modality)
    text = collecting_view(replace(config, sensors=sensors))
    name = f"collect_data-{hashlib.sha1(text.encode()).hexdigest()[:8]}.rviz"
    path = Path(rospkg.get_ros_home()) / "atom_calibration" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text_atomically(path, text)
    try:
        os.execvp("rviz", ["rviz", "-d", str(path), *rest])
    except OSError as error:
        raise OutputError(f"rviz cannot be started ({error.strerror}); is it installed?") from None


def _warn(text: str) -> None:
    sys.stderr.write(f"{NAME}: {text}\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=NAME,
        description=__doc__,
        epilog=f"example: rosrun atom_calibration {NAME} -cfg config.yml",
    )
    running.add_config_option(parser)
    return parser
