"""Whoever pulls the plug loses nothing: programs are killed at random moments, then started again.

Ten kills in `make test`, two hundred in `make test-long`.
"""

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rospy")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "atom_calibration" / "tests")]

from killing import Program, contents, files_below  # noqa: E402
from live_scene import COLLECTIONS, LiveScene  # noqa: E402
from masters import running_master  # noqa: E402
from messages import Make  # noqa: E402
from playback_scene import write_scene  # noqa: E402
from small_rig import write_package  # noqa: E402

from atom_core.cli import main as core_main  # noqa: E402
from atom_core.io.dataset_json import read_dataset  # noqa: E402
from atom_core.io.dataset_writer import write_dataset_folder  # noqa: E402
from atom_core.io.together import finish_interrupted  # noqa: E402
from atom_core.synthetic import scenes  # noqa: E402

pytestmark = pytest.mark.slow
NODES = ROOT / "atom_calibration" / "scripts"
CORE = [sys.executable, "-m", "atom_core"]
SEED, _RUN_EVERY = 16, 10


def kills(few, many):
    """Return the parameters of a test: few kills each day, many in `make test-long`."""
    marks = pytest.mark.long(minutes=many / 2)
    return pytest.mark.parametrize("count", [few, pytest.param(many, marks=marks)])


def survive(program, count, after_kill, after_run, stop=lambda *_: None):
    """Kill a program `count` times; now and then, and in the end, let it run to its end.

    Args:
        stop: asks a program to end that would run for ever; see `Program.run`.
    """
    rng, killed = np.random.default_rng(SEED), 0
    whole = program.run(stop)
    after_run(whole)
    while killed < count:
        killed += program.kill(rng, whole)
        after_kill()
        if killed % _RUN_EVERY == 0 or killed == count:
            after_run(program.run(stop))


def asked_when(condition):
    """Return what presses Ctrl-C once for each process, when a condition of the seconds holds."""
    asked = set()

    def ask(process, seconds):
        if process.pid not in asked and condition(seconds):
            asked.add(process.pid)
            process.send_signal(signal.SIGINT)

    return ask


# --- calibrate, evaluate: results of two runs never stand together -----------------------------


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """Return two datasets of one rig."""
    folder = tmp_path_factory.mktemp("datasets")
    return [
        write_dataset_folder(
            scenes.random_scene(seed, rgb=2, depth=0, lidar3d=1, collections=6).dataset,
            folder / str(seed),
            name="killed",
        )
        for seed in (1, 2)
    ]


@pytest.fixture(scope="module")
def calibrated(datasets, tmp_path_factory):
    """Return the results of each dataset: (folder, contents)."""
    folders = [tmp_path_factory.mktemp("calibrated") / path.parent.name for path in datasets]
    for path, folder in zip(datasets, folders):
        words = ["calibrate", "-json", str(path), "-o", str(folder), "--no_report"]
        assert core_main(words) == 0
    return [(folder, contents(folder)) for folder in folders]


class Results:
    """A folder to which two runs write in turn, and of which run the files in it are."""

    def __init__(self, folder, command, runs, marks):
        self.folder, self.runs = folder, runs
        self._marks, self._command = marks, command
        self.program = Program(self._words, folder)

    def _words(self, number):
        words = self._command(number % 2)
        return [*words, "-o", self.folder, "--overwrite", "--no_report"]

    def visible(self):
        return {n: d for n, d in contents(self.folder).items() if not n.startswith(".")}

    def whose(self, name, data):
        """Return the runs of which a file may be."""
        mark = self._marks.get(name, lambda data: data)
        return {n for n, (_, files) in enumerate(self.runs) if mark(files[name]) == mark(data)}

    def common(self):
        """Return the runs of which all files may be."""
        found = [self.whose(name, data) for name, data in self.visible().items()]
        return set.intersection({0, 1}, *found)

    def after_kill(self):
        assert self.common(), "files of two runs stand together"
        finish_interrupted(self.folder)
        assert set(self.visible()) == set(self.runs[0][1])
        assert len(self.common()) == 1

    def after_run(self, whole):
        assert whole.code == 0, whole.said
        assert self.common() == {self.program.runs % 2}
        assert not [name for name in contents(self.folder) if name.startswith(".")]


def edges(data):
    return json.loads(data)["transforms"]


def first_input(data):
    return json.loads(data)["inputs"][0]["sha256"]


@kills(2, 60)
def test_calibrate_leaves_the_results_of_one_run(datasets, calibrated, tmp_path, count):
    marks = {
        "atom_calibration.json": edges,
        "calibration.json": first_input,
        "command_line_args.yml": lambda data: None,  # both runs differ in the folder only
    }
    folder = tmp_path / "results"
    results = Results(
        folder,
        lambda n: [*CORE, "calibrate", "-json", datasets[n]],
        calibrated,
        marks,
    )
    survive(results.program, count, results.after_kill, results.after_run)


@kills(1, 40)
def test_evaluate_leaves_the_results_of_one_run(datasets, calibrated, tmp_path, count):
    runs = []
    for number, (folder, _) in enumerate(calibrated):
        out, train = tmp_path / f"whole_{number}", folder / "atom_calibration.json"
        words = ["--train", str(train), "--test", str(datasets[number]), "-o", str(out)]
        assert core_main(["evaluate", *words, "--no_report"]) == 0
        runs.append((out, contents(out)))

    def command(number):
        train = calibrated[number][0] / "atom_calibration.json"
        return [*CORE, "evaluate", "--train", train, "--test", datasets[number]]

    marks = {"evaluation.json": first_input}
    results = Results(tmp_path / "results", command, runs, marks)
    survive(results.program, count, results.after_kill, results.after_run)


# --- collectors: the dataset of before, or the new one, and what was collected ------------------


class Collected:
    """A folder with a dataset that is collected anew, again and again."""

    def __init__(self, folder):
        self.folder = folder
        self.before = {}

    def remember(self):
        self.before = self.dataset_files(self.folder)
        assert self.before

    def dataset_files(self, folder):
        """Return the contents of a dataset and of all files that it names; absent: none."""
        path = folder / "dataset.json"
        if not path.exists():
            return {}
        document = json.loads(path.read_text())
        named = [
            entry["data_file"]
            for collection in document["collections"].values()
            for entry in collection["data"].values()
        ]
        return {name: (folder / name).read_bytes() for name in ("dataset.json", *named)}

    def after_kill(self, tmp_path):
        """Demand that what was there before can be had, and so can all that was collected."""
        copy = tmp_path / "copy"
        shutil.copytree(self.folder, copy)
        if (copy / ".previous.partial").is_dir():  # killed while it set the dataset aside
            self.demand_previous(copy)
        else:
            self.demand_both(copy)
        shutil.rmtree(copy)

    def demand_both(self, folder):
        there = self.dataset_files(folder)
        if there == self.before:
            return
        announced = list(folder.glob("collections/[0-9]*.json"))
        if there or announced:
            assert core_main(["recover", str(folder), "--overwrite"]) == 0
            dataset = read_dataset(folder / "dataset.json")
            assert len(dataset.collections) == len(announced) or there
            for key in dataset.collections:
                for name in dataset.sensors:
                    if dataset.data.has_data(key, name):
                        dataset.data.read(key, name)
        if not there or (folder / "previous").is_dir():
            self.demand_previous(folder)
        if there:  # whole, so it is what the next run sets aside
            self.before = there

    def demand_previous(self, folder):
        assert core_main(["recover", str(folder), "--previous"]) == 0
        assert self.dataset_files(folder) == self.before


@pytest.fixture(scope="module")
def live_scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    scene = LiveScene()
    scene.write_config(folder / "config.yml")
    scene.write_bag(str(folder / "a.bag"), keys=COLLECTIONS[:2])
    return folder


@kills(2, 25)
def test_collect_from_bag_keeps_the_dataset_of_before(live_scene, tmp_path, count):
    collected = Collected(tmp_path / "out")
    words = [sys.executable, NODES / "collect_from_bag", "--config", live_scene / "config.yml"]
    words += ["--bag", live_scene / "a.bag", "--output", collected.folder, "--overwrite"]
    program = Program(lambda _: words, collected.folder)

    def after_run(whole):
        assert whole.code == 0, whole.said
        assert not (collected.folder / "previous").exists()
        collected.remember()
        assert len(read_dataset(collected.folder / "dataset.json").collections) == 2

    survive(program, count, lambda: collected.after_kill(tmp_path), after_run)


@pytest.fixture
def ros(tmp_path):
    """Return the environment of a master of its own."""
    with running_master(tmp_path / "ros") as environment:
        yield environment


@pytest.fixture
def labeled_rig(ros):
    """Let a rig and its labelers run."""
    player = ROOT / "atom_calibration" / "tests" / "labeled_rig_player.py"
    process = subprocess.Popen(
        [sys.executable, str(player), "10"],
        env={**os.environ, **ros},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "publishing\n"
    yield process
    process.kill()
    process.wait()


@kills(2, 30)
def test_collect_data_keeps_what_it_has_collected(live_scene, ros, labeled_rig, tmp_path, count):
    collected = Collected(tmp_path / "out")
    words = [sys.executable, NODES / "collect_data", "-c", live_scene / "config.yml"]
    words += ["-o", collected.folder, "--overwrite", "--automatic"]

    def has_two(_seconds):
        return len(list(collected.folder.glob("collections/[0-9]*.json"))) >= 2

    program = Program(lambda _: words, collected.folder, ros, lambda said: "lidar_1" in said)

    def status():
        return json.loads((collected.folder / "status.json").read_text())["exit_code"]

    def after_run(whole):
        assert labeled_rig.poll() is None
        # 1: on a busy machine data may come too late for a collection, which is told
        assert whole.code in (0, 1) and status() == whole.code, whole.said
        assert not (collected.folder / "previous").exists()
        collected.remember()

    def after_kill():
        collected.after_kill(tmp_path)
        assert status() is None

    survive(program, count, after_kill, after_run, stop=asked_when(has_two))


# --- what a person works on ---------------------------------------------------------------------


@kills(1, 20)
def test_playback_leaves_the_dataset_and_a_whole_corrected_one(ros, tmp_path, count):
    path = write_scene(tmp_path / "data")
    before, corrected = contents(path.parent), path.with_name("dataset_corrected.json")
    words = [sys.executable, NODES / "dataset_playback", "-json", path, "--overwrite"]
    program = Program(lambda _: words, path.parent, ros, lambda said: "corrections go to" in said)
    saver = subprocess.Popen(
        [sys.executable, str(ROOT / "tests" / "playback_saver.py"), "rgb_1", "pattern_1"],
        env={**os.environ, **ros},
    )
    try:

        def has_saved(seconds):
            return seconds > 1.0 and corrected.exists()

        def after_run(whole):
            assert whole.code == 0, whole.said
            after_kill()

        def after_kill():
            after = contents(path.parent)
            assert {name: after[name] for name in before} == before
            read_dataset(corrected)
            saved.add(after[corrected.name])

        saved = set()
        survive(program, count, after_kill, after_run, stop=asked_when(has_saved))
        assert len(saved) <= 3, "of the dataset, with and without the label"
    finally:
        saver.kill()
        saver.wait()


@kills(1, 17)
def test_configure_is_done_by_the_next_call(tmp_path, count):
    package = write_package(tmp_path, Make, seconds=1.0)
    given = contents(package)
    words = [sys.executable, NODES / "configure_calibration_pkg", "-n", package]
    program = Program(lambda _: words, package)
    made = {}

    def files():
        """Return what is there of any run; a PDF tells when it was made."""
        found = {name: data for name, data in contents(package).items() if "/." not in name}
        return {n: d[-6:] if n.endswith(".pdf") else d for n, d in found.items()}

    def after_run(whole):
        assert whole.code == 0, whole.said
        now = files()
        now.pop("calibration/generated.json")
        made.update(made or now)
        assert now == made
        for name in files_below(package):
            if name not in given:  # made anew by the next one
                (package / name).unlink()

    def after_kill():
        now = files()
        now.pop("calibration/generated.json", None)
        assert now.items() <= made.items()
        assert {name: (package / name).read_bytes() for name in given} == given

    survive(program, count, after_kill, after_run)


@pytest.mark.parametrize(
    ("simulator", "files", "count"),
    [
        (["robot_simulator", "--robot", "rlbot", "--stops", "1"], 2, 1),
        pytest.param(
            *(["cell_simulator", "--collections", "1"], 4, 8), marks=pytest.mark.long(minutes=4)
        ),
    ],
    ids=["robot", "cell"],
)
def test_a_recording_is_whole_or_that_of_before(tmp_path, simulator, files, count):
    if importlib.util.find_spec("mujoco") is None:
        pytest.skip("MuJoCo is not installed")
    name, *words = simulator
    words = [sys.executable, ROOT / "atom_examples" / "scripts" / name, *words]
    words += ["--bag", tmp_path / "a.bag", "--overwrite", "--scenario", "test"]
    program = Program(lambda number: [*words, "--seed", number % 2], tmp_path)
    runs = {}

    def recording():
        return {
            n: d for n, d in contents(tmp_path).items() if n.startswith("a.") and "active" not in n
        }

    def after_run(whole):
        assert whole.code == 0, whole.said
        made = recording()
        assert len(made) == files
        assert made == runs.setdefault(program.runs % 2, made)

    def after_kill():
        there = recording()
        there.pop("a.fingerprint.json", None)
        if "a.bag" in there:
            assert any(there.items() <= made.items() for made in runs.values())

    after_run(program.run())  # a kill may come when the recording of the other seed is whole
    survive(program, count, after_kill, after_run)
