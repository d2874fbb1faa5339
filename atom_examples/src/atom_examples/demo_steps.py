"""What the demos share: the programs they call, and how these may end."""

from __future__ import annotations

from pathlib import Path
from typing import Callable, List

from atom_core import cli
from atom_core.errors import AtomError

DONE, NOT_ACCEPTABLE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
SETS = ("train", "test")


class StepError(AtomError):
    """A step ended with a refusal, which it has printed."""


def core(*words: object) -> int:
    """Run a command of the core; see `refusing`."""
    return refusing(cli.main, *words)


def refusing(program: Callable[[List[str]], int], *words: object) -> int:
    """Run a program; return 0 or 1.

    Raises:
        KeyboardInterrupt: the program was interrupted.
        StepError: it refused.
    """
    code = program([str(word) for word in words])
    if code == INTERRUPTED:
        raise KeyboardInterrupt
    if code not in (DONE, NOT_ACCEPTABLE):
        raise StepError("the step above refused to go on; nothing further is done")
    return code


def report(folder: Path) -> None:
    """Make one report of calibration and evaluation, which says where it is.

    Raises:
        StepError: it cannot be made.
    """
    results = ("--calibration", folder / "calibration", "--evaluation", folder / "evaluation")
    core("report", *results, "--output", folder, "--overwrite")


def title(step: int, text: str) -> None:
    """Print what comes now."""
    print(f"\n{step}/5 {text}\n", flush=True)
