"""Recordings in several files, as `rosbag record --split` writes them: NAME_0.bag, NAME_1.bag, ...

All of them are given, or a pattern that names them (`train_*.bag`, also in launch files and
configurations, where no shell replaces it).
"""

from __future__ import annotations

import re
from os.path import commonprefix
from pathlib import Path
from typing import List, Sequence, Tuple

_PART = re.compile(r"(.*_)(\d+)\.bag")
_OF_PATTERNS = re.compile(r"[*?\[]")


def bag_files(paths: Sequence[Path]) -> List[Path]:
    """Return the files that paths name, parts in the order of their numbers.

    A path that is no file is a pattern if it looks like one; a pattern without files is returned
    itself, for whoever opens it tells that it is not there.
    """
    found: List[Path] = []
    for path in paths:
        matching = [path]
        if _OF_PATTERNS.search(path.name) and not path.exists():
            matching = sorted(path.parent.glob(path.name), key=_number) or [path]
        found += [file for file in matching if file not in found]
    return found


def is_there(path: Path) -> bool:
    """Tell whether there is a file that a path or a pattern names."""
    return bag_files([path])[0].exists()


def _number(path: Path) -> Tuple[str, int]:
    part = _PART.fullmatch(path.name)
    return (part.group(1), int(part.group(2))) if part else (path.name, 0)


def named_together(files: Sequence[Path]) -> Path:
    """Return how messages name files of one recording: FIRST ... LAST."""
    first, last = files[0], files[-1]
    return first if len(files) == 1 else first.with_name(f"{first.name} ... {last.name}")


def name_of(files: Sequence[Path]) -> str:
    """Return a recording's name: that of its file without .bag, of several what they share."""
    if len(files) == 1:
        return files[0].stem
    return commonprefix([file.stem for file in files]).rstrip("_-. ") or files[0].stem


def other_parts(files: Sequence[Path]) -> List[Path]:
    """Return the files of the folder that seem to belong to the same recording and are not given.

    Those are named alike but for their number, and begin with number 0.
    """
    if len(files) != 1 or not (part := _PART.fullmatch(files[0].name)):
        return []
    alike = [
        path
        for path in files[0].parent.glob("*.bag")
        if (other := _PART.fullmatch(path.name)) and other.group(1) == part.group(1)
    ]
    numbers = sorted(_number(path)[1] for path in alike)
    if numbers != list(range(len(alike))):
        return []
    return sorted((path for path in alike if path.name != files[0].name), key=_number)


def remark_on_parts(files: Sequence[Path]) -> str:
    """Return that a file looks like one part of a recording; nothing where it does not."""
    others = other_parts(files)
    if not others:
        return ""
    pattern = files[0].with_name(f"{_number(files[0])[0]}*.bag")
    return (
        f"{files[0]}: {others[0].name}{' ...' if len(others) > 1 else ''} beside it may be "
        f"parts of the same recording (`rosbag record --split`), of which only the first one "
        f"has /tf_static; then give all of them: --bag '{pattern}'"
    )
