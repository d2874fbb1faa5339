"""Runs chosen tests in a fork of a process that has the libraries loaded; mutants.py starts it.

Reads a JSON list of tests from each line, and answers with pytest's exit code, -1 for too long.
As a plugin of pytest it writes how long each test took, into $MUTANTS_SECONDS.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import List

import pytest

_PATIENCE_S = 180.0  # tests of a minute at the most, and the machine may be busy
_MEMORY_BYTES = 8 << 30
_seconds = defaultdict(float)


def pytest_runtest_logreport(report):
    """Add up setup, call and end of a test that has passed."""
    if report.passed and not hasattr(report, "wasxfail"):
        _seconds[report.nodeid] += report.duration
    else:
        _seconds[report.nodeid] = float("inf")


def pytest_sessionfinish(session):
    """Write the durations, in the process that hears of all tests."""
    file = os.environ.get("MUTANTS_SECONDS")
    if file and not hasattr(session.config, "workerinput"):
        passed = {test: s for test, s in _seconds.items() if s < float("inf")}
        Path(file).write_text(json.dumps(passed), "utf-8")


def _run(tests: List[str]) -> int:
    """Run tests in a child process; return pytest's exit code, or -1 if they take too long."""
    child = os.fork()
    if not child:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not long"]
        os._exit(int(pytest.main([*options, *tests])))
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            _end(child)
            return os.waitstatus_to_exitcode(status) if os.WIFEXITED(status) else 1
        time.sleep(0.02)
    _end(child)
    os.waitpid(child, 0)
    return -1


def _end(child: int) -> None:
    """End a child and all that it has started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)


def main() -> None:
    """Load what takes long, then serve."""
    import cv2  # noqa: F401
    import numpy  # noqa: F401
    import scipy.optimize
    import scipy.sparse.linalg
    import scipy.spatial  # noqa: F401
    import yaml  # noqa: F401

    for line in sys.stdin:
        sys.stdout.write(f"{_run(json.loads(line))}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
