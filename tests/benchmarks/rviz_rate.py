"""How many frames a second RViz draws with the plugins and without, on the same scene.

The scene is a cloud of 131,072 points, ten times a second, as a LiDAR of 128 layers sends it, and a
camera's picture. Three RViz show it, each on a screen of its own: nothing but the cloud; cloud and
RViz's own image display; cloud, and all our plugins with the point tool in the hand. They run in
turns of a few seconds, the others stopped (SIGSTOP), so that what else the machine does strikes
them alike; frames are counted inside of RViz (frame_counter.cpp); their rate is not limited.
Rendering is by the CPU (llvmpipe) where there is no graphics card.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, List, NamedTuple

import numpy as np
import yaml

_HERE = Path(__file__).resolve().parent
for package in ("atom_calibration", "atom_rviz_plugins"):
    sys.path.insert(0, str(_HERE.parents[1] / package / "tests"))

from masters import running_master  # noqa: E402
from screen import Screen, end  # noqa: E402

from atom_calibration.runtime.rviz_window import X11_SYNC  # noqa: E402

BACKGROUND, POINTS = (11, 22, 33), (0, 255, 0)
VIEW_SIZE = (900, 700)  # of what is rendered; panels and images stand beside it
TURN_S, SETTLE_S = 2.0, 0.7
_WINDOW_SIZE, _SCREEN_SIZE = (1300, 850), (1700, 1000)
CLOUD_ONLY, STOCK, PLUGINS = "cloud alone", "with RViz's image display", "with our plugins"


class Rate(NamedTuple):
    """What one RViz did in its turns."""

    name: str
    frames: int
    per_second: np.ndarray  # of each turn
    cpu_ms: float  # of a frame, all threads


def rviz_rates(turns: int = 15) -> List[Rate]:
    """Measure the three; needs RViz, Xvfb and a built workspace on the environment."""
    with tempfile.TemporaryDirectory() as name, running_master(name) as environment:
        os.environ.update(environment)
        folder = Path(name)
        counter = _compile(folder)
        shown: List[_Shown] = []
        feed = None
        try:
            feed = subprocess.Popen([sys.executable, str(_HERE / "rviz_feed.py")])
            for label in (CLOUD_ONLY, STOCK, PLUGINS):
                shown.append(_Shown(label, folder, counter))
            for one in shown:
                one.wait_for_cloud()
                one.stop()
            for turn in range(turns):
                for one in shown if turn % 2 else reversed(shown):
                    one.take_turn()
            return [one.rate() for one in shown]
        finally:
            for one in shown:
                one.close()
            if feed is not None:
                end(feed)


def _compile(folder: Path) -> Path:
    library = folder / "frame_counter.so"
    source = str(_HERE / "frame_counter.cpp")
    subprocess.run(
        ["g++", "-O2", "-shared", "-fPIC", source, "-o", str(library), "-ldl"], check=True
    )
    return library


class _Shown:
    """One RViz on a screen of its own."""

    def __init__(self, name: str, folder: Path, counter: Path):
        self.name = name
        stem = name.replace(" ", "_").replace("'", "")
        self._frames_file = folder / f"{stem}.frames"
        layout = folder / f"{stem}.rviz"
        layout.write_text(yaml.safe_dump(_layout(name), sort_keys=False), encoding="utf-8")
        self._screen = Screen(*_SCREEN_SIZE)
        preloaded = f"{X11_SYNC} {counter}"
        self._screen.environment.update(LD_PRELOAD=preloaded, ATOM_FRAMES=str(self._frames_file))
        self._process = self._screen.run(
            ["rviz", "-d", str(layout), f"__name:=rviz_{stem}"], subprocess.DEVNULL
        )
        self._turns: List[np.ndarray] = []

    def wait_for_cloud(self) -> None:
        """Wait until the cloud is on the screen, and make the view as large as the others'."""
        left, top, right, bottom = self._screen.wait_for(BACKGROUND, timeout_s=120)
        width = _WINDOW_SIZE[0] + VIEW_SIZE[0] - (right - left + 1)
        height = _WINDOW_SIZE[1] + VIEW_SIZE[1] - (bottom - top + 1)
        words = ["search", "--sync", "--onlyvisible", "--name", "RViz$"]
        self._screen.do(*words, "windowsize", width, height)
        left, top, right, bottom = self._screen.wait_for(BACKGROUND)
        if (right - left + 1, bottom - top + 1) != VIEW_SIZE:
            raise RuntimeError(f"RViz {self.name}: the view is not {VIEW_SIZE}")
        self._screen.wait_for(POINTS, timeout_s=60)

    def take_turn(self) -> None:
        """Draw for some seconds, and note the frames after the first moments."""
        self._process.send_signal(signal.SIGCONT)
        time.sleep(SETTLE_S)
        begin = len(self._frames())
        time.sleep(TURN_S)
        self._turns.append(self._frames()[begin:])
        self.stop()

    def stop(self) -> None:
        """Let the others work."""
        self._process.send_signal(signal.SIGSTOP)

    def rate(self) -> Rate:
        """Sum up the turns."""
        spans = [turn for turn in self._turns if len(turn) > 1]
        if len(spans) < len(self._turns):
            raise RuntimeError(f"RViz {self.name}: a turn without frames")
        steps = [np.diff(turn, axis=0) for turn in spans]
        return Rate(
            self.name,
            sum(len(turn) for turn in spans),
            np.array([1.0 / step[:, 0].mean() for step in steps]),
            1e3 * float(np.concatenate(steps)[:, 1].mean()),
        )

    def close(self) -> None:
        """End RViz and its screen."""
        self._process.send_signal(signal.SIGCONT)
        end(self._process)
        self._screen.close()

    def _frames(self) -> np.ndarray:
        data = self._frames_file.read_bytes()
        return np.frombuffer(data[: len(data) // 16 * 16]).reshape(-1, 2)


_CLOUD = {
    "Class": "rviz/PointCloud2",
    "Name": "Cloud",
    "Enabled": True,
    "Topic": "/lidar/points",
    "Color Transformer": "FlatColor",
    "Color": "; ".join(map(str, POINTS)),
    "Style": "Points",
    "Size (Pixels)": 2,
    "Alpha": 1,
}
_PICTURES = {
    STOCK: {"Class": "rviz/Image", "Image Topic": "/camera/labeled"},
    PLUGINS: {"Class": "atom_rviz_plugins/ImageLabelDisplay", "Topic": "/camera/labeled"},
}
_VIEW = {"Class": "rviz/Orbit", "Name": "Current View", "Distance": 12, "Pitch": 0.6, "Yaw": 0.8}


def _layout(name: str) -> Dict:
    displays: List[Dict] = [_CLOUD]
    panels: List[Dict] = []
    tools = [{"Class": "rviz/Interact"}]
    if name in _PICTURES:
        displays.append({"Name": "Picture", "Enabled": True, **_PICTURES[name]})
    if name == PLUGINS:
        panels.append({"Class": "atom_rviz_plugins/AtomPanel", "Name": "ATOM", "Page": 0})
        tools = [
            {"Class": "atom_rviz_plugins/PointLabelTool"},  # the first one is in the hand
            {"Class": "atom_rviz_plugins/SeedTool"},
            *tools,
        ]
    return {
        "Panels": panels,
        "Visualization Manager": {
            "Displays": displays,
            "Global Options": {
                "Fixed Frame": "lidar",
                "Frame Rate": 1000,
                "Background Color": "; ".join(map(str, BACKGROUND)),
            },
            "Tools": tools,
            "Views": {"Current": _VIEW},
        },
        "Window Geometry": {
            "X": 0,
            "Y": 0,
            "Width": _WINDOW_SIZE[0],
            "Height": _WINDOW_SIZE[1],
            "Hide Left Dock": False,
            "Hide Right Dock": True,
        },
    }
