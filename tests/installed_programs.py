"""What `test_install_space.py` runs where no sources are: the demo, then RViz with its labels.

Usage: installed_programs.py OUTPUT LIBRARIES (the folder that RViz's plugins must come from)
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

PATIENCE_S = 300.0
PLUGINS = "libatom_rviz_plugins.so"
FAULT = re.compile(r"\[ERROR\]|\[FATAL\]|Traceback|process has died \[|could not be loaded")


def demo(output: Path) -> Path:
    """Run the demo with half its stops; return the dataset that it made."""
    command = ["rosrun", "atom_examples", "demo", "--output", output, "--collections", "10", "6"]
    subprocess.run(command, check=True)
    return output / "train" / "dataset.json"


def rviz_opens(dataset: Path, libraries: Path) -> None:
    """Open a dataset's labels in RViz: its plugins are the installed ones, nothing is wrong."""
    log = dataset.parent / "rviz.log"
    with log.open("w", encoding="utf-8") as stream:
        launch = subprocess.Popen(
            ["roslaunch", "atom_calibration", "dataset_playback.launch", f"dataset:={dataset}"],
            stdout=stream,
            stderr=subprocess.STDOUT,
            env={**os.environ, "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"},
        )
    try:
        loaded = _wait_for_plugins(launch)
        _wait_for_window(launch)
    finally:
        launch.send_signal(signal.SIGINT)
        code = launch.wait(PATIENCE_S)
        said = log.read_text(encoding="utf-8", errors="replace")
        print(said)
    assert loaded == libraries / PLUGINS, loaded
    assert not FAULT.search(said), FAULT.search(said)
    assert code == 0, code


def _wait_for_plugins(launch: subprocess.Popen) -> Path:
    """Return the path of the plugins once a program has loaded them."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s and launch.poll() is None:
        for maps in Path("/proc").glob("[0-9]*/maps"):
            try:
                found = re.search(rf"\S*/{re.escape(PLUGINS)}$", maps.read_text(), re.MULTILINE)
            except OSError:
                continue  # it has ended meanwhile
            if found:
                return Path(found.group())
        time.sleep(0.2)
    raise AssertionError("no program has loaded RViz's plugins")


def _wait_for_window(launch: subprocess.Popen) -> None:
    end_s = time.monotonic() + PATIENCE_S
    search = ["xdotool", "search", "--onlyvisible", "--name", "RViz"]
    while time.monotonic() < end_s and launch.poll() is None:
        if subprocess.run(search, stdout=subprocess.PIPE, check=False).stdout.strip():
            return
        time.sleep(0.2)
    raise AssertionError("there is no window of RViz")


def main() -> int:
    """Run both."""
    output, libraries = map(Path, sys.argv[1:])
    rviz_opens(demo(output), libraries)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
