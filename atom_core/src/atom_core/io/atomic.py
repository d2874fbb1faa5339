"""Files that are either complete or not there: written beside their target, then renamed."""

from __future__ import annotations

import contextlib
import errno
import math
import os
import secrets
from contextvars import ContextVar
from pathlib import Path
from typing import (
    Any,
    BinaryIO,
    Callable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Tuple,
    Union,
)

import numpy as np

from atom_core.errors import OutputError
from atom_core.io.json_writer import write_json

PathLike = Union[str, "os.PathLike[str]"]


class Postponed(NamedTuple):
    """A folder whose files get their names later, all at once (`together`).

    Attributes:
        folder: with its links resolved.
        renames: temporary files of the folder, and the names that they shall have.
        elsewhere: files of other folders that were written meanwhile, links resolved.
    """

    folder: Path
    renames: List[Tuple[Path, Path]]
    elsewhere: List[Path]


postponed: ContextVar[Optional[Postponed]] = ContextVar("postponed", default=None)

_REMEDIES = {
    errno.ENOSPC: "free some space or choose another folder",
    errno.EDQUOT: "free some of your quota or choose another folder",
    errno.EFBIG: "the file is larger than the system allows; raise the limit (ulimit -f)",
    errno.EACCES: "make the folder writable or choose another one",
    errno.EPERM: "make the folder writable or choose another one",
    errno.EROFS: "the disk is read-only; choose another folder",
    errno.ENOENT: "create the folder first",
    errno.ENOTDIR: "a part of the path is a file; choose another folder",
    errno.EISDIR: "a folder has this name; choose another name",
    errno.ENAMETOOLONG: "choose a shorter name",
}


def write_text_atomically(path: PathLike, text: str) -> None:
    """Write text as UTF-8; see `write_bytes_atomically`."""
    write_bytes_atomically(path, text.encode("utf-8"))


def write_bytes_atomically(path: PathLike, data: bytes) -> None:
    """Write a whole file or leave everything as it was.

    The data go to a temporary file in the same folder, to the disk, and then take the name of the
    target in one step, so that no reader ever sees half a file. A symbolic link stays a link and
    an existing file keeps its permissions.

    Args:
        path: the file; its folder must exist. An existing file is replaced.
        data: the content.

    Raises:
        OutputError: the file cannot be written; an older one is intact.
    """
    _write_atomically(path, lambda stream: stream.write(data))


def write_pieces_atomically(path: PathLike, make: Callable[[Callable[[str], Any]], None]) -> None:
    """Write text as UTF-8 while it is made; see `write_bytes_atomically`.

    Args:
        path: the file.
        make: is given what takes the pieces of the text, one after the other.
    """
    _write_atomically(path, lambda stream: make(lambda text: stream.write(text.encode("utf-8"))))


def _write_atomically(path: PathLike, fill: Callable[[BinaryIO], Any]) -> None:
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise output_error(path, OSError(errno.EISDIR, os.strerror(errno.EISDIR)))
    temporary = target.with_name(f".{target.name[:200]}.{secrets.token_hex(6)}.tmp")
    later = postponed.get()
    try:
        _write_and_sync(temporary, target, fill)
        if later is not None and target.parent == later.folder:
            later.renames.append((temporary, target))
            return
        os.replace(temporary, target)
        if later is not None:
            later.elsewhere.append(target)
    except OSError as error:
        raise output_error(path, error) from error
    finally:  # also upon Ctrl-C; after the rename there is nothing left to remove
        if later is None or (temporary, target) not in later.renames:
            _remove_if_there(temporary)
    sync_folder(target.parent)


def copy_atomically(source: PathLike, target: PathLike) -> None:
    """Copy what a file holds; see `write_bytes_atomically`.

    Raises:
        OutputError: it cannot be read or written; an older target is intact.
    """
    try:
        data = Path(source).read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise OutputError(f"{source}: cannot be copied ({reason}); restore the file") from error
    write_bytes_atomically(target, data)


def write_json_atomically(path: PathLike, document: Any, *, sort_keys: bool = True) -> None:
    """Write a document as JSON, two spaces per level; see `write_bytes_atomically`.

    Args:
        path: the file.
        document: mappings, lists, numbers, texts; numpy numbers and arrays become plain ones.
        sort_keys: write keys in alphabetical order.

    Raises:
        OutputError: the file cannot be written, or a number is not finite (the message names it).
    """

    def make(write: Callable[[str], Any]) -> None:
        write_json(document, write, sort_keys=sort_keys, allow_nan=False, default=_plain)
        write("\n")

    try:
        write_pieces_atomically(path, make)
    except ValueError as error:
        place = _first_non_finite(document)
        if place is None:
            raise
        raise OutputError(
            f"{path}: not written, because {'.'.join(place[0]) or 'the document'} is {place[1]} "
            f"and only finite numbers may be saved"
        ) from error


def prepare_output_folder(path: PathLike, overwrite: bool = False) -> Path:
    """Make a folder that results can be written to.

    Nothing is deleted: with ``overwrite`` files of the same name will be replaced one by one,
    others stay.

    Args:
        path: the folder; it and its parents are created when absent.
        overwrite: accept a folder that already holds something.

    Returns:
        The folder.

    Raises:
        OutputError: it holds something and ``overwrite`` is False, a file has its name, or it
            cannot be created or written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = next(os.scandir(folder), None) is not None
    except (FileExistsError, NotADirectoryError) as error:
        raise OutputError(
            f"{folder}: a file is in the way; move it or choose another folder"
        ) from error
    except OSError as error:
        raise output_error(folder, error) from error
    if occupied and not overwrite:
        raise OutputError(
            f"{folder}: the folder is not empty; add --overwrite to replace the files in it, or "
            f"choose another one"
        )
    refuse_unwritable(folder)
    return folder


def refuse_unwritable(folder: Path) -> None:
    """Refuse a folder in which nothing can be written, or made where it is absent; nothing is made.

    Raises:
        OutputError: naming the folder, and why.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise output_error(folder, OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
    if not os.access(there, os.W_OK | os.X_OK):
        read_only = os.statvfs(there).f_flag & os.ST_RDONLY
        number = errno.EROFS if read_only else errno.EACCES
        raise output_error(folder, OSError(number, os.strerror(number)))


def _write_and_sync(temporary: Path, target: Path, fill: Callable[[BinaryIO], Any]) -> None:
    # O_EXCL and mode 0666: the user's umask decides, as for any file that a program creates.
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with os.fdopen(descriptor, "wb") as stream:
        if target.exists():
            os.fchmod(stream.fileno(), target.stat().st_mode & 0o7777)
        fill(stream)
        stream.flush()
        os.fsync(stream.fileno())


def _remove_if_there(path: Path) -> None:
    with contextlib.suppress(OSError):  # renamed already, or never created
        path.unlink()


def sync_file(path: Path) -> None:
    """Bring what a file holds to the disk, so that it may take the place of another one.

    Raises:
        OSError: the disk does not take it.
    """
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Put the new name on the disk too; file systems that cannot do so are left alone."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    with contextlib.suppress(OSError):
        os.fsync(descriptor)
    os.close(descriptor)


def output_error(path: PathLike, error: OSError) -> OutputError:
    """Return what to raise where the system refuses to write: what, why, and what to do."""
    reason = (error.strerror or str(error)).lower()
    remedy = _REMEDIES.get(error.errno or 0, "choose another folder")
    return OutputError(f"{path}: cannot be written ({reason}); {remedy}")


def _plain(value: Any) -> Any:
    """Turn what json does not know into what it knows."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def _first_non_finite(value: Any, place: Tuple[str, ...] = ()) -> Optional[Tuple[Any, float]]:
    """Return (keys down to the number, number) of the first NaN or infinity, None if all finite."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, float):
        return None if math.isfinite(value) else (place, value)
    if isinstance(value, Mapping):
        children = [(str(key), child) for key, child in value.items()]
    elif isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        children = [(str(index), child) for index, child in enumerate(value)]
    else:
        return None
    found = (_first_non_finite(child, (*place, key)) for key, child in children)
    return next((hit for hit in found if hit is not None), None)
