"""Programs that are killed (SIGKILL) at random moments, and what is in their folder then.

Half of the moments lie anywhere between the program's start and its end, the others just after a
file in its folder came, went or got its name.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Dict, FrozenSet, Iterator, List, Mapping, NamedTuple, Optional

import numpy as np

PATIENCE_S = 300.0
_LOOK_EVERY_S, _SOON_S = 0.002, 0.01


class Whole(NamedTuple):
    """A run that nobody disturbed."""

    code: int
    said: str
    seconds: float  # since it was ready
    changes: int


class Program:
    """A command line, and the folder that it writes to."""

    def __init__(
        self,
        words: Callable[[int], List[object]],
        folder: Path,
        env: Optional[Mapping[str, str]] = None,
        ready: Callable[[str], bool] = lambda _said: True,
    ):
        """Take a program.

        Args:
            words: its command line, by the number of the run.
            folder: it is watched.
            env: variables of its environment beside those of the test.
            ready: tells from what it said so far whether it is worth killing.
        """
        self._words, self._folder, self._ready = words, Path(folder), ready
        self._env = {**os.environ, **(env or {})}
        self.runs = 0

    def run(self, stop: Callable[[subprocess.Popen, float], None] = lambda *_: None) -> Whole:
        """Let it run to its end.

        Args:
            stop: is called again and again with the process and the seconds since it was ready.
        """
        with self._running() as (process, said):
            changes, begin = _Changes(self._folder), time.monotonic()
            while process.poll() is None:
                changes.look()
                stop(process, time.monotonic() - begin)
                assert time.monotonic() < begin + PATIENCE_S, f"it does not end: {said()}"
                time.sleep(_LOOK_EVERY_S)
            return Whole(process.returncode, said(), time.monotonic() - begin, changes.count)

    def kill(self, rng: np.random.Generator, whole: Whole) -> bool:
        """Start it and kill it at a random moment; tell whether it still ran then.

        Args:
            rng: chooses the moment.
            whole: a run to its end, which tells how long there is something to be killed.
        """
        after_s = rng.uniform(0.0, whole.seconds)
        if rng.random() < 0.5:
            wanted = int(rng.integers(1, max(whole.changes, 1) + 1))
            after_s = PATIENCE_S
        else:
            wanted = None
        with self._running() as (process, said):
            changes, begin = _Changes(self._folder), time.monotonic()
            while process.poll() is None and time.monotonic() < begin + after_s:
                changes.look()
                if wanted is not None and changes.count >= wanted:
                    time.sleep(rng.uniform(0.0, _SOON_S))
                    break
                time.sleep(_LOOK_EVERY_S)
            process.kill()
            process.wait()
            assert process.returncode < 0 or "Traceback" not in said(), said()
            return process.returncode < 0

    @contextmanager
    def _running(self) -> Iterator:
        """Yield the process, once it is ready, and what returns its words so far."""
        self.runs += 1
        with tempfile.TemporaryFile("w+") as output:

            def said() -> str:
                output.seek(0)
                return output.read()

            words = [str(word) for word in self._words(self.runs)]
            process = subprocess.Popen(words, env=self._env, stdout=output, stderr=output)
            try:
                begin = time.monotonic()
                while process.poll() is None and not self._ready(said()):
                    assert time.monotonic() < begin + PATIENCE_S, f"it is never ready: {said()}"
                    time.sleep(_SOON_S)
                yield process, said
            finally:
                if process.poll() is None:
                    process.kill()
                    process.wait()


class _Changes:
    """Counts how often the set of files below a folder has changed."""

    def __init__(self, folder: Path):
        self._folder, self.count = folder, 0
        self._names = self._look()

    def look(self) -> None:
        names = self._look()
        self.count += names != self._names
        self._names = names

    def _look(self) -> FrozenSet[str]:
        return frozenset(files_below(self._folder))


def files_below(folder: Path) -> Dict[str, Path]:
    """Return the files below a folder by their path in it; none where it is absent."""
    return {
        os.path.relpath(os.path.join(parent, name), folder): Path(parent, name)
        for parent, _, names in os.walk(folder)
        for name in names
    }


def contents(folder: Path) -> Dict[str, bytes]:
    """Return what the files below a folder hold, by their path in it."""
    return {name: path.read_bytes() for name, path in files_below(folder).items()}
