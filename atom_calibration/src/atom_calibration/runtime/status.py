"""How a run goes on and how it ended, for those who look at its folder and not at its screen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from atom_core.io.atomic import write_json_atomically

STATUS_FILE = "status.json"
_BEGUN = "begun and not ended; where no such program runs any more, it was killed"


def write_begun(folder: Path, step: str) -> None:
    """Say that a step has begun: its exit code is null, and stays so if it is killed.

    Raises:
        OutputError: the file cannot be written.
    """
    write_status(folder, step, exit_code=None, message=_BEGUN)


def write_status(folder: Path, step: str, **said: Any) -> None:
    """Say how far a step has come.

    Args:
        folder: where the file is.
        step: "collect" or "calibrate".
        said: ``exit_code``, ``message`` and whatever else is known.

    Raises:
        OutputError: the file cannot be written.
    """
    write_json_atomically(folder / STATUS_FILE, {"step": step, **said})
