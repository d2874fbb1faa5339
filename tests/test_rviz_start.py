"""What is preloaded into RViz makes its connections to the X server synchronous."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "atom_rviz_plugins" / "tests"))

from screen import Screen  # noqa: E402

from atom_calibration.runtime.rviz_window import X11_SYNC, become_rviz  # noqa: E402

ASK = """
import ctypes
xlib = ctypes.CDLL("libX11.so.6")
xlib.XOpenDisplay.restype = ctypes.c_void_p
xlib.XSynchronize.restype = ctypes.c_void_p
display = xlib.XOpenDisplay(None)
assert display
# what Xlib calls after each request of this connection so far; nothing is the default
print("synchronous" if xlib.XSynchronize(ctypes.c_void_p(display), 0) else "buffered")
"""

pytestmark = pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")


@pytest.mark.parametrize("preloaded, answer", [("", "buffered"), (X11_SYNC, "synchronous")])
def test_connections_are_synchronous_where_it_is_preloaded(preloaded, answer):
    screen = Screen()
    try:
        asked = subprocess.run(
            [sys.executable, "-c", ASK],
            env={**screen.environment, "LD_PRELOAD": preloaded},
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
    finally:
        screen.close()
    assert (asked.stdout.strip(), asked.stderr) == (answer, "")


@pytest.mark.parametrize("before", ["", "libX11.so.6"])
def test_a_program_that_becomes_rviz_preloads_it_before_what_the_user_does(
    before, tmp_path, monkeypatch
):
    program = tmp_path / "rviz"
    program.write_text('#!/bin/sh\necho "$LD_PRELOAD|$*"\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("LD_PRELOAD", before)
    said = subprocess.run(
        [
            sys.executable,
            "-c",
            f"from {become_rviz.__module__} import become_rviz; become_rviz('a.rviz', ['rest'])",
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    ).stdout
    assert said.strip() == f"{X11_SYNC} {before}".strip() + "|-d a.rviz rest"


LAUNCH = """
import signal, subprocess, sys
heard = []
signal.signal(signal.SIGINT, lambda *_: heard.append("SIGINT"))
print(subprocess.call(sys.argv[1:]), *heard)
"""


@pytest.mark.parametrize(
    "parent, asked, code, said",
    [
        ("roslaunch", "true", 0, "0 SIGINT"),  # the window was closed
        ("roslaunch", "true", 3, "3"),  # a failure is called so
        ("roslaunch", "", 0, "0"),
        ("rostest", "true", 0, "0"),
    ],
)
def test_what_is_preloaded_ends_the_launch_where_that_is_asked_for(
    parent, asked, code, said, tmp_path
):
    program = tmp_path / parent
    program.write_text(LAUNCH, encoding="utf-8")
    words = ["env", f"LD_PRELOAD={X11_SYNC}", *([f"ATOM_ENDS_LAUNCH={asked}"] if asked else [])]
    words += [sys.executable, "-c", f"raise SystemExit({code})"]
    done = subprocess.run(
        [sys.executable, str(program), *words],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert (done.stdout.strip(), done.stderr) == (said, "")
