"""The end of what a command prints: the verdict, its grades in colour on a terminal."""

from __future__ import annotations

import os
import re
import shlex
import sys
from pathlib import Path
from typing import TextIO

from atom_core.report.verdict import GOOD, WEAK, WRONG, Verdict, verdict_lines

# Foreground colours of ANSI terminals.
_COLOURS = {GOOD: "32", WEAK: "33", WRONG: "31"}
_GRADE = re.compile(rf"(?im)^(verdict: |  \S+ +)({'|'.join(_COLOURS)})\b")


def print_verdict(verdict: Verdict) -> None:
    """Print one sentence, and one line for each sensor."""
    text = verdict_lines(verdict)
    print(coloured(text) if shows_colours(sys.stdout) else text)


def print_next(command: str, *words: str) -> None:
    """Print which command comes next, as the one that runs was typed: by rosrun, or by python3."""
    of_ros = Path(sys.argv[0]).parent.name == "atom_calibration"
    program = ("rosrun", "atom_calibration") if of_ros else ("python3", "-m", "atom_core")
    print("\nnext:", *program, command, *map(shlex.quote, words))


def coloured(text: str) -> str:
    """Return the lines of a verdict with good in green, weak in yellow, wrong in red."""

    def with_colour(found: re.Match) -> str:
        place, grade = found.groups()
        return f"{place}\033[1;{_COLOURS[grade.lower()]}m{grade}\033[0m"

    return _GRADE.sub(with_colour, text)


def shows_colours(stream: TextIO) -> bool:
    """Tell whether a stream is a terminal with colours that nobody has switched off (NO_COLOR)."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM", "dumb") == "dumb"
    return stream.isatty() and not plain
