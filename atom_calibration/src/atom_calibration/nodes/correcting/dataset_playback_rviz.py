"""RViz for correcting labels: data, labels and the panel, for the sensors of a dataset.

Whatever else is given goes to RViz.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Optional, Sequence

from atom_calibration.configure.render import correcting_view
from atom_calibration.runtime.rviz_window import (
    become_rviz,
    main_of,
    rviz_parser,
    written_layout,
)
from atom_core.commands.common import add_dataset_option
from atom_core.io.dataset_json import read_dataset

NAME = "dataset_playback_rviz"


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Become RViz; return an exit code only if that fails."""
    return main_of(NAME, parser(), _run, argv)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; what it does not know is RViz's."""
    return rviz_parser(NAME, __doc__, "-json dataset.json", add_dataset_option)


def _run(args: argparse.Namespace, rest: Sequence[str]) -> int:
    dataset = read_dataset(args.dataset)
    if args.layout:
        become_rviz(Path(args.layout), ["-f", dataset.world, *rest])
    become_rviz(written_layout("dataset_playback", correcting_view(dataset)), rest)
