"""Run the commands of docs/tutorials/calibrate_a_dataset.md, and put what they print into the page.

Run it when an output has changed: `python3 docs/make_tutorial_outputs.py`. The page shows a part of
each output; which lines, says `SHOWN`. `tests/test_tutorials.py` runs the same and compares.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import sys
import tempfile
from pathlib import Path
from typing import Dict, Iterator, List, NamedTuple, Sequence

from atom_core import cli

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "tutorials" / "calibrate_a_dataset.md"
_PROGRAM = "python3 -m atom_core "
_WITHOUT_A_SAMPLE = "old/dataset.json"  # a dataset of version 2, which the reader has
_LEFT_OUT = "..."

# By command: the beginnings of the lines that the page shows, in order. Between two of them lines
# are left out where it says so.
SHOWN = {
    "check": (
        *("Detections (", "Collection  ", "------", "000 ", "001 ", _LEFT_OUT, "seen in", ""),
        *("23 collections", "", "verdict: ", "  depth_1", _LEFT_OUT, "  rgb_3"),
    ),
    "calibrate": (
        *("Calibrated edges", "Sensors ", "------", "depth_1 ", "lidar_1 ", _LEFT_OUT, "rgb_3 "),
        *("", "How well", "Sensors ", "------", "depth_1 ", "lidar_1 ", _LEFT_OUT, ""),
        *("Residuals at", "Sensor ", "------", "depth_1 ", "lidar_1 ", _LEFT_OUT, "rgb_1 ", ""),
        *("Combined standard", "From ", "------", "depth_1 ", _LEFT_OUT, ""),
        *("Errors against truth", "Sensor ", "------", "mean ", _LEFT_OUT, ""),
        *("converged: ", "", "verdict: ", "  depth_1", "  lidar_1", _LEFT_OUT, "  rgb_3"),
    ),
    "evaluate": (
        *("Averages over", "kind ", "------", "rgb-rgb", "depth-rgb ", "depth-rgb_plane"),
        *("lidar3d-rgb ", "lidar3d-rgb_plane", "lidar3d-depth ", "lidar3d-depth_plane"),
        *("lidar3d-lidar3d ", "lidar3d-lidar3d_common"),
        *("lidar3d-lidar3d_limit", "lidar3d-lidar3d_plane", "", "verdict: ", _LEFT_OUT),
    ),
}


class Output(NamedTuple):
    """A command line of the page, and what it printed."""

    line: str
    code: int
    text: str


def command_lines(page: str) -> List[str]:
    """Return the command lines of a page, without those that need what the reader brings."""
    lines = [text.strip() for text in re.findall(r"^    (python3 -m atom_core .*)$", page, re.M)]
    return [line for line in lines if _WITHOUT_A_SAMPLE not in line]


def outputs(page: str, folder: Path) -> Iterator[Output]:
    """Run the commands of a page in a folder, in their order; yield what each prints."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        for line in command_lines(page):
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                code = cli.main(shlex.split(line[len(_PROGRAM) :]))
            yield Output(line, code, out.getvalue())
    finally:
        os.chdir(before)


def excerpt(text: str, beginnings: Sequence[str]) -> List[str]:
    """Return the lines of an output that begin so, each sought after the one before.

    Raises:
        ValueError: one of them is not there.
    """
    lines, place, found = text.splitlines(), 0, []
    for beginning in beginnings:
        if beginning in (_LEFT_OUT, ""):
            found.append(beginning)
            continue
        place = next((i for i in range(place, len(lines)) if lines[i].startswith(beginning)), -1)
        if place < 0:
            raise ValueError(f"no line of the output begins with {beginning!r}")
        found.append(re.sub(r", solved in [\d.]+ s", "", lines[place]))
        place += 1
    return found


def with_outputs(page: str, excerpts: Dict[str, List[str]]) -> str:
    """Return the page with the block behind the first line of each command replaced."""
    for command, lines in excerpts.items():
        block = "```\n" + "\n".join(lines) + "\n```"
        pattern = rf"(^    python3 -m atom_core {command} [^\n]*\n\n)```\n.*?\n```"
        page, count = re.subn(
            pattern, lambda m, b=block: m.group(1) + b, page, count=1, flags=re.M | re.S
        )
        if count != 1:
            raise ValueError(f"the page has no block behind {command}")
    return page


def excerpts_of(every: Sequence[Output]) -> Dict[str, List[str]]:
    """Return what is shown of the first output of each command."""
    first: Dict[str, List[str]] = {}
    for output in every:
        command = output.line[len(_PROGRAM) :].split()[0]
        if command in SHOWN and command not in first:
            first[command] = excerpt(output.text, SHOWN[command])
    return first


def main() -> int:
    """Write the page."""
    page = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        excerpts = excerpts_of(list(outputs(page, Path(folder))))
    PAGE.write_text(with_outputs(page, excerpts), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
