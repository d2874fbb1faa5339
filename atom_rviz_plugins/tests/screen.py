"""A screen without a monitor, with a mouse and keys: Xvfb, openbox, xdotool.

Things are found on it by their colour, so that no test depends on how RViz lays out its window.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from atom_calibration.runtime.rviz_window import X11_SYNC

PATIENCE_S = 120.0  # reached by what is broken only, however busy the machine
_STEP_S = 0.05
_REST_S = 0.3  # until the program has seen what the mouse did


class Screen:
    """Xvfb on a display that is free, with a window manager."""

    def __init__(self, width=1400, height=900, log=subprocess.DEVNULL):
        read_end, write_end = os.pipe()
        size = f"{width}x{height}x24"
        self._server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write_end), "-screen", "0", size]
            + ["+extension", "GLX", "+render", "-noreset", "-nolisten", "tcp"],
            pass_fds=[write_end],
            stdout=log,
            stderr=log,
        )
        os.close(write_end)
        with os.fdopen(read_end) as numbers:
            number = numbers.readline().strip()
        if not number:
            raise RuntimeError("Xvfb did not start")
        self.environment = {
            **os.environ,
            "DISPLAY": f":{number}",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "QT_X11_NO_MITSHM": "1",
        }
        self._manager = self._managed(log)

    def _managed(self, log):
        """Start the window manager; it is ready when it runs the command that it is given."""
        end_s = time.monotonic() + PATIENCE_S
        with tempfile.TemporaryDirectory() as folder:
            ready = Path(folder) / "ready"
            manager = self.run(["openbox", "--startup", f"touch {ready}"], log)
            while not ready.exists():
                if time.monotonic() > end_s:
                    raise RuntimeError("openbox did not start")
                if manager.poll() is not None:
                    manager = self.run(["openbox", "--startup", f"touch {ready}"], log)
                time.sleep(_STEP_S)
        return manager

    @property
    def is_managed(self):
        """Tell whether the window manager runs, without which windows may be larger."""
        return self._manager.poll() is None

    @property
    def server_pid(self):
        """The process of the X server."""
        return self._server.pid

    def has_window(self, name):
        """Tell whether a window with this name (a regular expression) can be seen."""
        found = subprocess.run(
            ["xdotool", "search", "--onlyvisible", "--name", name],
            env=self.environment,
            capture_output=True,
            timeout=60,
            check=False,
        )
        return bool(found.stdout.strip())

    def run(self, command, log):
        """Start a program on this screen."""
        return subprocess.Popen(command, env=self.environment, stdout=log, stderr=log)

    def run_rviz(self, words, log):
        """Start RViz on this screen, as the launch files do."""
        return subprocess.Popen(
            ["rviz", *words],
            env={**self.environment, "LD_PRELOAD": X11_SYNC},
            stdout=log,
            stderr=log,
        )

    def close(self):
        """End window manager and server."""
        for program in (self._manager, self._server):
            end(program)

    def picture(self):
        """The whole screen as an array of (height, width, 3), red first."""
        ppm = subprocess.run(
            ["import", "-window", "root", "ppm:-"],
            env=self.environment,
            capture_output=True,
            timeout=60,
            check=True,
        ).stdout
        return cv2.imdecode(np.frombuffer(ppm, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]

    def save(self, path):
        """Write a picture of the screen."""
        cv2.imwrite(str(path), self.picture()[:, :, ::-1])

    def find(self, colour):
        """Where a colour is: (left, top, right, bottom), the last ones included; None: nowhere."""
        rows, columns = np.nonzero((self.picture() == colour).all(axis=2))
        if len(rows) == 0:
            return None
        return columns.min(), rows.min(), columns.max(), rows.max()

    def wait_for(self, colour, timeout_s=PATIENCE_S, there=True):
        """Wait until a colour is there and rests, or (there=False) is nowhere; return its place."""
        end_s = time.monotonic() + timeout_s
        last = ()
        while time.monotonic() < end_s:
            place = self.find(colour)
            if (place is None and not there) or (there and place and place == last):
                return place
            last = place
            time.sleep(0.2)
        raise AssertionError(f"colour {colour} {'not' if there else 'still'} on the screen")

    # ---- mouse and keys

    def do(self, *arguments):
        """Run xdotool."""
        subprocess.run(
            ["xdotool", *(str(argument) for argument in arguments)],
            env=self.environment,
            timeout=60,
            check=True,
        )
        time.sleep(_REST_S)

    def move(self, x, y):
        """Move the mouse."""
        self.do("mousemove", int(x), int(y))

    def click(self, x, y, button=1):
        """Click; 4 and 5 are the wheel."""
        self.move(x, y)
        self.do("click", button)

    def key(self, name):
        """Press a key."""
        self.do("key", name)

    def drag(self, start, stop, held=None):
        """Drag with the left button, while a key is held, say "shift"."""
        self.move(*start)
        if held:
            self.do("keydown", held)
        self.do("mousedown", 1)
        for part in np.linspace(0.0, 1.0, 6)[1:]:
            x, y = np.asarray(start) + part * (np.asarray(stop) - start)
            subprocess.run(
                ["xdotool", "mousemove", str(int(x)), str(int(y))],
                env=self.environment,
                check=True,
            )
            time.sleep(_STEP_S)
        time.sleep(_REST_S)
        self.do("mouseup", 1)
        if held:
            self.do("keyup", held)


def style_sheet(folder, names, tables=()):
    """Write colours (name: colour) for widgets that are looked for, while they can be used."""
    rules = [  # without a frame of its own the background has one colour only
        f"#{name}:enabled {{background: rgb{colour}; border: 0px}}"
        for name, colour in names.items()
    ]
    for name, colour in dict(tables).items():
        rules.append(f"#{name}:enabled {{background: rgb{colour}}}")  # below the rows
    path = Path(folder) / "colours.qss"
    path.write_text("\n".join(rules), encoding="utf-8")
    return path


def middle(place):
    """Return the middle of (left, top, right, bottom)."""
    left, top, right, bottom = place
    return (left + right) // 2, (top + bottom) // 2


def end(program, timeout_s=20.0):
    """End a program that was started here, as Ctrl-C does; if it stays, make it."""
    program.send_signal(signal.SIGINT)
    try:
        program.wait(timeout_s)
    except subprocess.TimeoutExpired:
        program.kill()
        program.wait()
