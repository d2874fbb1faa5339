"""Typical mistakes of newcomers, made on purpose: what is typed, and what the programs answer.

`test_troubleshooting.py` compares the answers with docs/troubleshooting.md, which
`docs/make_troubleshooting.py` writes from them. All share one small dataset and one small rig.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Callable, List, NamedTuple
from unittest import mock

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "atom_calibration" / "tests"))  # the small rig and its messages

from atom_core import cli  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

CORE, COLLECT, CONFIGURE = "python3 -m atom_core", "collect_from_bag", "configure_calibration_pkg"
CORRECT = "transform_corrector"
PROGRAM = ("atom_core: ", *(f"{name}: " for name in (*cli.COMMANDS, COLLECT, CONFIGURE, CORRECT)))
FULL_DISK = "the disk is full"


class Answer(NamedTuple):
    """What a program said, and its exit code."""

    code: int
    sentence: str


class Mistake(NamedTuple):
    """One mistake.

    Attributes:
        what: what the user did.
        line: what was typed, in the folder of the small files.
        prepare: makes the mistake in those files; undone afterwards.
        code: the exit code that is due.
        begins: where the sentence begins in what is said; empty: the last line of stderr.
    """

    what: str
    line: str
    prepare: Callable[[Path], None] = lambda _folder: None
    code: int = 2
    begins: str = ""


def edited(name: str, old: str, new: str) -> Callable[[Path], None]:
    """Return what replaces a text in a file, which must be in it."""

    def edit(folder: Path) -> None:
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{name} has no {old!r}"
        path.write_text(text.replace(old, new), encoding="utf-8")

    return edit


def changed(change: Callable[[dict], None]) -> Callable[[Path], None]:
    """Return what changes the dataset's document."""

    def edit(folder: Path) -> None:
        path = folder / "data" / "dataset.json"
        document = json.loads(path.read_text(encoding="utf-8"))
        change(document)
        path.write_text(json.dumps(document), encoding="utf-8")

    return edit


def _old(document: dict) -> None:
    document["_metadata"]["version"] = "2.0"


def _swapped(document: dict) -> None:
    (pattern,) = document["calibration_config"]["calibration_patterns"].values()
    pattern["dimension"] = {"x": pattern["dimension"]["y"], "y": pattern["dimension"]["x"]}
    document.pop("patterns", None)  # written by the collector, from the same configuration


def _in_mm(document: dict) -> None:
    (pattern,) = document["calibration_config"]["calibration_patterns"].values()
    for key in ("size", "inner_size"):
        pattern[key] *= 1000.0
    document.pop("patterns", None)


def _cut(folder: Path) -> None:
    path = folder / "data" / "dataset.json"
    # by lines: the name of the user and the time, which stand in it, are of any length
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:4080]))


def _without_data(folder: Path) -> None:
    for path in (folder / "data").glob("lidar_1_*"):
        path.unlink()


def _occupied(folder: Path) -> None:
    (folder / "results").mkdir()
    (folder / "results" / "calibration.json").write_text("{}", encoding="utf-8")


def _written(name: str, text: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")

    return write


def _cut_bag(folder: Path) -> None:
    path = folder / "rig.bag"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _empty_bag(folder: Path) -> None:
    import rosbag

    with rosbag.Bag(str(folder / "rig.bag"), "w"):
        pass


CHECK = "check --dataset data/dataset.json"
CALIBRATE = "calibrate --dataset data/dataset.json --output results"
EVALUATE = "evaluate --train data/dataset.json --test data/dataset.json --output evaluation"
COLLECT_LINE = "--config config.yml --bag rig.bag --output collected"
OF_DATASETS = [
    Mistake("the wrong folder", "check --dataset date/dataset.json"),
    Mistake("the folder in place of the file", "check --dataset data"),
    Mistake("the configuration in place of the dataset", "check --dataset config.yml"),
    Mistake("no dataset", "calibrate --output results"),
    Mistake("a launch file without its arguments", "calibrate --dataset '' --output results"),
    Mistake("a typo in a command", "calibrat --dataset data/dataset.json"),
    Mistake("a typo in an option", f"{CALIBRATE} --anchor_sensor_s rgb_1"),
    Mistake("a typo in a sensor's name", f"{CALIBRATE} -ssf rgb_1 rgb_9"),
    Mistake("a collection that is not there", f"{CALIBRATE} -csf 999"),
    Mistake("a sensor to hold that is not there", f"{CALIBRATE} -as camera_7"),
    Mistake("results of an earlier run in the way", CALIBRATE, _occupied),
    Mistake(
        "a file in place of the output folder",
        f"{CHECK.replace('check', 'calibrate')} -o a.txt",
        _written("a.txt", "mine"),
    ),
    Mistake("images and clouds not copied along", CHECK, _without_data, 1, "problem: "),
    Mistake("a file that was cut off", CHECK, _cut),
    Mistake("a dataset of version 2", CHECK, changed(_old)),
    Mistake("columns and rows of the board exchanged", CHECK, changed(_swapped), 1, "verdict: "),
    Mistake("the board's size in mm", f"{CHECK} -ssf 'rgb_*'", changed(_in_mm), 1, "verdict: "),
    Mistake("the dataset evaluated before it is calibrated", EVALUATE, code=0, begins="verdict: "),
    Mistake("a pair with an unknown sensor", f"{EVALUATE} --pairs rgb_1:gps"),
    Mistake("a truth that is not there", f"{CALIBRATE} --truth truth.json"),
    Mistake("one LiDAR alone", f"{CALIBRATE} -ssf lidar_1"),
    Mistake(FULL_DISK, CALIBRATE),
]
OF_RECORDINGS = [
    Mistake(
        "a typo in a topic", COLLECT_LINE, edited("config.yml", "/lidar/points", "/lidar/pionts")
    ),
    Mistake(
        "a typo in a frame", COLLECT_LINE, edited("config.yml", "camera_optical", "camera_optic")
    ),
    Mistake("the wrong modality", COLLECT_LINE, edited("config.yml", '"lidar3d"', '"rgb"')),
    Mistake("an unknown modality", COLLECT_LINE, edited("config.yml", '"lidar3d"', '"lidar"')),
    Mistake(
        "the board's size in mm in config.yml",
        COLLECT_LINE,
        edited("config.yml", "size: 0.06", "size: 60"),
        begins="collect_from_bag: warning: ",
    ),
    Mistake("a tab in config.yml", COLLECT_LINE, edited("config.yml", "  camera:", "\tcamera:")),
    Mistake(
        "a line forgotten in config.yml",
        COLLECT_LINE,
        edited("config.yml", '    child_link: "lidar_base"\n', ""),
    ),
    Mistake("an empty bag", COLLECT_LINE, _empty_bag),
    Mistake("a bag that was cut off", COLLECT_LINE, _cut_bag),
    Mistake("no bag at all, but another file", COLLECT_LINE, _written("rig.bag", "no bag")),
    Mistake(
        "a recording of ROS 2",
        COLLECT_LINE.replace("rig.bag", "ros2"),
        _written("ros2/metadata.yaml", "a: 1"),
    ),
    Mistake("a bag without the board", COLLECT_LINE),
]
OF_PROGRAMS = [
    Mistake("the environment is not loaded", "python3 -I ATOM_CORE check"),
    Mistake(
        "no ROS master, or ROS_MASTER_URI of another one",
        "transform_corrector --json data/dataset.json -pll lidar_1_post -cll lidar_1_base_link",
    ),
]
OF_CONFIGURE = [
    Mistake(
        "a description that is not there",
        "-n package",
        edited("package/calibration/config.yml", "rig.urdf.xacro", "robot.urdf"),
    ),
    Mistake(
        "a mount that the description does not have",
        "-n package",
        edited("package/calibration/config.yml", 'child_link: "bumper"', 'child_link: "bumpr"'),
    ),
]
EVERY = {
    "With a dataset": (CORE, OF_DATASETS),
    "With a recording": (f"rosrun atom_calibration {COLLECT}", OF_RECORDINGS),
    "With a calibration package": (f"rosrun atom_calibration {CONFIGURE}", OF_CONFIGURE),
    "With the shell": ("", OF_PROGRAMS),
}


class SmallFiles:
    """A dataset, a configuration, a recording and a calibration package, made once."""

    def __init__(self, folder: Path):
        """Write them.

        Args:
            folder: in which they, and copies of them, are made.
        """
        from messages import Make
        from small_rig import write_package

        self._folder, self._kept = folder, folder / "kept"
        scene = scenes.random_scene(
            0, rgb=2, depth=0, lidar3d=1, collections=5, disturbance=(0.1, 0.1)
        )
        write_dataset_folder(scene.dataset, self._kept / "data", name="data")
        package = write_package(folder / "written", Make, seconds=2.0)
        shutil.copytree(package, self._kept / "package")
        for name in ("config.yml", "rig.urdf.xacro", "rig.bag"):
            shutil.copy(package / "calibration" / name, self._kept / name)

    def answer(self, program: str, mistake: Mistake) -> Answer:
        """Make a mistake in a copy of the files; return what the program says."""
        work = self._folder / "work"
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(self._kept, work)
        before = Path.cwd()
        os.chdir(work)
        try:
            mistake.prepare(work)
            code, out, err = _run(program, mistake)
        finally:
            os.chdir(before)
        every = err.splitlines() if not mistake.begins else [*err.splitlines(), *out.splitlines()]
        said = [line for line in every if line.startswith(mistake.begins or PROGRAM)]
        if not mistake.begins:
            said = [line for line in said if "warning: " not in line]
        return Answer(code, _plain("\n".join(said), work))


def _plain(text: str, work: Path) -> str:
    """Return a text without the places of this machine."""
    places = rf"looked for at ({work.resolve()}|{work})/"
    text = re.sub(places, "looked for at /home/me/cell/", text)
    text = text.replace(f"{work.resolve()}{os.sep}", "").replace(f"{work}{os.sep}", "")
    return re.sub(r"http://localhost:\d+", "http://localhost:11311", text)


def _run(program: str, mistake: Mistake):
    """Return exit code, stdout and stderr of a mistake's line, in this process where it can be."""
    words = shlex.split(mistake.line)
    if not program:
        return _run_beside(words)
    if program == CORE:
        run = lambda: cli.main(words)  # noqa: E731
    elif program.endswith(COLLECT):
        from atom_calibration.nodes.collecting.collect_from_bag import main

        run = lambda: main(words)  # noqa: E731
    else:
        from atom_calibration.configure.configure_package import main as configure

        run = lambda: configure(words)  # noqa: E731
    out, err = io.StringIO(), io.StringIO()
    full = mock.patch.object(os, "fsync", side_effect=OSError(28, "No space left on device"))
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        if mistake.what == FULL_DISK:
            stack.enter_context(full)
        try:
            code = run()
        except SystemExit as end:
            code = int(end.code or 0)
    return code, out.getvalue(), err.getvalue()


def _run_beside(words: List[str]):
    """Run a program of its own, where no master answers."""
    if words[0] == "python3":
        command = [
            sys.executable,
            *(w.replace("ATOM_CORE", str(ROOT / "atom_core")) for w in words[1:]),
        ]
    else:
        command = [
            sys.executable,
            str(ROOT / "atom_calibration" / "scripts" / words[0]),
            *words[1:],
        ]
    variables = {**os.environ, "ROS_MASTER_URI": "http://localhost:1"}
    done = subprocess.run(
        command, env=variables, capture_output=True, text=True, check=False, timeout=60
    )
    return done.returncode, done.stdout, done.stderr
