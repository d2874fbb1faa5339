"""Sessions of the live collector for tests: hours of stops, and what became of their saves."""

import json
import os
import subprocess
import sys
from pathlib import Path

from masters import running_master

SESSION = Path(__file__).with_name("long_session.py")
STOPS = 4  # of a play


def session(folder, plays, stop_s, what):
    """Run a session with a master of its own; return its figures."""
    with running_master(folder / "ros_home") as environment:
        done = subprocess.run(
            [sys.executable, SESSION, folder, str(plays), str(stop_s), what],
            env={**os.environ, **environment},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            timeout=6 * 3600,
            check=False,
        )
    assert done.returncode == 0, done.stderr[-4000:]
    return json.loads((folder / "figures.json").read_text(encoding="utf-8"))


def check_saves(figures, plays):
    """Assert that no save was refused or lost, and that the nodes ran to the end."""
    assert figures["refused"] == [] and figures["saved"] == STOPS * plays
    assert figures["ran_to_the_end"]
