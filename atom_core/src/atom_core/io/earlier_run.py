"""What an earlier run left in a folder, kept there until the new run is whole.

``previous/`` holds its files. They come there by way of ``.previous.partial/``, which gets the name
in one step, so a run that is killed amid the moving is undone by the next one. What is to be
removed gets another name first, in one step too, so that no half of it is taken for the whole.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Iterable, Iterator

from atom_core.io.atomic import output_error, sync_folder

PREVIOUS_FOLDER = "previous"
_PARTIAL, _OLDER, _FORGOTTEN = ".previous.partial", ".previous.older", ".previous.forgotten"


def has_earlier_run(folder: Path) -> bool:
    """Tell whether the folder keeps the files of an earlier run."""
    return (folder / PREVIOUS_FOLDER).is_dir()


def set_aside(folder: Path, files: Iterable[Path]) -> None:
    """Move files to ``previous/``; what was there before is removed when all are there.

    Args:
        folder: of the run.
        files: in it or in folders below it; those that are absent are passed over.

    Raises:
        OutputError: a file cannot be moved; everything is where it was.
    """
    try:
        undo_partial(folder)
        for path in files:
            if path.is_file():
                _move(path, folder / _PARTIAL / path.relative_to(folder))
        if not (folder / _PARTIAL).is_dir():
            return
        if has_earlier_run(folder):
            os.replace(folder / PREVIOUS_FOLDER, folder / _OLDER)
        os.replace(folder / _PARTIAL, folder / PREVIOUS_FOLDER)
        sync_folder(folder)
        _remove(folder / _OLDER)
    except OSError as error:
        undo_partial(folder)
        raise output_error(folder / PREVIOUS_FOLDER, error) from error


def undo_partial(folder: Path) -> bool:
    """Put everything where it was, if an earlier call of `set_aside` was killed amid its work.

    What a killed call of `forget` left is removed.

    Returns:
        True if there was something to be put back.
    """
    undone = (folder / _PARTIAL).is_dir()
    _put_back_from(folder, folder / _PARTIAL)
    if (folder / _OLDER).is_dir():
        if has_earlier_run(folder):
            _remove(folder / _OLDER)
        else:
            os.replace(folder / _OLDER, folder / PREVIOUS_FOLDER)
    _remove(folder / _FORGOTTEN)
    return undone


def put_back(folder: Path) -> None:
    """Move the files of ``previous/`` to where they were, over files of the same names.

    Raises:
        OutputError: a file cannot be moved; the next call goes on.
    """
    try:
        undo_partial(folder)
        if has_earlier_run(folder):
            # If this is killed, the next run goes on from here.
            os.replace(folder / PREVIOUS_FOLDER, folder / _PARTIAL)
            undo_partial(folder)
    except OSError as error:
        raise output_error(folder, error) from error


def forget(folder: Path) -> None:
    """Remove ``previous/``: the new run is whole."""
    _remove(folder / _FORGOTTEN)
    if has_earlier_run(folder):
        os.replace(folder / PREVIOUS_FOLDER, folder / _FORGOTTEN)
        _remove(folder / _FORGOTTEN)


def _put_back_from(folder: Path, kept: Path) -> None:
    for path in list(_files_below(kept)):
        _move(path, folder / path.relative_to(kept))
    _remove(kept)


def _files_below(folder: Path) -> Iterator[Path]:
    for parent, _, names in os.walk(folder):
        for name in names:
            yield Path(parent) / name


def _move(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    os.replace(source, target)


def _remove(folder: Path) -> None:
    if folder.is_dir():
        shutil.rmtree(folder)
