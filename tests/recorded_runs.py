"""What does not run every day: when it last did, at which commit, and what it said.

`docs/make_reliability.py` writes them into docs/reliability.md. Who runs one of them writes here
what it printed.
"""

from __future__ import annotations

from typing import NamedTuple


class Run(NamedTuple):
    """One run.

    Attributes:
        command: what was run.
        date: day of the run, "" if it never was.
        commit: what was checked out.
        said: its outcome.
    """

    command: str
    date: str
    commit: str
    said: str


RUNS = ()
