"""Blocks of command lines in the documents, as a reader types them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Iterator, List, NamedTuple, Tuple

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = ("python3", "rosrun", "roslaunch", "make")
SHELL = ("source", "cp", "mkdir", "cd", "export", "catkin_make", "git", "unzip", "rosbag")
_TYPED = "$ "  # before a command line with its answer below


class Block(NamedTuple):
    """Command lines that stand together.

    Attributes:
        page: path of the page in the repository.
        place: number of the block's first line in the page.
        lines: what is typed: continued lines joined, remarks left out.
    """

    page: str
    place: int
    lines: Tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.page}:{self.place}"


def blocks(page: str) -> List[Block]:
    """Return the blocks of a page in which something is typed, in order."""
    found = []
    for place, text in _blocks_of_code((ROOT / page).read_text(encoding="utf-8").splitlines()):
        lines = typed(text)
        if lines:
            found.append(Block(page, place, tuple(lines)))
    return found


def typed(text: List[str]) -> List[str]:
    """Return the command lines of a block; none where it shows a file or an output."""
    joined = "\n".join(text).replace("\\\n", " ").splitlines()
    answered = [line[len(_TYPED) :] for line in joined if line.startswith(_TYPED)]
    lines = [re.sub(r"\s+#\s.*$", "", " ".join(line.split())) for line in answered or joined]
    return [line for line in lines if line.split(" ")[0] in (*PROGRAMS, *SHELL)]


def _blocks_of_code(lines: List[str]) -> Iterator[Tuple[int, List[str]]]:
    """Yield where fenced and indented blocks begin, and what is in them, without indentation."""
    inside: List[str] = []
    begin, fenced = 0, False
    for number, line in enumerate([*lines, ""], start=1):
        is_fence = line.startswith("```")
        belongs = not is_fence and (fenced or line.startswith("    "))
        if belongs:
            begin = begin or number
            inside.append(line if fenced else line[4:])
        elif inside:
            yield begin, inside
            begin, inside = 0, []
        if is_fence:
            fenced = not fenced
