"""Does every click into a picture in RViz arrive, once and where it was? Many, on a busy machine.

    python3 tests/benchmarks/rviz_clicks.py --clicks 1000 --busy 4

RViz shows the plugins' test scene on a screen of its own (Xvfb). The mouse is moved to places of
the picture drawn by chance and clicks there at once, as fast as answers come; what arrives on
`mouse_click` is compared with the pixel. `--busy`: so many processes that only compute run beside.
Prints how the clicks ended and how long they took; exits with 1 when one was lost, came twice or
came from elsewhere.
"""

from __future__ import annotations

import argparse
import os
import queue
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import List, Tuple

import numpy as np

_ROOT = Path(__file__).resolve().parents[2]
for _folder in ("atom_rviz_plugins", "atom_calibration"):
    sys.path.insert(0, str(_ROOT / _folder / "tests"))

from masters import running_master  # noqa: E402
from scene import BLOCK, BLOCK_PX, IMAGE_SIZE, Scene  # noqa: E402
from screen import Screen, end, middle, style_sheet  # noqa: E402

LAYOUT = _ROOT / "atom_rviz_plugins" / "tests" / "plugins.rviz"
BUTTON = (1, 200, 100)  # the colour given to the button that turns clicks on
LOST_AFTER_S = 60.0
EDGE_PX = 8  # of the picture, that the pane may cut


def main() -> int:
    """Click, count, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clicks", type=int, default=1000)
    parser.add_argument("--busy", type=int, default=4, help="processes that compute beside")
    parser.add_argument("--seed", type=int, default=0, help="of the places")
    args = parser.parse_args()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        os.environ.update(stack.enter_context(running_master(folder)))
        for _ in range(args.busy):
            busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        pane = _Pane(folder, stack)
        rng = np.random.default_rng(args.seed)
        ends: Counter = Counter()
        seconds: List[float] = []
        for number in range(args.clicks):
            became, took_s = pane.click(rng)
            ends[became] += 1
            seconds.append(took_s)
            if number % 100 == 99 or became != "right":
                print(number + 1, dict(ends), flush=True)
    half_s, most_s = np.percentile(seconds, [50, 99])
    print(
        f"{dict(ends)}; from the mouse to the message {half_s:.2f} s (median), {most_s:.2f} s (1 %)"
    )
    return int(set(ends) != {"right"})


class _Pane:
    """The picture in RViz, and what is heard of clicks into it."""

    def __init__(self, folder: str, stack: ExitStack):
        import rospy
        from geometry_msgs.msg import PointStamped

        rospy.init_node("rviz_clicks", disable_signals=True)
        self._heard: queue.Queue = queue.Queue()
        rospy.Subscriber("/camera/labeled/mouse_click", PointStamped, self._heard.put)
        self._scene = Scene()  # publishes until the end
        self._screen = Screen()
        stack.callback(self._screen.close)
        style = style_sheet(folder, {"click_mode": BUTTON})
        words = ["-d", str(LAYOUT), "-stylesheet", str(style)]
        rviz = self._screen.run_rviz(words, subprocess.DEVNULL)
        stack.callback(end, rviz)
        self._screen.click(*middle(self._screen.wait_for(BUTTON)))
        left, top, right, _ = self._screen.wait_for(BLOCK)
        self._scale = (right - left + 1) / BLOCK_PX[2]  # screen pixels for a pixel
        self._corner = np.array([left, top]) - self._scale * np.array(BLOCK_PX[:2])

    def click(self, rng: np.random.Generator) -> Tuple[str, float]:
        """Click somewhere; return what became of it, and when [s]."""
        height, width = IMAGE_SIZE
        pixel = rng.uniform(EDGE_PX, [width - EDGE_PX, height - EDGE_PX])
        place = np.floor(self._corner + self._scale * pixel).astype(int)
        words = ["xdotool", "mousemove", *map(str, place), "click", "1"]
        begin = time.monotonic()
        subprocess.run(words, env=self._screen.environment, timeout=LOST_AFTER_S, check=True)
        try:
            point = self._heard.get(timeout=LOST_AFTER_S).point
        except queue.Empty:
            return "lost", time.monotonic() - begin
        took_s = time.monotonic() - begin
        truth = (place + 0.5 - self._corner) / self._scale - 0.5
        if np.abs(np.subtract((point.x, point.y), truth)).max() > 1.1 / self._scale:
            return "from elsewhere", took_s
        time.sleep(0.02)
        return ("right" if self._heard.empty() else "twice"), took_s


if __name__ == "__main__":
    sys.exit(main())
