"""Files of one run that take the place of those of the run before all at once.

Within `written_together` the writers of `atomic` put each file on the disk under a temporary name.
In the end a list of them is written, the files of the run before are removed, and the new ones get
their names. A program that is killed before the list is there leaves the old files; where it is
there, the next one that looks at the folder finishes the work (`finish_interrupted`). So files of
two runs never stand there together.
"""

from __future__ import annotations

import contextlib
import os
import re
from pathlib import Path
from typing import Dict, Iterable, Iterator, List, Sequence

from atom_core.io import atomic
from atom_core.io.json_text import load_json

LIST_FILE = ".unfinished_results.json"
_TEMPORARY = re.compile(r"\.(?P<name>[^/\0]+)\.[0-9a-f]{12}\.tmp")  # as `atomic` names them


@contextlib.contextmanager
def written_together(folder: Path, names: Sequence[str]) -> Iterator[None]:
    """Let the files that are written into a folder meanwhile appear together, or not at all.

    Args:
        folder: where they are; it exists. Files of other folders are written as ever.
        names: of all files that such a run may write: those of an earlier run are removed, whether
            this one has written them or not. One that is a link, through which this run has
            written, stays.

    Raises:
        OutputError: a file cannot be written; everything is as it was.
    """
    finish_interrupted(folder)
    folder = Path(os.path.realpath(folder))
    _remove(_left_behind(folder, names))
    run = atomic.Postponed(folder, [], [])
    token = atomic.postponed.set(run)
    try:
        try:
            yield
        finally:
            atomic.postponed.reset(token)
        new = {temporary.name: target.name for temporary, target in run.renames}
        written = {*(target for _, target in run.renames), *run.elsewhere}
        stale = [
            name
            for name in names
            if (folder / name).is_file() and Path(os.path.realpath(folder / name)) not in written
        ]
        if new:
            document = {"remove": sorted({*stale, *new.values()}), "rename": new}
            atomic.write_json_atomically(folder / LIST_FILE, document)
    except BaseException:
        _remove(temporary for temporary, _ in run.renames)
        raise
    finish_interrupted(folder)


def finish_interrupted(folder: Path) -> None:
    """Give the files of a run their names, if it was killed after all of them were written.

    Raises:
        OutputError: the folder cannot be written to.
    """
    path = Path(folder) / LIST_FILE
    try:
        listed = load_json(path.read_text(encoding="utf-8"))
        rename = {t: n for t, n in listed["rename"].items() if _is_temporary_of(t, n)}
        remove = [name for name in listed["remove"] if Path(name).name == name]
    except FileNotFoundError:
        return
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return  # not written by us, since ours is whole or not there
    try:
        _exchange(path, rename, remove)
    except OSError as error:
        raise atomic.output_error(path.parent, error) from error


def _exchange(path: Path, rename: Dict[str, str], remove: List[str]) -> None:
    """Remove old files, then rename new ones, then remove the list; each step may be repeated."""
    arrived = {name for temporary, name in rename.items() if not (path.parent / temporary).exists()}
    if not arrived:  # else the old ones are gone already
        _remove(path.parent / name for name in remove)
    for temporary, name in rename.items():
        if name not in arrived:
            with contextlib.suppress(FileNotFoundError):  # another program does the same
                os.replace(path.parent / temporary, path.parent / name)
    atomic.sync_folder(path.parent)
    _remove([path])


def _is_temporary_of(temporary: str, name: str) -> bool:
    found = _TEMPORARY.fullmatch(temporary)
    return found is not None and name.startswith(found["name"]) and Path(name).name == name


def _left_behind(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    """Yield the temporary files of a run that was killed before all were written."""
    if not folder.is_dir():  # the first that writes says so
        return
    for entry in list(os.scandir(folder)):
        found = _TEMPORARY.fullmatch(entry.name)
        if found is not None and any(
            name.startswith(found["name"]) for name in (*names, LIST_FILE)
        ):
            yield Path(entry.path)


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
