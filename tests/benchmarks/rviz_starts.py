"""How often RViz dies while it starts: many starts on a screen whose server comes late.

    python3 tests/benchmarks/rviz_starts.py --starts 100            # as the launch files start it
    python3 tests/benchmarks/rviz_starts.py --starts 100 --plain    # nothing is preloaded

Each start has the layout of the simulated cell (a scene and four images, five windows that are
rendered into), its window is waited for, and it is stopped as by Ctrl-C. The X server has the
lowest priority; for it to come late the machine has to be busy: several starts at a time
(`--parallel`), or other work beside. No message is needed. Exits with 1 when one has died.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
for _folder in ("atom_rviz_plugins", "atom_calibration"):
    sys.path.insert(0, str(_ROOT / _folder / "tests"))

from masters import running_master  # noqa: E402
from screen import Screen  # noqa: E402

from atom_calibration.runtime.rviz_window import X11_SYNC  # noqa: E402

LAYOUT = _ROOT / "atom_examples" / "rviz" / "collab_cell_simulation.rviz"
PATIENCE_S = 120.0
LAST = 19  # the lowest priority that there is


def main() -> int:
    """Start, count, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--parallel", type=int, default=3, help="so many at a time")
    parser.add_argument("--layout", type=Path, default=LAYOUT)
    parser.add_argument("--plain", action="store_true", help="preload nothing")
    args = parser.parse_args()
    preloaded = "" if args.plain else X11_SYNC
    ends: Counter = Counter()
    with tempfile.TemporaryDirectory() as home, running_master(home) as environment:
        os.environ.update(environment)
        with ThreadPoolExecutor(args.parallel) as pool:
            starts = (
                pool.submit(end_of_a_start, number, args.layout, preloaded)
                for number in range(args.starts)
            )
            for start in list(starts):
                ends[start.result()] += 1
                print(dict(ends), flush=True)
    return int(set(ends) != {"clean"})


def end_of_a_start(number: int, layout: Path, preloaded: str) -> str:
    """Return "clean", or what became of it and when."""
    screen = Screen()
    try:
        os.setpriority(os.PRIO_PROCESS, screen.server_pid, LAST)
        rviz = subprocess.Popen(
            ["rviz", "-d", str(layout), f"__name:=rviz_{number}"],
            env={**screen.environment, "LD_PRELOAD": preloaded},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            shown = _wait_for_window(screen, rviz)
            rviz.send_signal(signal.SIGINT)
            code = rviz.wait(PATIENCE_S)
        finally:
            rviz.kill()
            rviz.wait()
    finally:
        screen.close()
    if code == 0 and shown:
        return "clean"
    return f"exit code {code}, {'after' if shown else 'before'} its window was there"


def _wait_for_window(screen: Screen, rviz: subprocess.Popen) -> bool:
    end_s = time.monotonic() + PATIENCE_S
    while rviz.poll() is None and time.monotonic() < end_s:
        if screen.has_window("RViz$"):
            return True
        time.sleep(0.2)
    return False


if __name__ == "__main__":
    sys.exit(main())
