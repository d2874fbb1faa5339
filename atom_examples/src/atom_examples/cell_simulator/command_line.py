"""What the simulators' command lines share: options, checks of the bag's name, exit codes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, Callable

from atom_core.errors import AtomError, OutputError

BAD_INPUT, INTERRUPTED = 2, 130


def add_option(parser: argparse.ArgumentParser, name: str, **settings: Any) -> None:
    """Add an option that is accepted with ``_`` and with ``-``."""
    spellings = dict.fromkeys([f"--{name}", "--" + name.replace("_", "-")])
    parser.add_argument(*spellings, dest=name, **settings)


def exit_code(program: str, run: Callable[[], int]) -> int:
    """Run a program's work; return its exit code, after one line where it refuses or is stopped."""
    try:
        return run()
    except AtomError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{program}: interrupted, nothing is written", file=sys.stderr)
        return INTERRUPTED


def check_least(name: str, value: int, least: int) -> int:
    """Return the value of an option.

    Raises:
        OutputError: it is below the least one.
    """
    if value < least:
        raise OutputError(f"--{name} is {value}; give {least} or more")
    return value


def check_bag(bag: Path, may_exist: bool) -> None:
    """Refuse a name under which no bag can be recorded.

    Raises:
        OutputError: it is no name of a bag, its folder is absent, or the bag exists and must not.
    """
    if bag.is_dir() or not bag.name.endswith(".bag"):
        raise OutputError(f"{bag}: no name of a bag; give one that ends with .bag")
    if bag.exists() and not may_exist:
        raise OutputError(f"{bag}: exists; choose another name or add --overwrite")
    if not bag.parent.is_dir():
        raise OutputError(f"{bag.parent}: no such folder; create it")
