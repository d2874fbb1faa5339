"""RViz for collecting: labels, seed markers and the panel, for the sensors of a configuration.

Whatever else is given goes to RViz.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Optional, Sequence

from atom_calibration.configure.render import collecting_view
from atom_calibration.runtime import options, running
from atom_calibration.runtime.rviz_window import (
    become_rviz,
    main_of,
    rviz_parser,
    written_layout,
)
from atom_calibration.sources.sensor_modality import modality_of_sensor
from atom_core.io.config_yaml import read_config

NAME = "collect_data_rviz"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Become RViz; return an exit code only if that fails."""
    return main_of(NAME, parser(), _run, argv)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; what it does not know is RViz's."""
    return rviz_parser(NAME, __doc__, "-cfg config.yml", options.add_config_option)


def _run(args: argparse.Namespace, rest: Sequence[str]) -> int:
    config = read_config(args.config)
    if args.layout:
        become_rviz(Path(args.layout), ["-f", config.world_link, *rest])
    sensors = {}
    for name, entry in config.sensors.items():
        if entry.modality is None:
            running.check_master()
        modality = modality_of_sensor(name, entry, running.stopped, _warn)
        sensors[name] = replace(entry, modality=modality)
    text = collecting_view(replace(config, sensors=sensors))
    become_rviz(written_layout("collect_data", text), rest)


def _warn(text: str) -> None:
    sys.stderr.write(f"{NAME}: {text}\n")
