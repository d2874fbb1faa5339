"""Render what the simulated cell's sensors see: `make pictures-cell`.

``pictures/cell_<sensor>.jpg`` are the cameras and the depth image at a stop that all sensors see;
``pictures/cell_clouds.jpg`` is RViz with the live simulation, drawn by a virtual screen.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Iterator, List

import cv2
import numpy as np

from atom_examples.cell_simulator.planner import is_open, plan_stops, sight
from atom_examples.cell_simulator.world import World

SEED = 0
FOLDER = Path(__file__).resolve().parent / "pictures"
DISPLAY, SCREEN = ":77", "1600x1000x24"
PORT = "11777"
QUALITY, WIDTH = 88, 960
NEAR_M, FAR_M = 0.8, 6.0  # the depth image's colours


def main() -> None:
    """Draw all pictures."""
    world = World(SEED)
    stop = max(plan_stops(world, "train", 23), key=lambda stop: _seen(world, stop))
    world.scene.place_board(stop.world_T_pattern)
    world.scene.place_person(stop.person)
    rng = np.random.default_rng(SEED)
    for name, camera in world.colours.items():
        _write(f"cell_{name}", cv2.cvtColor(camera.capture(world.scene, rng), cv2.COLOR_RGB2BGR))
    for name, depth in world.depths.items():
        _write(f"cell_{name}", _coloured(depth.capture(world.scene, rng)))
    world.scene.close()
    _draw_clouds(FOLDER / "cell_clouds.jpg")


def _seen(world: World, stop) -> int:
    """Return how much all sensors see of the board; they must see it whole and unhidden."""
    world.scene.place_board(stop.world_T_pattern)
    world.scene.place_person(stop.person)
    pattern = world.scene.board.pattern
    lines = [sight(world, name, stop.world_T_pattern, pattern) for name in world.rig.sensors]
    counts = [int(is_open(world, line).sum()) if len(line.goals) else 0 for line in lines]
    return sum(counts) if min(counts) > 0 else 0


def _coloured(depth_m: np.ndarray) -> np.ndarray:
    share = np.clip((np.nan_to_num(depth_m) - NEAR_M) / (FAR_M - NEAR_M), 0.0, 1.0)
    coloured = cv2.applyColorMap((255 * (1.0 - share)).astype(np.uint8), cv2.COLORMAP_TURBO)
    coloured[~np.isfinite(depth_m)] = 0
    return coloured


def _write(name: str, picture: np.ndarray) -> None:
    height = round(picture.shape[0] * WIDTH / picture.shape[1])
    small = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(FOLDER / f"{name}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def _draw_clouds(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder, ExitStack() as running:
        environment = {
            **os.environ,
            "DISPLAY": DISPLAY,
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "QT_X11_NO_MITSHM": "1",
            "ROS_HOME": folder,
            "ROS_MASTER_URI": f"http://localhost:{PORT}",
        }
        screen = ["Xvfb", DISPLAY, "-screen", "0", SCREEN, "+extension", "GLX", "-noreset"]
        running.enter_context(_program(screen, environment))
        time.sleep(2.0)
        running.enter_context(
            _program(
                [
                    "roslaunch",
                    "-p",
                    PORT,
                    "atom_examples",
                    "collab_cell_simulation.launch",
                    "initial_estimate:=exact",
                    f"seed:={SEED}",
                ],
                environment,
            )
        )
        time.sleep(30.0)
        shot = ["import", "-window", "root", "-quality", str(QUALITY), str(path)]
        subprocess.run(shot, env=environment, check=True)


@contextmanager
def _program(command: List[str], environment) -> Iterator[subprocess.Popen]:
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()


if __name__ == "__main__":
    main()
