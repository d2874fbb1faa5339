"""Take pictures of the screens of each step: `python3 docs/make_screens.py BAG`.

BAG is a recording of the simulated cell, `rosrun atom_examples cell_simulator --bag BAG`. Each step
runs by its launch file on a screen of its own; ``pictures/step_<step>.jpg`` shows RViz.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import cv2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "atom_rviz_plugins" / "tests"))

from screen import Screen  # noqa: E402

LAUNCH = ROOT / "atom_examples" / "collab_cell" / "launch"
CORRECTOR = ROOT / "atom_calibration" / "launch" / "transform_corrector.launch"
FOLDER = Path(__file__).resolve().parent / "pictures"
PORT = 11791
WIDTH_PX, QUALITY = 1100, 80
WAIT_S = {
    "collect": 110.0,
    "first_guess": 45.0,
    "playback": 25.0,
    "calibrate": 35.0,
    "transform_corrector": 25.0,
}


def main() -> None:
    """Take one picture of each step."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("bag", type=Path)
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="DIR")
    parser.add_argument("--size", type=int, nargs=2, default=(1600, 1000), metavar="PX")
    parser.add_argument("--width", type=int, default=WIDTH_PX, metavar="PX", help="of a picture")
    parser.add_argument("--only", choices=list(WAIT_S), nargs="+", help="these steps")
    parser.add_argument("--dataset", type=Path, metavar="FILE", help="in place of collecting")
    parser.add_argument("--prefix", default="step", help="how the names of the files begin")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for step, words in steps(args.bag.resolve(), args.dataset, Path(folder)).items():
            if step in (args.only or WAIT_S):
                path = args.output / f"{args.prefix}_{step}.jpg"
                take(words, WAIT_S[step], (args.size, args.width), path, Path(folder))
                print(path)  # noqa: T201


def steps(bag: Path, dataset: Optional[Path], folder: Path) -> Dict[str, List[str]]:
    """Return the launch file of each step, with its arguments."""
    collected = folder / "train" / "dataset.json"
    dataset = (dataset or collected).resolve()
    return {
        "collect": [
            *(f"{LAUNCH}/collect_data.launch", f"bag_file:={bag}"),
            *(f"output_folder:={collected.parent}", "automatic:=true", "bag_rate:=0.4"),
        ],
        "first_guess": [
            *(f"{LAUNCH}/set_initial_estimate.launch", f"bag_file:={bag}", "bag_rate:=0.3"),
            f"output_file:={folder / 'guess.urdf.xacro'}",
        ],
        "playback": [
            *(f"{LAUNCH}/dataset_playback.launch", f"dataset:={dataset}"),
            f"output:={folder / 'dataset_corrected.json'}",
        ],
        "calibrate": [
            *(f"{LAUNCH}/calibrate.launch", f"dataset:={dataset}"),
            f"output:={folder / 'calibration'}",
        ],
        "transform_corrector": [
            *(str(CORRECTOR), f"json:={dataset}", "overwrite:=true"),
            *("parents:=rectangularbeam3_gantry", "children:=lidar_1_base_link"),
        ],
    }


def take(words: List[str], wait_s: float, sizes: Tuple, path: Path, folder: Path) -> None:
    """Run a launch file on a screen; write what it shows after a while.

    Args:
        words: the launch file with its arguments.
        wait_s: how long to wait.
        sizes: of the screen (width, height), and width of the picture [px].
        path: of the picture.
        folder: for what is written beside.
    """
    size, width = sizes
    screen = Screen(*size)
    environment = {
        **screen.environment,
        "ROS_MASTER_URI": f"http://localhost:{PORT}",
        "ROS_HOME": str(folder / "ros_home"),
    }
    launch = subprocess.Popen(
        ["roslaunch", "-p", str(PORT), *words],
        env=environment,
        start_new_session=True,
    )
    try:
        time.sleep(wait_s)
        if not screen.is_managed:
            raise SystemExit(f"{path.name}: the window manager has ended; take it again")
        picture = screen.picture()[:, :, ::-1]
        height = round(picture.shape[0] * width / picture.shape[1])
        small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(path), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    finally:
        os.killpg(launch.pid, signal.SIGINT)
        launch.wait(60.0)
        screen.close()


if __name__ == "__main__":
    main()
