"""RViz with `dataset_playback`, used at random: does anything die, stop, or grow?

    python3 tests/benchmarks/rviz_at_random.py --minutes 60

A dataset is opened as users do (`dataset_playback.launch`) on a screen of its own. Mouse and keys
do what chance draws: turn the view, choose points and label them, click, draw and drag in the
images, press buttons, go through the collections, undo, save. Once a minute the memory of the nodes
is noted. In the end the key that quits is pressed: the launch must end well, what was saved last
must be a dataset with all its collections. Exits with 1 otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Dict, Tuple

import numpy as np

_ROOT = Path(__file__).resolve().parents[2]
for _folder in ("atom_rviz_plugins", "atom_calibration"):
    sys.path.insert(0, str(_ROOT / _folder / "tests"))

from live_scene import Process  # noqa: E402
from masters import running_master  # noqa: E402
from node_memory import memory_mb  # noqa: E402
from screen import Screen, middle  # noqa: E402
from waiting import until  # noqa: E402

from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic.memory import Sampling  # noqa: E402
from atom_core.synthetic.scenes import random_scene  # noqa: E402

SIZE = (1400, 900)
# Where mouse and keys are used, (left, top, right, bottom), and how often: the page of the panel,
# the view and the three images, without what closes or collapses them.
AREAS = {
    (12, 155, 472, 805): 2,
    (510, 90, 985, 860): 5,
    (1025, 110, 1390, 340): 2,
    (1025, 375, 1390, 600): 2,
    (1025, 635, 1390, 865): 2,
}
KEYS = ("Right", "Left", "l", "m", "r", "p", "b", "c", "u", "d", "s", "f", "Escape", "Return")
KEYS += ("BackSpace", "1", "2", "3", "4", "z", "n", "ctrl+3")
STARTS_WITHIN_S, ENDS_WITHIN_S, SETTLED_MIN = 180.0, 120.0, 10.0


def main() -> int:
    """Use it, and print what became of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path, help="of the screen before the end")
    args = parser.parse_args()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        os.environ.update(stack.enter_context(running_master(folder)))
        scene = random_scene(3, collections=6, sampling=Sampling(background_step=1))
        dataset = write_dataset_folder(scene.dataset, folder / "data", name="scene")
        use = _Use(dataset, stack, np.random.default_rng(args.seed))
        figures = use.go_on(args.minutes)
        if args.picture:
            use.screen.save(args.picture)
        code = use.quit() if figures["running"] else None
        figures["exit_code"] = code
        figures["saved_whole"] = _is_whole(dataset)
    print(json.dumps(figures))
    return int(code != 0 or not figures["saved_whole"])


def _is_whole(dataset: Path) -> bool:
    """Tell whether what was saved, if anything was, has every collection of the dataset."""
    saved = dataset.with_name(f"{dataset.stem}_corrected.json")
    before = read_dataset(dataset)
    return not saved.exists() or list(read_dataset(saved).collections) == list(before.collections)


class _Use:
    """A launch that is used at random."""

    def __init__(self, dataset: Path, stack: ExitStack, rng: np.random.Generator):
        self.screen = Screen(*SIZE)
        stack.callback(self.screen.close)
        os.environ.update(self.screen.environment)
        words = ("roslaunch", "atom_calibration", "dataset_playback.launch")
        self._launch = Process(*words, f"dataset:={dataset}")
        stack.callback(self._launch.end)
        until(lambda: self.screen.has_window("RViz"), "RViz", STARTS_WITHIN_S)
        self._rng = rng
        time.sleep(10.0)  # until its panes are laid out

    def go_on(self, minutes: float) -> Dict[str, Any]:
        """Use it for so long; return what was seen."""
        begin_s = time.monotonic()
        actions, memory = 0, []
        while self._launch.is_running() and time.monotonic() < begin_s + 60.0 * minutes:
            self._act()
            actions += 1
            if time.monotonic() > begin_s + 60.0 * len(memory):
                memory.append(memory_mb("/rviz_at_random"))
                print(actions, memory[-1], flush=True)
        settled = memory[min(int(SETTLED_MIN), len(memory) // 2)]
        growth = {name: memory[-1].get(name, np.nan) / settled[name] - 1.0 for name in settled}
        return {"actions": actions, "running": self._launch.is_running(), "growth": growth}

    def _act(self) -> None:
        kind = self._rng.choice(["key", "key", "click", "drag", "wheel"])
        start, stop = self._places()
        if kind == "key":
            self.screen.move(*start)
            self.screen.key(self._rng.choice(KEYS))
        elif kind == "click":
            self.screen.click(*start, button=self._rng.choice([1, 1, 1, 3]))
            self.screen.key("Escape")  # a menu that is open
        elif kind == "wheel":
            self.screen.click(*start, button=self._rng.choice([4, 5]))
        else:
            near = start + (stop - start) * self._rng.uniform(0.05, 0.6)
            self.screen.drag(start, near, held=self._rng.choice([None, None, "shift"]))

    def _places(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return two places in one area."""
        weights = np.array(list(AREAS.values()), float)
        area = np.array(list(AREAS))[self._rng.choice(len(AREAS), p=weights / weights.sum())]
        first, second = self._rng.uniform(area[:2], area[2:], (2, 2))
        return first, second

    def quit(self) -> int:
        """Press the key, with the mouse in the view; return the exit code of the launch."""
        until(self._is_ended_by_a_key, "the end", ENDS_WITHIN_S)
        return int(self._launch.wait(ENDS_WITHIN_S))

    def _is_ended_by_a_key(self) -> bool:
        self.screen.move(*middle(list(AREAS)[1]))
        self.screen.key("Escape")
        self.screen.key("ctrl+3")
        self.screen.key("q")
        time.sleep(2.0)
        return not self._launch.is_running()


if __name__ == "__main__":
    sys.exit(main())
